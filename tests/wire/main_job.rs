//! The main job on every bus: the same plan, world and seed give the same friction per pass.
//!
//! The passes' means differ by the sensors' noise and the instants of sampling; what they may differ
//! by is the repeatability that the setups state, 1.5 % of the lateral force and 0.8 mN a pass.

use super::peers::file;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

/// A machine shared with others may hold a link up until it times out or the loop trips, as it should; the run is then
/// done again.
const TRIES: usize = 4;

/// Mean of `direction * lateral / normal` by amplitude set-point in nm, of a finished run.
pub fn friction(setup: &str, out: &Path, prefix: Option<&Path>) -> BTreeMap<i64, f64> {
    let binary = tests::muprime().get_program().to_owned();
    let mut last = String::new();
    for _ in 0..TRIES {
        let _ = std::fs::remove_dir_all(out);
        let mut command = match prefix {
            Some(guest) => {
                let mut command = Command::new(guest);
                command.arg(&binary);
                command
            }
            None => Command::new(&binary),
        };
        let output = command
            .arg("run")
            .arg(file("tests/plans/buses.toml"))
            .args(["--setup", setup, "--seed", "11", "--out"])
            .arg(out)
            .output()
            .unwrap();
        last = String::from_utf8_lossy(&output.stderr).into_owned();
        if output.status.success() {
            return read(out);
        }
        let held_up = ["Stale", "Overrun", "no answer within"].iter().any(|sign| last.contains(sign));
        assert!(held_up, "{setup}: {last}");
    }
    panic!("{setup}: tripped {TRIES} times: {last}");
}

fn read(out: &Path) -> BTreeMap<i64, f64> {
    let text = std::fs::read_to_string(out.join("points.csv")).unwrap();
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().unwrap().split(',').collect();
    let column = |name: &str| head.iter().position(|h| *h == name).unwrap();
    let (w, direction) = (column("amplitude_pp_m"), column("direction"));
    let (lateral, normal) = (column("lateral_force_n"), column("normal_force_n"));
    let mut sums: BTreeMap<i64, (f64, f64)> = BTreeMap::new();
    for line in lines {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN)).collect();
        // The echoed amplitude is quantised: to the nearest quarter of a micrometre it is the plan's.
        #[allow(clippy::cast_possible_truncation)]
        let key = (cells[w] / 250e-9).round() as i64 * 250;
        let sum = sums.entry(key).or_default();
        sum.0 += cells[direction] * cells[lateral] / cells[normal];
        sum.1 += 1.0;
    }
    sums.into_iter().map(|(key, (sum, count))| (key, sum / count)).collect()
}

/// Compares two runs, amplitude by amplitude: four standard deviations of the difference of two means
/// of at least two passes, by the repeatability that the setups state.
pub fn compare(setup: &str, reference: &BTreeMap<i64, f64>, found: &BTreeMap<i64, f64>) {
    assert_eq!(reference.keys().collect::<Vec<_>>(), found.keys().collect::<Vec<_>>(), "{setup}");
    for (amplitude, mu) in reference {
        let sd = ((0.015 * mu).powi(2) + (0.0008_f64 / 0.25).powi(2)).sqrt();
        let difference = found[amplitude] - mu;
        assert!(difference.abs() < 4.0 * sd, "{setup} at {amplitude} nm: {} and {mu}", found[amplitude]);
    }
    let spread = reference.values().fold(0.0_f64, |most, mu| most.max(*mu))
        / reference.values().fold(f64::INFINITY, |least, mu| least.min(*mu));
    assert!(spread > 2.0, "the plan must show a reduction, else the comparison is empty: {reference:?}");
}

#[test]
fn the_same_friction_over_tcp_rtu_slcan_and_mixed_buses() {
    let folder = tempfile::tempdir().unwrap();
    let reference = friction("virtual-ideal", &folder.path().join("tcp"), None);
    for setup in ["virtual-rtu", "virtual-slcan", "virtual-mixed"] {
        let found = friction(setup, &folder.path().join(setup), None);
        compare(setup, &reference, &found);
    }
}

/// The same in the guest kernel, on its CAN bus, with a CANopen stage beside the force cell.
#[test]
fn the_same_friction_over_the_kernels_can_bus() {
    let folder = tempfile::tempdir().unwrap();
    let reference = friction("virtual-ideal", &folder.path().join("tcp"), None);
    let guest = file("tests/can_guest/can-guest");
    let found = friction("virtual-socketcan", &folder.path().join("can"), Some(&guest));
    compare("virtual-socketcan", &reference, &found);
}
