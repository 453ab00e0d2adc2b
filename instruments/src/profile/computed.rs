//! Signals that are worked out from others: forces from strain gages by the matrix that the instrument was
//! calibrated with, as instruments leave it to the host.

use super::{FrameId, Place, Profile, SignalId, Values};
use crate::expression::Expression;
use crate::schema::Signal;

/// One signal for each member of an array, its name followed by the member's number.
pub(super) fn spread(signals: Vec<Signal>) -> Vec<Signal> {
    let mut all = Vec::with_capacity(signals.len());
    for signal in signals {
        let Some(count) = signal.array else {
            all.push(signal);
            continue;
        };
        let width = signal.number.map_or(0, |number| u16::try_from(number.bytes()).unwrap_or(0));
        for i in 0..count {
            let after = |first: u16, step: u16| first.saturating_add(i.saturating_mul(step));
            let mut member = Signal {
                array: None,
                register: signal.register.map(|at| after(at, width / 2)),
                address: signal.address.map(|at| after(at, width / 2)),
                byte: signal.byte.map(|at| after(at, width)),
                ..signal.clone()
            };
            *member.name.as_mut() = format!("{}{i}", signal.name.as_ref());
            all.push(member);
        }
    }
    all
}

impl Profile {
    /// Works out the computed signals of a frame whose own numbers stand in `values`.
    pub(super) fn work_out(&self, frame: FrameId, values: &mut Values) {
        for (index, value) in self.computed(frame) {
            let signal = &self.signals[index];
            values.0[index] = value.value(&values.0) * signal.scale + signal.offset;
        }
    }

    /// The computed signals of a frame, by their indices.
    fn computed(&self, frame: FrameId) -> impl Iterator<Item = (usize, &Expression)> {
        let signals = self.signals.iter().enumerate().filter(move |(_, signal)| signal.frame == frame);
        signals
            .filter_map(|(i, s)| if let Place::Computed(value) = &s.place { Some((i, value)) } else { None })
    }

    /// What one count of the most telling input changes, in SI units; NaN where a coefficient is not known yet.
    pub(super) fn smallest_step(&self, signal: SignalId, value: &Expression, values: &Values) -> f64 {
        let compiled = &self.signals[signal.0];
        let mut at = values.0.clone();
        let inputs = self.inputs(compiled.frame);
        inputs.iter().for_each(|&input| at[input] = 0.0);
        let zero = value.value(&at);
        let step = |input: usize| {
            let mut there = at.clone();
            there[input] = self.signals[input].scale;
            (value.value(&there) - zero).abs()
        };
        let most =
            inputs.iter().map(|&input| step(input)).reduce(|a, b| if b.is_nan() { b } else { a.max(b) });
        most.map_or(f64::NAN, |step| (step * compiled.scale * compiled.si_factor).abs())
    }

    /// The numbers of a frame that computed signals may be made of: those with a range, its converters' readings.
    pub(super) fn inputs(&self, frame: FrameId) -> Vec<usize> {
        let signals = self.signals.iter().enumerate();
        let reads = |s: &super::CompiledSignal| {
            s.frame == frame && s.range.is_some() && !matches!(s.place, Place::Computed(_))
        };
        signals.filter(|(_, s)| reads(s)).map(|(i, _)| i).collect()
    }

    /// The inputs of a frame for which its computed signals take the values in `unit_value`, as an emulator
    /// needs them. `known` are the values of other frames. `None` where the frame computes nothing, or not as
    /// many signals as it has inputs, or they do not depend on each other one to one.
    pub fn inputs_for(
        &self,
        frame: FrameId,
        known: &Values,
        unit_value: &mut dyn FnMut(SignalId) -> f64,
    ) -> Option<Vec<(SignalId, f64)>> {
        let inputs = self.inputs(frame);
        let computed: Vec<(usize, &Expression)> = self.computed(frame).collect();
        let n = inputs.len();
        if n == 0 || computed.len() != n {
            return None;
        }
        let mut at = known.0.clone();
        inputs.iter().for_each(|&input| at[input] = 0.0);
        // A row for each computed signal: its coefficients and what they must come to.
        let row = |&(index, value): &(usize, &Expression)| {
            let signal = &self.signals[index];
            let zero = value.value(&at);
            let wanted = (unit_value(SignalId(index)) - signal.offset) / signal.scale - zero;
            let slope = |&input: &usize| {
                let mut there = at.clone();
                there[input] = 1.0;
                value.value(&there) - zero
            };
            inputs.iter().map(slope).chain([wanted]).collect()
        };
        let mut rows: Vec<Vec<f64>> = computed.iter().map(row).collect();
        solve(&mut rows)?;
        Some(inputs.into_iter().zip(rows).map(|(input, row)| (SignalId(input), row[n])).collect())
    }
}

/// Gauss and Jordan with the largest pivot; the last column becomes the solution.
fn solve(rows: &mut [Vec<f64>]) -> Option<()> {
    for column in 0..rows.len() {
        let pivot =
            (column..rows.len()).max_by(|&a, &b| rows[a][column].abs().total_cmp(&rows[b][column].abs()))?;
        rows.swap(column, pivot);
        let divisor = rows[column][column];
        if !(divisor.is_finite() && divisor != 0.0) {
            return None;
        }
        rows[column].iter_mut().for_each(|cell| *cell /= divisor);
        let lead = rows[column].clone();
        for (_, row) in rows.iter_mut().enumerate().filter(|(i, _)| *i != column) {
            let factor = row[column];
            row.iter_mut().zip(&lead).for_each(|(cell, lead)| *cell -= factor * lead);
        }
    }
    Some(())
}
