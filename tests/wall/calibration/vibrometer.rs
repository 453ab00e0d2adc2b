//! A Polytec controller's settings over its serial dialogue, and the amplitude table that is taken live with them: set-points
//! driven on the virtual amplifier over Modbus TCP by the real program, the velocity's amplitude read where the plate moves.

use sim::noise::Noise;
use std::io::{BufRead, BufReader, Write as _};
use std::path::Path;
use std::process::{Child, ChildStdin, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

const FREQUENCY_HZ: f64 = 27_500.0;
/// What the emulated controller says of VD-02 and VD-03: m/s per volt.
const RANGES: [f64; 2] = [0.025, 0.25];

/// Bytes of a stream as they come: a prompt has no end of line.
fn heard(mut stream: impl std::io::Read + Send + 'static) -> Receiver<u8> {
    let (to, from) = channel();
    std::thread::spawn(move || {
        let mut byte = [0];
        while stream.read(&mut byte).is_ok_and(|n| n == 1) && to.send(byte[0]).is_ok() {}
    });
    from
}

/// `muprime virtual-rig` with hands and a vibrometer's controller; ended when dropped.
struct Served {
    child: Child,
    hands: ChildStdin,
    said: std::io::Lines<BufReader<std::process::ChildStdout>>,
    places: Vec<String>,
}

impl Served {
    fn start(folder: &Path, factor: f64) -> Self {
        let ideal = std::fs::read_to_string(tests::file("runs/setups/virtual-ideal.toml")).unwrap();
        let vibrometer =
            "[vibrometer]\nprofile = \"polytec-ofv5000\"\naddress = \"pty\"\ndecoder = \"VD-02\"\n\n";
        let served = ideal.replace("[amplifier]\n", &format!("{vibrometer}[amplifier]\n"));
        std::fs::write(folder.join("served.toml"), &served).unwrap();
        let defects = format!(
            "[[defect]]\nname = \"amplitude_miscalibration\"\nparameters = {{ factor = {factor} }}\n"
        );
        std::fs::write(folder.join("withheld.toml"), defects).unwrap();
        let mut child = tests::muprime()
            .current_dir(folder)
            .args([
                "virtual-rig",
                "--setup",
                "served.toml",
                "--hands",
                "--json",
                "--defects",
                "withheld.toml",
            ])
            .args(["--modbus-tcp", "127.0.0.1:0"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut said = BufReader::new(child.stdout.take().unwrap()).lines();
        let first: serde_json::Value = serde_json::from_str(&said.next().unwrap().unwrap()).unwrap();
        let places = first["instruments"].as_array().unwrap();
        let places: Vec<String> = places.iter().map(|p| p.as_str().unwrap().to_string()).collect();
        let at = |profile: &str| {
            let lead = format!("{profile} at ");
            places.iter().find_map(|p| p.strip_prefix(&lead)).unwrap().to_string()
        };
        // A rig like any other: not `[virtual]`, at the addresses that were given out.
        let text = served
            .replace("address = \"pty\"", &format!("address = \"{}\"", at("polytec-ofv5000")))
            .replace("127.0.0.1:0", &at("muprime-amplifier"))
            .replace("[virtual]\nideal = true\n", "");
        std::fs::write(folder.join("rig.toml"), text).unwrap();
        Served { hands: child.stdin.take().unwrap(), child, said, places }
    }

    /// What the plate does.
    fn seen(&mut self) -> serde_json::Value {
        writeln!(self.hands, "look").unwrap();
        serde_json::from_str(&self.said.next().unwrap().unwrap()).unwrap()
    }

    /// True peak-to-peak motion of the driven plate, m.
    fn look(&mut self) -> f64 {
        let seen = self.seen();
        assert!((seen["frequency_hz"].as_f64().unwrap() - FREQUENCY_HZ).abs() < 1.0, "{seen}");
        seen["amplitude_pp_m"].as_f64().unwrap()
    }

    /// The rig stands still for longer than any of its states may be old: its controller trips.
    fn stand_still(&self) {
        for (signal, ms) in [(libc::SIGSTOP, 400), (libc::SIGCONT, 100)] {
            // SAFETY: a signal to a child that has not been waited for: its id is still its own.
            assert_eq!(unsafe { libc::kill(self.child.id() as i32, signal) }, 0);
            std::thread::sleep(Duration::from_millis(ms));
        }
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The setup with another decoder named, or with another profile.
fn changed(folder: &Path, from: &str, to: &str) {
    let text = std::fs::read_to_string(folder.join("rig.toml")).unwrap();
    assert!(text.contains(from), "{from}");
    std::fs::write(folder.join("other.toml"), text.replace(from, to)).unwrap();
}

fn calibrate(folder: &Path, args: &str) -> std::process::Output {
    tests::muprime().current_dir(folder).args(args.split(' ')).output().unwrap()
}

fn parameter(document: &serde_json::Value, name: &str) -> [f64; 2] {
    let all = document["parameters"].as_array().unwrap();
    let p = all.iter().find(|p| p["name"] == name).unwrap_or_else(|| panic!("{name}: {document}"));
    ["value", "standard_uncertainty"].map(|key| p[key].as_f64().unwrap())
}

#[test]
fn an_amplitude_table_taken_live_finds_the_withheld_scale() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut draw = Noise::new(20_261_121, "live vibrometer");
    let factor = draw.between(0.85, 1.2);
    let mut served = Served::start(at, factor);
    let mut child = tests::muprime()
        .current_dir(at)
        .args(["calibrate", "amplitude", "--setup", "rig.toml", "--form", "bent", "--operator", "O"])
        .args(["--serial", "A-1", "--out", "live.toml", "--json", "--passes", "2", "--settle-s", "0.3"])
        .args(["--live", "0.4e-6", "0.8e-6", "1.2e-6", "1.6e-6", "2e-6"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let said = heard(child.stderr.take().unwrap());
    let mut operator = child.stdin.take().unwrap();
    let (mut line, mut readings, mut trips, mut all) = (String::new(), 0, 0, String::new());
    while let Ok(byte) = said.recv_timeout(Duration::from_secs(60)) {
        line.push(byte as char);
        all.push(byte as char);
        if line.ends_with("volts> ") {
            let w = served.look();
            if readings == 3 {
                served.stand_still();
            }
            // The velocity's amplitude through VD-02, read to half a per cent.
            let volts = std::f64::consts::PI * FREQUENCY_HZ * w / RANGES[0] * (1.0 + 0.005 * draw.normal());
            writeln!(operator, "{volts:.5}").unwrap();
            readings += 1;
            line.clear();
        } else if line.ends_with("again> ") {
            // After a trip nothing is driven before the operator says so.
            std::thread::sleep(Duration::from_millis(300));
            let still = served.seen()["amplitude_pp_m"].as_f64().unwrap();
            assert!(still < 1e-9, "{still} m: {all}");
            trips += 1;
            writeln!(operator).unwrap();
            line.clear();
        }
    }
    // It came byte by byte.
    let all = String::from_utf8(all.chars().map(|byte| byte as u8).collect()).unwrap();
    let done = child.wait_with_output().unwrap();
    assert!(done.status.success(), "{all}");
    assert!(readings >= 11 && trips >= 1, "{readings} readings, {trips} trips: {all}");
    assert!(all.contains("decoder VD-02 (number 0) at 25 mm/s/V, delay 8.160 \u{b5}s"), "{all}");
    let document = &tests::documents(&done)[0];
    let [gain, u] = parameter(document, "gain");
    println!("live: scale {gain:.4} +- {u:.4}, withheld {factor:.4}; {readings} readings");
    assert!((gain - factor).abs() < 4.0 * u && u < 0.03, "{gain} +- {u}, withheld {factor}");
    assert!(document["remarks"].to_string().contains("VD-02"), "{document}");
    let kept = std::fs::read_to_string(at.join("live.csv")).unwrap();
    assert_eq!(kept.lines().count(), 2 + 10, "{kept}");

    // The same table by hand, as volts: the same certificate's numbers.
    let again = calibrate(
        at,
        "calibrate amplitude --setup rig.toml --table live.csv --velocity-volts --form bent --operator O --serial A-1 \
         --out again.toml --json",
    );
    assert!(again.status.success(), "{}", tests::texts(&again).1);
    let [by_hand, _] = parameter(&tests::documents(&again)[0], "gain");
    assert!((by_hand / gain - 1.0).abs() < 1e-9, "{by_hand} {gain}");

    // A wrong decoder answers as plausibly, with ten times the range: only its name tells.
    changed(at, "decoder = \"VD-02\"", "decoder = \"VD-03\"");
    let other = calibrate(
        at,
        "calibrate amplitude --setup other.toml --table live.csv --velocity-volts --form bent --operator O --serial A-1 \
         --out other-certificate.toml --json",
    );
    assert!(other.status.success(), "{}", tests::texts(&other).1);
    let [wrong, _] = parameter(&tests::documents(&other)[0], "gain");
    assert!((wrong / gain - RANGES[1] / RANGES[0]).abs() < 1e-6, "{wrong}");
}

#[test]
fn settings_are_read_back_or_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let served = Served::start(at, 1.0);
    assert!(served.places.iter().any(|p| p.starts_with("polytec-ofv5000 at ")), "{:?}", served.places);
    std::fs::write(
        at.join("volts.csv"),
        "set_point_pp_m,velocity_v\n1e-6,3.4\n2e-6,6.9\n3e-6,10.4\n4e-6,1\n",
    )
    .unwrap();
    let refused = |args: &str, says: &str| {
        let said = calibrate(at, args);
        assert_eq!(said.status.code(), Some(2), "{args}");
        let text = tests::texts(&said).1.split_whitespace().collect::<Vec<_>>().join(" ").replace("│ ", "");
        assert!(text.contains(says), "{args}: {text}");
    };
    let table = "calibrate amplitude --table volts.csv --velocity-volts --operator O --serial A-1 --out c.toml --setup";
    // At the rail of the decoder's output; the row is named.
    refused(&format!("{table} rig.toml"), "row 3: 10.4 V is at the rail");
    // Beyond the decoder's band the amplitude would come out too small.
    refused(&format!("{table} rig.toml --frequency-hz 300000"), "reaches to 250000 Hz");
    changed(at, "decoder = \"VD-02\"", "decoder = \"VD-07\"");
    refused(&format!("{table} other.toml"), "it has no decoder VD-07; it has VD-02, VD-03, VD-09");
    changed(at, "decoder = \"VD-02\"\n", "");
    refused(&format!("{table} other.toml"), "several decoders (VD-02, VD-03, VD-09)");
    changed(at, "polytec-ofv5000", "piezodrive-pdus210");
    refused(&format!("{table} other.toml"), "is not that of a vibrometer");
    refused(&format!("{table} virtual-ideal"), "names no vibrometer");
    refused(
        "calibrate amplitude --setup rig.toml --live 9e-5 --operator O --serial A-1 --out c.toml",
        "at most",
    );
    assert!(!at.join("c.toml").exists());

    // The doctor says what it found, and that it is well.
    let doctor = calibrate(at, "doctor --instruments-only --json --setup rig.toml");
    let found = tests::documents(&doctor).remove(0)["judgement"]["instruments"].clone();
    let vibrometer =
        found.as_array().unwrap().iter().find(|f| f["subject"].to_string().contains("vibrometer")).unwrap();
    assert_eq!(vibrometer["good"], true, "{vibrometer}");
    assert!(vibrometer["found"].to_string().contains("delay 8.160 \u{b5}s"), "{vibrometer}");
    changed(at, "decoder = \"VD-02\"", "decoder = \"VD-07\"");
    let doctor = calibrate(at, "doctor --instruments-only --json --setup other.toml");
    assert_eq!(doctor.status.code(), Some(1));
}

/// The delay that is read back is taken off each decoder line by line: with it on the skin's channel alone
/// the phase moves by 360 f delay, 80.8 degrees; with it on both it cancels.
#[test]
fn the_delay_read_back_is_taken_off_in_phase() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let _served = Served::start(at, 1.0);
    let rate_hz = 1e6;
    let mut draw = Noise::new(3, "phase");
    for repeat in 0..10 {
        let mut text = String::from("plate_v,skin_v\n");
        for i in 0..400 {
            let angle = 2.0 * std::f64::consts::PI * FREQUENCY_HZ * f64::from(i) / rate_hz;
            let noise = [1e-3 * draw.normal(), 1e-3 * draw.normal()];
            text += &format!("{},{}\n", angle.cos() + noise[0], (angle - 0.7).cos() + noise[1]);
        }
        std::fs::write(at.join(format!("w{repeat}.csv")), text).unwrap();
    }
    let waveforms: Vec<String> = (0..10).map(|i| format!("w{i}.csv")).collect();
    let phase = |more: &str| {
        let args = format!(
            "calibrate phase {} --rate-hz 1e6 --operator O --serial P --out p.toml --overwrite --json{more}",
            waveforms.join(" ")
        );
        let said = calibrate(at, &args);
        assert!(said.status.success(), "{}", tests::texts(&said).1);
        let table = std::fs::read_to_string(at.join("PHASES.csv")).unwrap();
        let mut rows = table.lines().map(|l| l.split(',').map(String::from).collect::<Vec<_>>());
        let head = rows.next().unwrap();
        let column = |name: &str| head.iter().position(|h| h == name).unwrap();
        let row = rows.next().unwrap();
        let value = |name: &str| row[column(name)].parse::<f64>().unwrap();
        (value("phase_shift_deg"), value("amplitude_pp_m"))
    };
    let (plain, _) = phase(" --plate-range 25mm/s/V --skin-range 25mm/s/V");
    let (both, w) = phase(" --setup rig.toml");
    // Stated by hand to be none on the plate's channel: then the skin's delay counts in full.
    let (skin_alone, _) = phase(" --setup rig.toml --plate-delay 0us");
    let apart = |a: f64, b: f64| (a - b + 180.0).rem_euclid(360.0) - 180.0;
    println!("no delay {plain:.2} deg, on both {both:.2} deg, on the skin alone {skin_alone:.2} deg");
    assert!(apart(both, plain).abs() < 0.01);
    assert!((apart(skin_alone, plain).abs() - 360.0 * FREQUENCY_HZ * 8.16e-6).abs() < 0.5);
    // 1 V zero to peak through 25 mm/s/V at 27.5 kHz.
    assert!((w / (0.025 / (std::f64::consts::PI * FREQUENCY_HZ)) - 1.0).abs() < 1e-3, "{w}");
}
