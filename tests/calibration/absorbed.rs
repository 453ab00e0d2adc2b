//! An amplitude certificate that is wrong by a factor: what the verdict says of it, by the size of the
//! factor. Only the group `k_n w` enters the model, so a normal stiffness of that factor imitates it exactly;
//! what is told is told because the finger's own calibration (5 %) does not let the stiffness go so far.

use crate::closing::muprime;
use sim::noise::Noise;
use std::fmt::Write as _;
use std::path::Path;

/// Sweeps of each factor: one, two in `tests/run long`, or as `MUPRIME_ABSORBED_SWEEPS` says
/// (docs/calibration.md quotes 12).
fn sweeps() -> u64 {
    let stated = std::env::var("MUPRIME_ABSORBED_SWEEPS").ok().and_then(|n| n.parse().ok());
    stated.unwrap_or(tests::rounds(1, 2))
}

/// First seed of the sweeps, fixed before the first of them was run.
const FIRST_SEED: u64 = 7_100;

/// What became of the sweeps of one factor.
#[derive(Default)]
struct Told {
    no_gap: u64,
    stiffness: u64,
    other: u64,
    /// The certificate is named, in doubt or at fault.
    certificate: u64,
    pulls: Vec<f64>,
}

/// A setup of the ideal rig whose amplitude certificate says `factor` times what the plate does.
fn rig_with_certificate(at: &Path, factor: f64) {
    let mut draw = Noise::new(11, "vibrometer");
    let mut table = String::from("set_point_pp_m,amplitude_pp_m\n");
    for k in 1..=24 {
        let set = f64::from((k + 2) / 3) * 0.4e-6;
        let _ = writeln!(table, "{set:e},{:e}", factor * set * (1.0 + 0.004 * draw.normal()));
    }
    std::fs::write(at.join("table.csv"), table).unwrap();
    let args = "calibrate amplitude --table table.csv --form bent --serial A-1 --operator O --out a.toml --overwrite";
    let said = muprime(at, args);
    assert!(said.status.success(), "{}", tests::texts(&said).1);
    let ideal = std::fs::read_to_string(tests::file("runs/setups/virtual-ideal.toml")).unwrap();
    let setup = ideal
        .replace("name = \"virtual-ideal\"", "name = \"wrong\"\ncertificates = [\"a.toml\"]")
        .replace("profile = \"muprime-amplifier\"", "profile = \"muprime-amplifier\"\nserial = \"A-1\"");
    for sweep in 0..sweeps() {
        // Another finger each time, as its calibration's 5 % have it: it may hide the error or enlarge it.
        let own =
            setup.replace("ideal = true", &format!("ideal = true\nfinger_seed = {}", FIRST_SEED + sweep));
        std::fs::write(at.join(format!("wrong{sweep}.toml")), own).unwrap();
    }
}

fn told(factor: f64) -> Told {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    rig_with_certificate(at, factor);
    let mut told = Told::default();
    for sweep in 0..sweeps() {
        let run = muprime(
            at,
            &format!("run --setup wrong{sweep}.toml --fast --out r{sweep} --seed {}", FIRST_SEED + sweep),
        );
        assert!(run.status.success(), "{factor}: {}", tests::texts(&run).1);
        let said = muprime(at, &format!("diagnose r{sweep} --json"));
        let verdict = tests::documents(&said).remove(0);
        let leads = verdict["hypotheses"][0]["alias_class"].to_string();
        match verdict["verdict"].as_str() {
            Some("no_gap") => told.no_gap += 1,
            Some(_) if leads.contains("stiffness_error") => told.stiffness += 1,
            _ => told.other += 1,
        }
        let names = |list: &serde_json::Value| list.to_string().contains("amplitude certificate (a.toml)");
        let named = names(&verdict["certificates_in_doubt"]) || names(&verdict["certificates_at_fault"]);
        told.certificate += u64::from(named);
        if let Some(pull) = verdict["stiffness_pulls"][0]["pull_sd"].as_f64() {
            told.pulls.push(pull);
            assert_eq!(
                named,
                pull.abs() >= diagnosis::report::pulls::REMARKABLE
                    || names(&verdict["certificates_at_fault"])
            );
            let remarks = verdict["remarks"].to_string();
            assert_eq!(
                remarks.contains("normal stiffness of"),
                pull.abs() >= diagnosis::report::pulls::REMARKABLE,
                "{remarks}"
            );
        }
    }
    told.pulls.sort_by(f64::total_cmp);
    told
}

#[test]
fn a_wrong_amplitude_certificate_is_told_beyond_what_the_stiffness_may_be() {
    println!(
        "certificate over truth | named certificate | no gap | stiffness | other | pull, least median most"
    );
    // The last four are shown and not judged.
    let factors = [1.0, 1.5, 1.0 / 1.5, 1.1, 1.0 / 1.1, 1.25, 0.8];
    for &factor in &factors[..tests::rounds(3, 7)] {
        let t = told(factor);
        let at = |share: f64| {
            t.pulls.get((share * (t.pulls.len() as f64 - 1.0)) as usize).copied().unwrap_or(f64::NAN)
        };
        println!(
            "{factor:6.3} | {:2} of {} | {} | {} | {} | {:+.1} {:+.1} {:+.1}",
            t.certificate,
            sweeps(),
            t.no_gap,
            t.stiffness,
            t.other,
            at(0.0),
            at(0.5),
            at(1.0)
        );
        // Sound: nothing is put in doubt. Beyond ten times the stiffness's 5 %: always.
        if factor == 1.0 {
            assert!(t.certificate * 20 <= sweeps(), "a sound certificate is in doubt");
        }
        if !(0.7..=1.4).contains(&factor) {
            assert_eq!(t.certificate, sweeps(), "factor {factor}");
        }
    }
}

#[test]
fn a_factor_of_two_is_refused_before_anything_moves() {
    let folder = tempfile::tempdir().unwrap();
    for factor in [2.0, 0.5] {
        rig_with_certificate(folder.path(), factor);
        let said = muprime(folder.path(), "run --setup wrong0.toml --fast --out c");
        assert_eq!(said.status.code(), Some(2), "{factor}");
        assert!(!folder.path().join("c").exists());
    }
}
