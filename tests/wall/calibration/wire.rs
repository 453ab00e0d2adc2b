//! Calibrations over real protocols: the virtual rig behind Modbus TCP (whole numbers, then floats) and
//! behind CAN (slcan on a pseudo-terminal), with gains, cross-talk, offset, lag and amplitude scale withheld, weighed
//! and looked at as an operator would.
//!
//! Each is one shot in wall-clock time, which no seed repeats. So the bound is stated beforehand and wider than the 95 %
//! whose coverage the trials judge: the truth within four standard uncertainties, for the delay one-sided as well the
//! time that the bus itself may take. How many lie within their 95 % intervals is printed.

use calibration::force::dynamics::step_responses;
use calibration::force::series::Weighing;
use calibration::latency::channel_delay;
use models::{FrictionModel, PeakToPeak, SpringSlider};
use realtime::Nanos;
use realtime::cycle::{Command, CycleState, Marker};
use realtime::cycle_io::{Ports, Tick, run_cycle};
use realtime::safety::Request;
use runs::Setup;
use sim::defects::Defects;
use sim::noise::Noise;
use sim::wire::SharedPlant;
use sim::wire::world::{Hands, WorldPlant};
use sim::world::{World, WorldConfig};
use std::fmt::Write as _;
use std::io::{BufRead, BufReader, Write as _};
use std::path::Path;
use std::process::{Child, ChildStdin, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// Standard uncertainties that the truth may lie off, in one shot.
const WITHIN: f64 = 4.0;

/// Lines of a stream as they come, from a thread of its own.
fn lines(stream: impl std::io::Read + Send + 'static) -> Receiver<String> {
    let (to, from) = channel();
    std::thread::spawn(move || {
        for line in BufReader::new(stream).lines().map_while(Result::ok) {
            if to.send(line).is_err() {
                return;
            }
        }
    });
    from
}

fn next(lines: &Receiver<String>, what: &str) -> String {
    lines.recv_timeout(Duration::from_secs(60)).unwrap_or_else(|e| panic!("{what}: {e}"))
}

/// `muprime virtual-rig` with hands; ended when dropped.
struct Served {
    child: Child,
    hands: ChildStdin,
    said: Receiver<String>,
    /// Where each instrument is.
    instruments: Vec<String>,
}

impl Served {
    fn start(folder: &Path, setup: &str, more: &[&str]) -> Self {
        let mut child = tests::muprime()
            .current_dir(folder)
            .args(["virtual-rig", "--setup", setup, "--hands", "--json", "--defects", "withheld.toml"])
            .args(["--modbus-tcp", "127.0.0.1:0"])
            .args(more)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let said = lines(child.stdout.take().unwrap());
        let first: serde_json::Value = serde_json::from_str(&next(&said, "the virtual rig")).unwrap();
        let places = first["instruments"].as_array().unwrap();
        let instruments = places.iter().map(|p| p.as_str().unwrap().to_string()).collect();
        Served { hands: child.stdin.take().unwrap(), child, said, instruments }
    }

    /// Address of the first instrument of that profile.
    fn address(&self, profile: &str) -> &str {
        let lead = format!("{profile} at ");
        self.instruments.iter().find_map(|p| p.strip_prefix(&lead)).unwrap()
    }

    fn hang(&mut self, lateral_n: f64, normal_n: f64) {
        writeln!(self.hands, "hang {lateral_n} {normal_n}").unwrap();
        let answer = next(&self.said, "hands");
        assert!(answer.contains("hung_n"), "{answer}");
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Withheld from the operator, drawn from a seed of its own.
struct Withheld {
    gain: f64,
    cross_talk: [f64; 2],
    offset_n: f64,
}

impl Withheld {
    fn draw(draw: &mut Noise) -> Self {
        Withheld {
            gain: draw.between(0.85, 1.15),
            cross_talk: [draw.between(-0.08, 0.08), draw.between(0.005, 0.02)],
            offset_n: draw.between(-0.1, 0.1),
        }
    }

    fn toml(&self) -> String {
        format!(
            "[[defect]]\nname = \"force_crosstalk\"\nparameters = {{ lateral_per_normal = {}, normal_per_lateral = {} }}\n\
             [[defect]]\nname = \"lateral_gain\"\nparameters = {{ factor = {} }}\n\
             [[defect]]\nname = \"normal_offset\"\nparameters = {{ offset_n = {}, sinking = 0.0 }}\n",
            self.cross_talk[0], self.cross_talk[1], self.gain, self.offset_n
        )
    }

    /// Counts per newton, by the names of the certificate, and the zero of the normal channel in counts.
    fn truth(&self, counts_per_n: f64) -> [(&'static str, f64); 5] {
        [
            ("lateral.gain_lateral", counts_per_n * self.gain),
            ("lateral.gain_normal", counts_per_n * self.gain * self.cross_talk[0]),
            ("normal.gain_lateral", counts_per_n * self.cross_talk[1]),
            ("normal.gain_normal", counts_per_n),
            ("normal.offset", counts_per_n * self.offset_n),
        ]
    }
}

/// Within how many standard uncertainties a parameter is of its truth, and whether its 95 % interval holds it.
fn judge(bus: &str, parameters: &serde_json::Value, name: &str, truth: f64) -> bool {
    let all = parameters.as_array().unwrap();
    let p = all.iter().find(|p| p["name"] == name).unwrap_or_else(|| panic!("{name} in {parameters}"));
    let number = |v: &serde_json::Value| v.as_f64().unwrap();
    let (value, u) = (number(&p["value"]), number(&p["standard_uncertainty"]));
    let held = (number(&p["ci95"][0])..=number(&p["ci95"][1])).contains(&truth);
    println!("{bus:>10} {name:>22}: {value:12.5e} +- {u:.1e}, truth {truth:12.5e}, 95 % holds it: {held}");
    assert!((value - truth).abs() <= WITHIN * u, "{bus}: {name} = {value} +- {u}, truth {truth}");
    held
}

/// A guided dead-weight series with the real program against the served rig; returns the certificate's JSON.
fn weigh(folder: &Path, served: &mut Served, setup: &str, draw: &mut Noise) -> serde_json::Value {
    let weighing = Weighing::default();
    let load_error = weighing.relative_sd() * draw.normal();
    let pull: Vec<f64> = weighing.alignment_sd_rad.iter().map(|sd| sd * draw.normal()).collect();
    let mut child = tests::muprime()
        .current_dir(folder)
        .args(["calibrate", "force", "--setup", setup, "--average-s", "0.4", "--operator", "O", "--serial"])
        .args(["W-1", "--json", "--out", "weighed.toml"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let said = lines(child.stderr.take().unwrap());
    let mut operator = child.stdin.take().unwrap();
    let mut reading = |axis: &str, mass_kg: f64, branch: &str| {
        let force = weighing.load_n(mass_kg) * (1.0 + load_error);
        match axis {
            "lateral" => served.hang(force * pull[0].cos(), force * pull[0].sin()),
            "normal" => served.hang(force * pull[1].sin(), force * pull[1].cos()),
            _ => served.hang(0.0, 0.0),
        }
        // Until nothing swings.
        std::thread::sleep(Duration::from_millis(100));
        // A machine that stalls takes a link down; it comes back, and the operator tries again as told.
        for _ in 0..20 {
            let line = if axis == "zero" { "zero".into() } else { format!("{axis} {mass_kg} {branch}") };
            writeln!(operator, "{line}").unwrap();
            loop {
                let heard = next(&said, "the guided series");
                if heard.contains(" counts") && heard.contains("means of") {
                    return;
                }
                if heard.contains("no reading") {
                    eprintln!("{heard}");
                    std::thread::sleep(Duration::from_millis(500));
                    break;
                }
            }
        }
        panic!("twenty readings in a row failed");
    };
    for _ in 0..2 {
        for (axis, sign) in [("lateral", 1.0), ("lateral", -1.0), ("normal", 1.0)] {
            reading("zero", 0.0, "");
            for mass in [0.02, 0.05, 0.1, 0.15] {
                reading(axis, sign * mass, "up");
            }
            for mass in [0.1, 0.05, 0.02] {
                reading(axis, sign * mass, "down");
            }
        }
    }
    reading("zero", 0.0, "");
    writeln!(operator, "done").unwrap();
    let done = child.wait_with_output().unwrap();
    let rest: Vec<String> = said.iter().collect();
    assert!(done.status.success(), "{}", rest.join("\n"));
    tests::documents(&done).remove(0)
}

#[test]
fn dead_weights_over_modbus_and_can_find_what_was_withheld() {
    // The muprime instrument's registers count 10 uN, the ATI's CAN frames 0.5 mN (their profiles' scales); a
    // count of a float is 1e-12 of its unit.
    for (bus, setup, profile, counts_per_n, more) in [
        ("modbus-tcp", "virtual-ideal", "muprime-force2", 1e5, vec![]),
        ("floats", "virtual-ideal", "strain-amp", 1e12, vec![]),
        ("slcan", "virtual-slcan", "ati-netft-can", 2e3, vec!["--can", "slcan:pty"]),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        let mut draw = Noise::new(20_261_122, bus);
        let withheld = Withheld::draw(&mut draw);
        std::fs::write(at.join("withheld.toml"), withheld.toml()).unwrap();
        let mut text = std::fs::read_to_string(tests::file(&format!("runs/setups/{setup}.toml"))).unwrap();
        if bus == "floats" {
            std::fs::copy(tests::file("docs/profiles/strain-amp.toml"), at.join("strain-amp.toml")).unwrap();
            text = text.replacen("muprime-force2", "strain-amp.toml", 1);
        }
        std::fs::write(at.join("served.toml"), &text).unwrap();
        let mut served = Served::start(at, "served.toml", &more);
        // A rig like any other: not `[virtual]`, at the addresses that were given out.
        let (force, tcp) = (served.address(profile), served.address("muprime-stage"));
        let text = text
            .replace("slcan:pty", force)
            .replace("127.0.0.1:0", tcp)
            .replace("[virtual]\nideal = true\n", "");
        std::fs::write(at.join("rig.toml"), text).unwrap();
        let found = weigh(at, &mut served, "rig.toml", &mut draw);
        let truth = withheld.truth(counts_per_n);
        let held =
            truth.iter().filter(|(name, truth)| judge(bus, &found["parameters"], name, *truth)).count();
        println!("{bus:>10}: {held} of {} within their 95 % intervals", truth.len());
    }
}

/// A rig in this process behind its real protocols, and the operator's hands at it.
struct Bench {
    plant: SharedPlant,
    hands: Hands,
    rig: drivers::Rig,
    setup: Setup,
    epoch: Instant,
    _emulators: rig::emulators::Emulators,
}

impl Bench {
    fn new(setup: &str, config: &WorldConfig) -> Self {
        let setup = Setup::load(setup).unwrap();
        let epoch = Instant::now();
        let (world, hands) = WorldPlant::at_hand(World::new(config, 7).unwrap());
        let plant = SharedPlant::new(world, epoch);
        let mut instruments = setup.instruments();
        let emulators = rig::emulators::serve(&mut instruments, &plant, false).unwrap();
        let rig = wall::bench::opened(&instruments, epoch);
        Bench { plant, hands, rig, setup, epoch, _emulators: emulators }
    }

    fn now(&self) -> Nanos {
        Nanos(u64::try_from(self.epoch.elapsed().as_nanos()).unwrap())
    }

    /// Samples of the lateral axis at the time of their arrival, once each, until a time. (The driver's own
    /// stamps take the shortest transport off, and with it a constant delay: they cannot show it.)
    fn listen(&mut self, until: Nanos, samples: &mut Vec<(f64, f64)>) {
        let mut last = None;
        while self.now() < until {
            if let Ok(reading) = self.rig.force.read(self.now()).lateral
                && last != Some(reading.sequence)
            {
                last = Some(reading.sequence);
                samples.push((self.now().seconds(), reading.value));
            }
            std::thread::sleep(Duration::from_micros(200));
        }
    }
}

/// The longest that a sample may take on the bus in s: a period of sampling or polling at 500 Hz, the world's
/// tick, and what a loopback and a busy machine's scheduler add to the fastest of many samples.
const BUS_S: f64 = 5e-3;

#[test]
fn a_withheld_lag_is_found_over_modbus_and_can() {
    for (bus, setup) in [("modbus-tcp", "virtual-ideal"), ("slcan", "virtual-slcan")] {
        let mut draw = Noise::new(20_261_123, bus);
        let (delay, bandwidth) = (draw.between(8e-3, 20e-3), draw.between(40.0, 80.0));
        let defects = format!(
            "[[defect]]\nname = \"time_misalignment\"\nparameters = {{ delay_s = {delay} }}\n\
             [[defect]]\nname = \"sensor_lag\"\nparameters = {{ bandwidth_hz = {bandwidth} }}\n"
        );
        let config = WorldConfig { defects: Defects::parse(&defects).unwrap(), ..WorldConfig::ideal() };
        let truth = delay + config.sensor.latency_s;
        let mut bench = Bench::new(setup, &config);
        let settle = bench.now().plus(Nanos::from_seconds(1.0));
        bench.listen(settle, &mut Vec::new());
        let (mut delays, mut bandwidths) = (Vec::new(), Vec::new());
        let mut refused = 0;
        for edge in 0..16 {
            let mut samples = Vec::new();
            bench.listen(bench.now().plus(Nanos::from_seconds(0.06 + 2e-3 * draw.uniform())), &mut samples);
            // A tap of 0.5 N, on and off.
            let event = {
                let (_world, now) = bench.plant.now();
                bench.hands.hang(if edge % 2 == 0 { 0.5 } else { 0.0 }, 0.0);
                now.seconds()
            };
            bench.listen(bench.now().plus(Nanos::from_seconds(0.15)), &mut samples);
            let (time, value): (Vec<f64>, Vec<f64>) = samples.iter().map(|(t, v)| (t - event, *v)).unzip();
            // An edge that the machine slept through has no samples about it.
            let gap = time.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max);
            match step_responses(&[(time, value)], 0.0).map(|found| found[0]) {
                Ok(found) if gap < 0.02 => {
                    delays.push(found.delay_s[0]);
                    bandwidths.push(found.bandwidth_hz[0]);
                }
                _ => refused += 1,
            }
        }
        let found = channel_delay(bus, &delays, 5e-4).unwrap();
        let (value, u) = (found.delay.value, found.delay.standard_uncertainty);
        let mean = bandwidths.iter().sum::<f64>() / bandwidths.len() as f64;
        println!(
            "{bus:>10} delay {:.2} +- {:.2} ms, withheld {:.2} ms; jitter {:.2} ms; bandwidth {mean:.1} Hz, withheld \
             {bandwidth:.1} Hz; {refused} of 16 edges left out",
            1e3 * value,
            1e3 * u,
            1e3 * truth,
            1e3 * found.jitter_s
        );
        assert!(value > truth - WITHIN * u && value < truth + BUS_S + WITHIN * u, "{bus}: {found:?}");
        let spread = (bandwidths.iter().map(|b| (b - mean).powi(2)).sum::<f64>()
            / (bandwidths.len() as f64 - 1.0))
            .sqrt();
        let u = spread / (bandwidths.len() as f64).sqrt();
        assert!((mean - bandwidth).abs() < WITHIN * u + 0.02 * bandwidth, "{bus}: {mean} +- {u} Hz");
    }
}

#[test]
fn a_withheld_amplitude_scale_is_found_over_modbus() {
    const VIBROMETER_SD: f64 = 0.01;
    let mut draw = Noise::new(20_261_124, "vibrometer");
    let factor = draw.between(0.8, 1.25);
    let defects =
        format!("[[defect]]\nname = \"amplitude_miscalibration\"\nparameters = {{ factor = {factor} }}\n");
    let mut config = WorldConfig { defects: Defects::parse(&defects).unwrap(), ..WorldConfig::ideal() };
    config.plate.warming_k = 0.0;
    let frequency_hz = 27_500.0;
    config.plate.resonance_hz = frequency_hz;
    let scale = 1.0 + VIBROMETER_SD * draw.normal();
    let Bench { hands, rig, setup, epoch, _emulators, .. } = Bench::new("virtual-ideal", &config);
    let mut ports = Ports::new(rig.force, rig.amplifier, rig.stage);
    let model: Box<dyn FrictionModel> = Box::new(SpringSlider::new(setup.tip.finger).unwrap());
    let mut state = CycleState::default();
    let mut number = 0;
    // Turns the loop for a while; whether it stayed armed.
    let mut drive = |seconds: f64, mut commands: Vec<Command>| {
        let began = Instant::now();
        let mut armed = false;
        commands.reverse();
        while began.elapsed().as_secs_f64() < seconds {
            number += 1;
            let now = Nanos(u64::try_from(epoch.elapsed().as_nanos()).unwrap());
            let tick = Tick { number, lateness: Nanos(0), now };
            let row = run_cycle(&setup.config, &*model, &mut state, &mut ports, &mut || commands.pop(), tick);
            armed = row.armed;
            if let Some(trip) = row.tripped {
                eprintln!("tripped: {trip:?}");
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        armed
    };
    drive(0.5, vec![]);
    let mut table = String::from("set_point_pp_m,amplitude_pp_m\n");
    let levels: Vec<f64> = (1..=6).map(|k| f64::from(k) * 0.5e-6).collect();
    for set in &levels {
        let request =
            Request { amplitude: PeakToPeak::from_metres(*set), frequency_hz, ..Request::default() };
        // A stall of the machine trips the rig, as it must: it is armed again, at most five times.
        let steady = (0..5).any(|_| {
            let armed = drive(0.2, vec![Command::Set(Request::default(), Marker::default()), Command::Reset]);
            armed && drive(0.4, vec![Command::Set(request, Marker::default())])
        });
        assert!(steady, "the rig would not stay armed");
        for _ in 0..4 {
            assert!(drive(0.02, vec![]), "it was armed and steady");
            let seen = hands.look();
            assert!((seen.frequency_hz - frequency_hz).abs() < 1.0, "{seen:?}");
            let shown = seen.amplitude_pp_m * scale * (1.0 + 0.005 * draw.normal());
            let _ = writeln!(table, "{set:e},{shown:e}");
        }
    }
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("table.csv"), table).unwrap();
    let said = tests::muprime()
        .current_dir(folder.path())
        .args([
            "calibrate",
            "amplitude",
            "--table",
            "table.csv",
            "--form",
            "bent",
            "--vibrometer-relative-sd",
        ])
        .args(["0.01", "--operator", "O", "--serial", "A-1", "--out", "a.toml", "--json"])
        .output()
        .unwrap();
    assert!(said.status.success(), "{}", tests::texts(&said).1);
    // The pick-up compresses large swings a little: the withheld curve is bent.
    let found = &tests::documents(&said)[0]["parameters"];
    judge("modbus-tcp", found, "gain", factor);
    judge("modbus-tcp", found, "bend", factor * 0.05 * (factor - 1.0) / 5e-6);
}
