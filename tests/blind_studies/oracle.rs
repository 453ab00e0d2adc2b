//! Lists what the oracle says of sealed sets: `cargo run --release -p muprime-tests --example oracle --
//! COUNT SEED [STRATUM]`.
//!
//! The seeds are those of `muprime blind --sets COUNT --seed SEED`. One line a set: truth, gain, gap over
//! floor, the verdict, the three best imitators with what they leave, seconds. STRATUM: single (default) or
//! alias.
#![allow(clippy::disallowed_methods, reason = "it says how long it took")]

use std::process::ExitCode;
use std::time::Instant;

use sim::sealed::{Ask, Stratum, generate};

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize| arguments.get(i).and_then(|text| text.parse::<u64>().ok());
    let (Some(count), Some(seed)) = (number(0), number(1)) else {
        eprintln!("usage: oracle COUNT SEED [single|alias]");
        return ExitCode::from(2);
    };
    let stratum =
        if arguments.get(2).is_some_and(|s| s == "alias") { Stratum::Alias } else { Stratum::Single };
    for k in 0..count {
        let start = Instant::now();
        let label = generate(seed.wrapping_mul(1_000_003).wrapping_add(k), stratum, Ask::Imitators).label;
        let best: Vec<String> = label
            .imitators
            .iter()
            .take(3)
            .map(|i| {
                let form = i.form_left.map_or_else(String::new, |left| format!(" (form {left:.1})"));
                format!("{} {:.1}{form}", i.name, i.chi2_left)
            })
            .collect();
        println!(
            "{k:3} {:24} gain {:9.1} gap/floor {:6.2} {:11} {}  ({:.2} s)",
            label.causes[0].name,
            label.chi2_gain,
            label.hidden_recalibrated_rmse / label.hidden_floor_rmse.max(1e-12),
            if label.decidable() { "decidable" } else { "undecidable" },
            best.join(", "),
            start.elapsed().as_secs_f64()
        );
    }
    ExitCode::SUCCESS
}
