//! One channel, followed: its rate, ages, noise, and what it shows that is no value.

use realtime::estimate::Moments;
use realtime::ports::{Channel, Nanos, NoData, Quality, Sample};
use realtime::safety::ChannelTiming;
use runs::format::quantity;
use serde::Serialize;

/// Follows a channel that is read as by the loop.
#[derive(Clone, Debug, Default)]
pub struct Follow {
    reads: u64,
    invalid: u64,
    missing: Option<NoData>,
    last: Option<Sample>,
    values: Moments,
    saturated: u64,
    equal_in_a_row: u32,
    equal_most: u32,
    ages_ms: Vec<f64>,
}

/// A channel as it was found.
#[derive(Clone, Debug, Serialize)]
pub struct ChannelReport {
    /// Its name.
    pub name: &'static str,
    /// Unit of its value.
    pub unit: &'static str,
    /// New samples a second, as the loop sees them.
    pub rate_hz: f64,
    /// Samples a second that are due by setup and profile.
    pub due_hz: f64,
    /// Ages that half, 99 % and all of the reads found, in ms; none where nothing came.
    pub age_ms: Option<[f64; 3]>,
    /// The age in ms from which a run takes the channel as stale.
    pub age_limit_ms: f64,
    /// Mean.
    pub mean: Option<f64>,
    /// Standard deviation of the samples: noise, where the rig is at rest.
    pub noise_sd: Option<f64>,
    /// Share of samples at the ends of the range.
    pub saturated_share: f64,
    /// Share of the reads that found an invalid sample or none.
    pub invalid_share: f64,
    /// Most samples in a row with the same raw value.
    pub equal_in_a_row: u32,
    /// Number of distinct samples.
    pub samples: u64,
    /// Why the last read found no sample.
    pub missing: Option<NoData>,
}

impl Follow {
    /// One read of the loop.
    pub fn take(&mut self, seen: Channel, now: Nanos) {
        self.reads += 1;
        let seen = match seen {
            Ok(seen) => seen,
            Err(why) => {
                self.invalid += 1;
                self.missing = Some(why);
                return;
            }
        };
        self.missing = None;
        self.ages_ms.push(now.since(seen.taken_at).seconds() * 1e3);
        let Some(last) = self.last.replace(seen) else { return };
        // The sample that was there before the first read belongs to no stretch of time.
        if last.sequence == seen.sequence {
            return;
        }
        self.values.push(seen.value);
        self.saturated += u64::from(seen.quality == Quality::Saturated);
        self.equal_in_a_row = if last.raw == seen.raw { self.equal_in_a_row + 1 } else { 1 };
        self.equal_most = self.equal_most.max(self.equal_in_a_row);
    }

    /// What was found in so many seconds.
    pub fn report(
        mut self,
        name: &'static str,
        unit: &'static str,
        timing: &ChannelTiming,
        seconds: f64,
    ) -> ChannelReport {
        let samples = self.values.count();
        let share = |n: u64, of: u64| if of == 0 { 0.0 } else { n as f64 / of as f64 };
        self.ages_ms.sort_by(f64::total_cmp);
        let at = |q: f64| {
            let i = (q * self.ages_ms.len() as f64) as usize;
            self.ages_ms.get(i.min(self.ages_ms.len().saturating_sub(1))).copied()
        };
        ChannelReport {
            name,
            unit,
            rate_hz: samples as f64 / seconds,
            due_hz: 1.0 / timing.period.seconds(),
            age_ms: at(0.5).zip(at(0.99)).zip(at(1.0)).map(|((half, most), all)| [half, most, all]),
            age_limit_ms: timing.age_limit().seconds() * 1e3,
            mean: self.values.mean().or(self.last.map(|last| last.value)).filter(|mean| mean.is_finite()),
            noise_sd: self.values.sd().filter(|sd| sd.is_finite()),
            saturated_share: share(self.saturated, samples),
            invalid_share: share(self.invalid, self.reads),
            equal_in_a_row: self.equal_most,
            samples,
            missing: self.missing,
        }
    }
}

impl ChannelReport {
    /// Two lines for people.
    pub fn words(&self) -> String {
        let noise = self.noise_sd.map_or("-".into(), |sd| quantity(sd, self.unit));
        let value = match (self.mean, self.missing) {
            // What is on or off has no noise.
            (Some(_), None) if self.unit == "1" => String::new(),
            (Some(mean), _) => format!("{}, noise {noise}, ", quantity(mean, self.unit)),
            (None, why) => why.map_or("nothing, ".into(), |why| format!("{why}, ")),
        };
        let limit = self.age_limit_ms;
        let ages = self.age_ms.map_or("-".into(), |[half, most, all]| {
            format!("median {half:.1}, 99 % {most:.1}, greatest {all:.1} ms (limit {limit:.0} ms)")
        });
        let share = |share: f64| format!("{:.1} %", share * 1e2);
        format!(
            "{}: {value}{:.0} of {:.0} samples a second\n        age of samples: {ages}; saturated {}, invalid {}",
            self.name,
            self.rate_hz,
            self.due_hz,
            share(self.saturated_share),
            share(self.invalid_share)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(sequence: u32, raw: i64, at_ms: u64) -> Channel {
        Ok(Sample {
            value: raw as f64 * 1e-3,
            raw,
            taken_at: Nanos(at_ms * 1_000_000),
            sequence,
            quality: if raw > 100 { Quality::Saturated } else { Quality::Good },
        })
    }

    #[test]
    fn samples_ages_and_repeats_are_counted_once() {
        let mut follow = Follow::default();
        let now = |ms: u64| Nanos(ms * 1_000_000);
        // The same sample twice, two new ones, one invalid, three equal, one at the end of the range.
        for (i, seen) in [
            seen(1, 5, 0),
            seen(1, 5, 0),
            seen(2, 6, 2),
            Err(NoData::Invalid),
            seen(3, 7, 4),
            seen(4, 7, 5),
            seen(5, 7, 6),
            seen(6, 101, 7),
        ]
        .into_iter()
        .enumerate()
        {
            follow.take(seen, now(i as u64 + 1));
        }
        let report = follow.report("lateral", "N", &ChannelTiming::SLOW, 0.01);
        assert_eq!((report.samples, report.equal_in_a_row, report.missing), (5, 3, None));
        assert!((report.rate_hz - 500.0).abs() < 1e-9, "{report:?}");
        assert!((report.saturated_share - 0.2).abs() < 1e-12 && (report.invalid_share - 0.125).abs() < 1e-12);
        assert_eq!(report.age_ms, Some([1.0, 2.0, 2.0]));
    }
}
