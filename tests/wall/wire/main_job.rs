//! The main job on every bus: the same plan, world and seed give the same friction in every pass.
//!
//! Passes differ by the sensors' noise and the instants of sampling. What they may differ by is the
//! uncertainty that each run states for each `mu'`, which follows from the repeatability in its setup.

use runs::MeasuredPass;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;
use std::sync::Mutex;
use tests::file;

/// `mu'` of each pass, its standard uncertainty, and whether the plate vibrated, by the number of the pass.
type Passes = BTreeMap<u64, (f64, f64, bool)>;

/// The seeds of the two comparisons that a bus may have. The passes share their reference, so that by chance
/// one in some thirty comparisons lies above the bound; a difference of the bus does so under both seeds.
const SEEDS: [u64; 2] = [11, 12];

/// Sweeps on that setup, inside what `prefix` starts, and returns the passes.
fn sweep(setup: &str, seed: u64, folder: &Path, prefix: Option<&Path>) -> Passes {
    let binary = tests::muprime().get_program().to_owned();
    let unhurried = tests::unhurried(setup, folder);
    let attempt = |number: u32| {
        let folder = folder.join(format!("{setup}-{seed}-{number}"));
        let output = wall::sweep_taken_up_again(&folder, || {
            let mut command = Command::new(prefix.map_or(binary.as_os_str(), Path::as_os_str));
            if prefix.is_some() {
                // A sweep needs a clock that other work does not reach: this guest's counts instructions.
                command.env("CAN_GUEST", "qemu").arg(&binary);
            }
            command.arg("run").arg(file("tests/wall/plans/buses.toml"));
            command.args(["--setup", &unhurried, "--seed", &seed.to_string(), "--out"]).arg(&folder);
            command
        });
        (folder, output)
    };
    // The emulators answer within a millisecond or two: a refusal because an answer stayed away while the rig
    // was being opened is the machine's, and there is no record of stalls before there is a loop.
    let unanswered = |output: &std::process::Output| {
        output.status.code() == Some(2) && tests::texts(output).1.contains("no answer within")
    };
    let mut all = (0..5).map(attempt).skip_while(|(_, output)| unanswered(output));
    let (out, output) = all.next().unwrap_or_else(|| panic!("{setup}: five times no answer at the start"));
    let (_, said) = tests::texts(&output);
    assert!(output.status.success(), "{setup}: {said}");
    read(&out)
}

fn read(out: &Path) -> Passes {
    let text = std::fs::read_to_string(out.join("passes.jsonl")).unwrap();
    let passes = text.lines().map(|line| serde_json::from_str::<MeasuredPass>(line).unwrap());
    let found = |pass: MeasuredPass| {
        let compared = pass.comparison?;
        let on = pass.pass.amplitude.metres() > 0.0;
        Some((pass.pass.point, (compared.mu_relative?, compared.mu_relative_sd?, on)))
    };
    passes.filter_map(found).collect()
}

/// Compares two runs pass by pass, each difference in units of its own standard uncertainty, and says whether
/// they agree within them.
fn same(setup: &str, reference: &Passes, found: &Passes) -> bool {
    let points = |passes: &Passes| passes.keys().copied().collect::<Vec<_>>();
    assert_eq!(points(reference), points(found), "{setup}: the same seed gives the same passes");
    assert!(reference.len() >= 8, "{reference:?}");
    let z: Vec<f64> = reference
        .iter()
        .zip(found.values())
        .map(|((point, (mu, sd, on)), (other, other_sd, other_on))| {
            assert_eq!(on, other_on, "{setup}: pass {point}");
            (other - mu) / sd.hypot(*other_sd)
        })
        .collect();
    let worst = z.iter().fold(0.0_f64, |most, z| most.max(z.abs()));
    let rms = (z.iter().map(|z| z * z).sum::<f64>() / z.len() as f64).sqrt();
    println!(
        "{setup}: {} passes, difference {rms:.2} standard uncertainties rms, {worst:.2} at worst",
        z.len()
    );
    let vibrating = || reference.values().filter(|(.., on)| *on).map(|(mu, ..)| *mu);
    let spread = vibrating().fold(0.0_f64, f64::max) / vibrating().fold(f64::INFINITY, f64::min);
    assert!(spread > 2.0, "the plan must show a reduction, else the comparison is empty: {reference:?}");
    // Of some twenty passes none lies beyond four of its own standard uncertainties by chance.
    worst < 4.0 && rms < 1.5
}

/// What the ideal rig gives under a seed: every bus is compared with the same sweep.
fn reference(seed: u64) -> Passes {
    static MADE: Mutex<BTreeMap<u64, Passes>> = Mutex::new(BTreeMap::new());
    let mut made = MADE.lock().unwrap_or_else(|e| e.into_inner());
    let folder = tempfile::tempdir().unwrap();
    made.entry(seed).or_insert_with(|| sweep("virtual-ideal", seed, folder.path(), None)).clone()
}

/// Sweeps on `setup`, which runs inside what `prefix` starts, and compares with the ideal rig.
fn compare(setup: &str, prefix: Option<&Path>) {
    let agree = |seed: u64| {
        let folder = tempfile::tempdir().unwrap();
        same(setup, &reference(seed), &sweep(setup, seed, folder.path(), prefix))
    };
    assert!(
        SEEDS.into_iter().any(agree),
        "{setup}: another friction than on the ideal rig, under both seeds"
    );
}

#[test]
fn the_same_friction_over_tcp_rtu_slcan_and_mixed_buses() {
    wall::in_wall_clock_time(|| {
        for setup in ["virtual-rtu", "virtual-slcan", "virtual-mixed"] {
            compare(setup, None);
        }
    });
}

/// The same in the guest kernel, on its CAN bus, with a CANopen stage beside the force cell.
#[test]
fn the_same_friction_over_the_kernels_can_bus() {
    compare("virtual-socketcan", Some(&file("tests/can_guest/can-guest")));
}
