//! Time of a verdict on 500 passes: single effects alone, and with pairs.
//!
//! `cargo bench -p muprime-rig --bench diagnosis`

use diagnosis::data::{RigFile, Table};
use diagnosis::{Options, diagnose};
use models::Condition;
use sim::sealed::{Ask, Stratum, generate_with_rig};

const PASSES: usize = 500;

fn main() {
    divan::main();
}

/// A sealed set whose sweep was gone through again until it had 500 passes.
fn table(stratum: Stratum) -> (Table, RigFile) {
    let (set, mut sealed) = generate_with_rig(4242, stratum, Ask::Gain);
    let mut passes = set.passes.clone();
    let again: Vec<Condition> = set
        .passes
        .iter()
        .cycle()
        .take(PASSES.saturating_sub(passes.len()))
        .map(|p| Condition {
            amplitude: p.amplitude,
            frequency_hz: p.frequency_hz,
            speed_m_s: p.speed_m_s,
            direction: p.direction,
            normal_force_n: p.normal_force_n,
            position_m: p.position_m,
            ambient_pressure_pa: p.ambient_pressure_pa,
            ..Condition::paper()
        })
        .collect();
    passes.extend(sealed.measure(&again));
    passes.truncate(PASSES);
    let rig = RigFile::parse(&set.rig_toml).expect("rig.toml of a sealed set");
    (Table::measured(&passes).expect("table of a sealed set"), rig)
}

#[divan::bench(sample_count = 5, sample_size = 1)]
fn singles(bencher: divan::Bencher<'_, '_>) {
    let (table, rig) = table(Stratum::Single);
    let options = Options { pairs: false, ..Options::default() };
    bencher.bench(|| diagnose(&table, &rig, &options, String::new()).report.verdict);
}

#[divan::bench(sample_count = 5, sample_size = 1)]
fn with_pairs(bencher: divan::Bencher<'_, '_>) {
    let (table, rig) = table(Stratum::Pair);
    bencher.bench(|| diagnose(&table, &rig, &Options::default(), String::new()).report.verdict);
}
