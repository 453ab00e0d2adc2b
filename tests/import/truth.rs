//! The passes that every foreign table holds, and how an import is compared with them.

use models::pass::{Pass, read_passes};
use serde_json::Value;
use std::fmt::Write;
use std::path::Path;
use std::process::Output;
use tests::{muprime, texts};

/// A pass of the truth as decimal texts: what a person would type in SI is what every source holds in units of its own.
pub struct Truth {
    pub time_s: u32,
    pub amplitude_nm: u32,
    pub frequency_hz: u32,
    pub speed_um_s: u32,
    pub direction: i8,
    pub position_um: i32,
    pub normal_mn: u32,
    pub lateral_un: i64,
}

/// Passes with every digit that an instrument might give, 4 amplitudes by 3 speeds by both directions.
pub fn truth(still: bool) -> Vec<Truth> {
    let mut all = Vec::new();
    for (k, amplitude_nm) in [0, 731, 1513, 2999].into_iter().enumerate() {
        for (j, speed_um_s) in [5003, 20_011, 79_999].into_iter().enumerate() {
            for direction in [1i8, -1] {
                let n = all.len() as u32;
                let normal_mn = 247 + n % 7;
                let amplitude_nm = if still { 0 } else { amplitude_nm };
                let mu_ppm = 500_000 - if still { 0 } else { 70_000 * k as i64 }
                    + 3_001 * j as i64
                    + 17 * i64::from(n);
                all.push(Truth {
                    time_s: 7 * n,
                    amplitude_nm,
                    frequency_hz: 27_513,
                    speed_um_s,
                    direction,
                    position_um: 137 * n as i32 - 900,
                    normal_mn,
                    lateral_un: i64::from(direction) * mu_ppm * i64::from(normal_mn) / 1000,
                });
            }
        }
    }
    all
}

/// `n` with its point moved: the decimal that a person writes.
pub fn moved(n: i64, places: usize) -> String {
    let digits = format!("{:0width$}", n.unsigned_abs(), width = places + 1);
    let (whole, rest) = digits.split_at(digits.len() - places);
    let sign = if n < 0 { "-" } else { "" };
    if places == 0 { format!("{sign}{whole}") } else { format!("{sign}{whole}.{rest}") }
}

pub fn number(n: i64, places: usize) -> f64 {
    moved(n, places).parse().unwrap()
}

pub fn same(passes: &[Pass], truth: &[Truth], ulps: u64, what: &str) {
    assert_eq!(passes.len(), truth.len(), "{what}");
    for (p, t) in passes.iter().zip(truth) {
        let pairs = [
            ("time_s", p.time_s, f64::from(t.time_s)),
            ("amplitude_pp_m", p.amplitude.metres(), number(t.amplitude_nm.into(), 9)),
            ("speed_m_s", p.speed_m_s, number(t.speed_um_s.into(), 6)),
            ("direction", p.direction.sign(), f64::from(t.direction)),
            ("normal_force_n", p.normal_force_n, number(t.normal_mn.into(), 3)),
            ("lateral_force_n", p.lateral_force_n.unwrap(), number(t.lateral_un, 6)),
        ];
        for (name, is, was) in pairs {
            let apart = is.to_bits().abs_diff(was.to_bits());
            assert!(apart <= ulps, "{what}: {name} is {is:e}, was {was:e}: {apart} last digits apart");
        }
    }
}

pub struct Import {
    pub output: Output,
    pub passes: Vec<Pass>,
    pub log: Value,
}

pub fn import(folder: &Path, source: &Path, arguments: &[&str]) -> Import {
    let out = folder.join(format!("out-{}", source.file_name().unwrap().to_str().unwrap()));
    let output = muprime().arg("import").arg(source).args(arguments).arg("-o").arg(&out).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{source:?}: {}", texts(&output).1);
    let passes = read_passes(std::fs::File::open(out.join("points.csv")).unwrap()).unwrap();
    let log = serde_json::from_str(&std::fs::read_to_string(out.join("import.json")).unwrap()).unwrap();
    models::rig_file::RigFile::parse(&std::fs::read_to_string(out.join("rig.toml")).unwrap()).unwrap();
    Import { output, passes, log }
}

/// A text of the passes: a header, then a line a pass with these cells.
pub fn lines(truth: &[Truth], header: &str, cell: impl Fn(&Truth) -> String) -> String {
    let mut text = format!("{header}\n");
    for t in truth {
        writeln!(text, "{}", cell(t)).unwrap();
    }
    text
}
