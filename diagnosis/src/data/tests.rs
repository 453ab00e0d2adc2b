//! Tables that are refused, and what a table can show.

use super::*;
use crate::tests::{Deviates, rig, table};
use crate::{Options, diagnose};
use models::pass::read_passes;

/// A table of passes of a plate that stands still: friction of 0.5 N/N, forces by a rule.
fn still(count: usize, force: impl Fn(usize, f64, f64) -> f64) -> Vec<Pass> {
    let mut csv = String::from(
        "point,time_s,amplitude_pp_m,frequency_hz,speed_m_s,direction,position_m,normal_force_n,lateral_force_n\n",
    );
    for i in 0..count {
        let (direction, load) = (if i % 2 == 0 { 1.0 } else { -1.0 }, 0.2 + 0.05 * (i % 5) as f64);
        let force = force(i, direction, load);
        csv += &format!("{i},{},0,27500,0.02,{direction},0.01,{load},{force}\n", 5 * i);
    }
    read_passes(csv.as_bytes()).expect("a table")
}

/// Magnitudes in both directions are refused, with what is needed; signed forces are not, nor those with an
/// offset that hides the turn of friction.
#[test]
fn forces_without_a_sign_are_refused() {
    let unsigned = Table::measured(&still(16, |_, _, load| 0.5 * load));
    assert_eq!(unsigned.err(), Some(DataError::Unsigned));
    assert!(DataError::Unsigned.to_string().contains("signed"));
    assert!(Table::measured(&still(16, |_, direction, load| 0.5 * load * direction)).is_ok());
    assert!(Table::measured(&still(16, |_, direction, load| 0.5 * load * direction + 0.4)).is_ok());
}

/// A plate that stands still shows laws of friction: nothing about them needs a vibration.
#[test]
fn laws_of_friction_can_be_told_with_the_plate_still() {
    let table = Table::measured(&still(16, |_, direction, load| 0.5 * load * direction)).unwrap();
    assert_eq!(table.lacks(&[Need::Loads]), None);
    assert!(table.lacks(&[Need::Speeds]).is_some() && table.lacks(&[Need::Vibration]).is_some());
    let mut vibrating = self::table(&mut Deviates(3), 0.0);
    vibrating
        .passes
        .iter_mut()
        .filter(|p| p.amplitude > PeakToPeak::ZERO)
        .for_each(|p| p.normal_force_n = 0.3);
    assert_eq!(vibrating.lacks(&[Need::Loads]), None, "the still passes have three loads");
    assert!(vibrating.lacks(&[Need::Vibration, Need::Loads]).is_some());
}

/// Twelve still passes, in one direction and at one time, give an answer, and figures that they cannot give are none.
#[test]
fn twelve_still_passes_at_one_time_give_an_answer() {
    let mut passes = still(12, |_, direction, load| 0.5 * load * direction);
    passes.iter_mut().for_each(|p| {
        p.time_s = 0.0;
        p.lateral_force_n = p.lateral_force_n.map(f64::abs);
        p.direction = models::quantity::Direction::Forward;
    });
    let table = Table::measured(&passes).unwrap();
    let report = diagnose(&table, &rig(), &Options::default(), String::new()).report;
    let sum: f64 = report.hypotheses.iter().map(|h| h.probability).sum();
    assert!((sum - 1.0).abs() < 1e-9, "{sum}");
    assert!(report.gap.noise_floor_rmse.is_none_or(|rmse| rmse > 0.0), "{:?}", report.gap);
}
