//! CAN through the kernel's own stack, in guest kernels, as build machines seldom have one.
//!
//! `in_every_guest_that_starts` starts `tests/can_guest/can-guest` with this very binary, which then runs the tests that
//! are marked as ignored, on vcan: in User-mode Linux and in QEMU, where each starts. If neither does, the test fails;
//! it does not skip. User-mode Linux keeps coarse time: order and content are tested here, never speed.

use drivers::socketcan::KernelCan;
use drivers::{AxisSetup, InstrumentSetup, InstrumentsSetup};
use instruments::{CanEvent, CanFrame, CanPort};
use realtime::ports::NoData;
use sim::wire::can::{CanDevice, CanEmulator};
use sim::wire::device::Device;
use sim::wire::{Quantity, SharedPlant};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use wall::bench::{self, Bench, BenchPlant, eventually, now, opened};

/// What `can-guest` ends with where the guest itself failed, and not the command in it.
const NO_GUEST: i32 = 125;

#[test]
fn in_every_guest_that_starts() {
    let starter = tests::file("tests/can_guest/can-guest");
    let mut absent = Vec::new();
    for guest in ["uml", "qemu"] {
        let output = Command::new(&starter)
            .arg(std::env::current_exe().unwrap())
            .args(["--ignored", "--test-threads=1"])
            .env("CAN_GUEST", guest)
            .env("CAN_GUEST_TIMEOUT", "240")
            .output()
            .unwrap_or_else(|error| panic!("{}: {error}", starter.display()));
        let (out, err) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        // An empty output: it did not fail on the way.
        if output.status.code() == Some(NO_GUEST) && out.is_empty() {
            println!("{guest} does not start here: {err}");
            absent.push(format!("{guest}: {err}"));
            continue;
        }
        assert!(output.status.success(), "{guest}: {}\n{out}\n{err}", output.status);
        assert!(out.contains("test result: ok. 8 passed"), "{guest}: other tests ran than expected:\n{out}");
    }
    assert!(absent.len() < 2, "no guest starts: tests/venv installs what they need\n{}", absent.join("\n"));
}

fn deadline() -> Instant {
    Instant::now() + Duration::from_secs(10)
}

fn device(id: &str) -> Device {
    Device::new(drivers::profile(id).unwrap()).unwrap()
}

fn setup(bench: &Bench, epoch: Instant) -> (InstrumentsSetup, sim::wire::modbus_tcp::ModbusTcpServer) {
    let server = bench::serve_all(bench, epoch);
    let address = server.address().to_string();
    let axis = |signal: &str| Some(AxisSetup { signal: signal.into(), gain: 1.0, offset_n: 0.0 });
    let force = InstrumentSetup {
        lateral: axis("fx"),
        normal: axis("fz"),
        rate_hz: Some(50.0),
        ..InstrumentSetup::new("ati-netft-can", "vcan0")
    };
    let slow = |id: &str| InstrumentSetup { rate_hz: Some(20.0), ..InstrumentSetup::new(id, &address) };
    let setup = InstrumentsSetup {
        force: vec![force],
        amplifier: slow("muprime-amplifier"),
        stage: slow("muprime-stage"),
        ..Default::default()
    };
    (setup, server)
}

#[test]
#[ignore = "needs the guest kernel"]
fn forces_over_socketcan() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    bench.set(Quantity::LateralForce, -1.5);
    bench.set(Quantity::NormalForce, 2.25);
    let (mut setup, _server) = setup(&bench, epoch);
    let plant = SharedPlant::new(BenchPlant::new(&bench), epoch);
    let devices = vec![CanDevice { device: device("ati-netft-can"), base: 432 }];
    let emulator = CanEmulator::start(KernelCan::open("vcan0").unwrap(), devices, plant).unwrap();
    // In the guest the answer may take its time.
    setup.amplifier.rate_hz = Some(10.0);
    let mut rig = opened(&setup, epoch);
    let forces = eventually("forces", || Some(rig.force.read(now(epoch))).filter(|f| f.normal.is_ok()));
    assert!((forces.lateral.unwrap().value + 1.5).abs() <= 2.5e-4, "{forces:?}");
    assert!((forces.normal.unwrap().value - 2.25).abs() <= 2.5e-4, "{forces:?}");
    let first = forces.lateral.unwrap().sequence;
    eventually("newer", || {
        rig.force.read(now(epoch)).lateral.ok().filter(|r| r.sequence.wrapping_sub(first) > 20)
    });
    drop(emulator);
    eventually("told", || {
        rig.force.read(now(epoch)).lateral.err().filter(|&why| why == NoData::Disconnected)
    });
}

/// can-utils, which nobody here wrote, on both ends.
#[test]
#[ignore = "needs the guest kernel"]
fn can_utils_hear_and_are_heard() {
    let candump =
        Command::new("candump").args(["-L", "-n", "2", "vcan1"]).stdout(Stdio::piped()).spawn().unwrap();
    // Not a pause, nor a wait that sleeps: a guest whose clock counts instructions leaps over it, while
    // candump is still being read from the disk.
    let began = Instant::now();
    let listens = |all: String| all.lines().any(|line| line.trim_start().starts_with("vcan1"));
    while !listens(std::fs::read_to_string("/proc/net/can/rcvlist_all").unwrap()) {
        assert!(began.elapsed() < Duration::from_secs(60), "candump never listens");
        std::thread::yield_now();
    }
    let mut bus = KernelCan::open("vcan1").unwrap();
    assert!(bus.send(&CanFrame::new(0x1B4, &[0x02]).unwrap()).unwrap());
    assert!(bus.send(&CanFrame::build(0x0123_4567, true, &[1, 2, 3, 4, 5, 6, 7, 8]).unwrap()).unwrap());
    let heard = String::from_utf8(candump.wait_with_output().unwrap().stdout).unwrap();
    let frames: Vec<&str> = heard.lines().filter_map(|line| line.rsplit(' ').next()).collect();
    assert_eq!(frames, ["1B4#02", "01234567#0102030405060708"]);
    assert!(Command::new("cansend").args(["vcan1", "1B6#5602000000000100"]).status().unwrap().success());
    let event = bus.receive(deadline()).unwrap();
    let Some(CanEvent::Frame(frame, ago)) = event else { panic!("{event:?}") };
    assert_eq!((frame.id, frame.data()), (0x1B6, [0x56, 0x02, 0, 0, 0, 0, 1, 0].as_slice()));
    assert!(ago < Duration::from_secs(5));
}

/// A guest's vcan never leaves the bus: the error frame that a controller would raise is put on it by
/// hand, and what the driver makes of it is tested.
#[test]
#[ignore = "needs the guest kernel"]
fn bus_off_ends_the_link_and_nothing_restarts_by_itself() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    let (setup, _server) = setup(&bench, epoch);
    let plant = SharedPlant::new(BenchPlant::new(&bench), epoch);
    let devices = vec![CanDevice { device: device("ati-netft-can"), base: 432 }];
    let _emulator = CanEmulator::start(KernelCan::open("vcan0").unwrap(), devices, plant).unwrap();
    let mut rig = opened(&setup, epoch);
    eventually("forces", || rig.force.read(now(epoch)).normal.ok());
    let said = goes_off("vcan0", || rig.links.health().next().unwrap().1.last_problem);
    assert!(said.contains("by hand"), "{said}");
}

/// The controller's word that it left the bus (CAN_ERR_FLAG | CAN_ERR_BUSOFF), and what the link then says of it. A slow guest
/// makes connections anew for its own reasons, and one made just then hears nothing: said again until it is heard.
fn goes_off(interface: &str, mut last_problem: impl FnMut() -> String) -> String {
    let mut heard = std::collections::BTreeSet::new();
    for _ in 0..10 {
        assert!(
            Command::new("cansend")
                .args([interface, "20000040#0000000000000000"])
                .status()
                .unwrap()
                .success()
        );
        let began = Instant::now();
        while began.elapsed() < Duration::from_secs(3) {
            let problem = last_problem();
            if problem.contains("bus-off") {
                return problem;
            }
            heard.insert(problem);
            std::thread::sleep(Duration::from_millis(1));
        }
    }
    panic!("never the link's end: {heard:?}");
}

/// An error frame of the controller's, as the kernel would raise it: CAN_ERR_FLAG | CAN_ERR_CRTL with these bits.
fn controller_says(bits: u8) {
    let frame = format!("20000004#00{bits:02x}000000000000");
    assert!(Command::new("cansend").args(["vcan0", &frame]).status().unwrap().success());
}

#[test]
#[ignore = "needs the guest kernel"]
fn a_warning_is_noted_and_a_passive_controller_ends_the_link() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    let (setup, _server) = setup(&bench, epoch);
    let plant = SharedPlant::new(BenchPlant::new(&bench), epoch);
    let devices = vec![CanDevice { device: device("ati-netft-can"), base: 432 }];
    let _emulator = CanEmulator::start(KernelCan::open("vcan0").unwrap(), devices, plant).unwrap();
    let mut rig = opened(&setup, epoch);
    eventually("forces", || rig.force.read(now(epoch)).normal.ok());
    let health = |rig: &drivers::Rig| rig.links.health().next().unwrap().1;
    // A slow guest makes connections anew for its own reasons: said again until it is heard.
    let said = |rig: &drivers::Rig, bits: u8, word: &str| {
        let began = Instant::now();
        let mut heard = std::collections::BTreeSet::new();
        while !heard.iter().any(|problem: &String| problem.contains(word)) {
            controller_says(bits);
            heard.insert(health(rig).last_problem);
            assert!(began.elapsed() < Duration::from_secs(30), "{word}: {heard:?}");
        }
    };
    said(&rig, 0x04, "warns");
    said(&rig, 0x10, "passive");
    // What is read then comes over a new connection.
    eventually("forces again", || {
        (health(&rig).connections > 1).then(|| rig.force.read(now(epoch)).normal.ok()).flatten()
    });
}

/// Others' frames, as many as the bus takes, of unknown identifiers and of the sensor's own with a wrong length.
#[test]
#[ignore = "needs the guest kernel"]
fn a_bus_full_of_others_frames_holds_nothing_up() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    bench.set(Quantity::NormalForce, 2.25);
    let (setup, _server) = setup(&bench, epoch);
    let plant = SharedPlant::new(BenchPlant::new(&bench), epoch);
    let devices = vec![CanDevice { device: device("ati-netft-can"), base: 432 }];
    let _emulator = CanEmulator::start(KernelCan::open("vcan0").unwrap(), devices, plant).unwrap();
    let mut rig = opened(&setup, epoch);
    eventually("forces", || rig.force.read(now(epoch)).normal.ok());
    let mut noise = KernelCan::open("vcan0").unwrap();
    let first = rig.links.health().next().unwrap().1.samples;
    let (began, mut sent) = (Instant::now(), 0u32);
    // A vcan takes any number of frames, and a slow guest has one processor for the three that read them all: some 800 a second
    // at first, far more than the sensor's, and half of it whenever the emulated sensor itself no longer gets its turn.
    let (mut pause, mut patience) = (Duration::from_millis(10), Duration::from_secs(10));
    while rig.links.health().next().unwrap().1.samples < first + 20 {
        for _ in 0..8 {
            let frame = if sent.is_multiple_of(2) {
                CanFrame::new(0x7A, &[0; 8])
            } else {
                CanFrame::new(438, &[1, 2, 3])
            };
            sent += u32::from(noise.send(&frame.unwrap()).unwrap());
        }
        std::thread::sleep(pause);
        if began.elapsed() > patience {
            (pause, patience) = (pause * 2, patience + Duration::from_secs(10));
            println!(
                "{sent} frames; a pause of {pause:?} from now on: {:?}",
                rig.links.health().next().unwrap().1
            );
        }
        assert!(pause < Duration::from_millis(300), "{sent} frames, and no samples");
    }
    let forces = rig.force.read(now(epoch));
    assert!(forces.normal.is_ok_and(|r| (r.value - 2.25).abs() <= 2.5e-4), "{forces:?}");
    assert!(sent > 200, "{sent}");
}

/// A drive was enabled when its bus went off, by a command that is still valid: after the bus is back not one
/// frame of set-points may leave until the loop gives a new command.
#[test]
#[ignore = "needs the guest kernel"]
fn no_command_from_before_a_bus_off_leaves_after_it() {
    const ENABLED: [u8; 2] = [0x0F, 0];
    let (bench, epoch) = (Bench::default(), Instant::now());
    let (mut setup, server) = setup(&bench, epoch);
    let address = server.address().to_string();
    let slow = InstrumentSetup { rate_hz: Some(20.0), ..InstrumentSetup::new("muprime-force2", &address) };
    setup.force = vec![slow];
    setup.stage = InstrumentSetup {
        dead_weight_n: Some(0.25),
        ..InstrumentSetup::new("cia402-profile-velocity", "vcan1")
    };
    let plant = SharedPlant::new(BenchPlant::new(&bench), epoch);
    let devices = vec![CanDevice { device: device("cia402-profile-velocity"), base: 5 }];
    let _emulator = CanEmulator::start(KernelCan::open("vcan1").unwrap(), devices, plant).unwrap();
    let mut listener = KernelCan::open("vcan1").unwrap();
    // Process data to node 5 (CiA 301: 0x200 + node), each frame's control word.
    let mut heard = |until: Duration| {
        let (end, mut words) = (Instant::now() + until, Vec::new());
        loop {
            match listener.receive(end).unwrap() {
                Some(CanEvent::Frame(frame, _)) if frame.id == 0x205 => {
                    words.push([frame.data()[0], frame.data()[1]]);
                }
                // What was sent before the bus went off is no matter here.
                Some(CanEvent::BusOff) => words.clear(),
                None if Instant::now() >= end => return words,
                _ => {}
            }
        }
    };
    let mut rig = opened(&setup, epoch);
    let health = |rig: &drivers::Rig| rig.links.health().last().unwrap().1;
    let mut beat = 0;
    let mut command = |rig: &mut drivers::Rig, for_s: f64| {
        beat += 1;
        let until = now(epoch).plus(realtime::ports::Nanos::from_seconds(for_s));
        rig.stage.command(realtime::safety::StageCommand::stop(beat, until), now(epoch));
    };
    eventually("an enabled drive", || {
        command(&mut rig, 1.0);
        heard(Duration::from_millis(40)).contains(&ENABLED).then_some(())
    });
    // It is valid for long after the bus is back: that it is old is enough.
    command(&mut rig, 60.0);
    std::thread::sleep(Duration::from_millis(100));
    goes_off("vcan1", || health(&rig).last_problem);
    eventually("the drive's data again", || {
        (health(&rig).connections > 1).then(|| rig.stage.state(now(epoch)).ok()).flatten()
    });
    assert_eq!(heard(Duration::from_secs(1)), Vec::<[u8; 2]>::new(), "set-points from before the outage");
    // The drive's own guard has put it into a fault meanwhile, which only a person resets; but new commands leave.
    eventually("a new command leaves", || {
        command(&mut rig, 1.0);
        (!heard(Duration::from_millis(40)).is_empty()).then_some(())
    });
}

#[test]
#[ignore = "needs the guest kernel"]
fn a_burst_is_whole_and_in_order() {
    let (mut here, mut there) = (KernelCan::open("vcan1").unwrap(), KernelCan::open("vcan1").unwrap());
    for start in (0..1000_u32).step_by(100) {
        for i in start..start + 100 {
            while !here.send(&CanFrame::new(0x300, &i.to_be_bytes()).unwrap()).unwrap() {
                std::thread::yield_now();
            }
        }
        for i in start..start + 100 {
            let event = there.receive(deadline()).unwrap();
            let Some(CanEvent::Frame(frame, _)) = event else { panic!("{i}: {event:?}") };
            assert_eq!(frame.data(), i.to_be_bytes());
        }
    }
}

#[test]
#[ignore = "needs the guest kernel"]
fn an_interface_that_is_not_there_is_told() {
    let error = KernelCan::open("can77").err().unwrap().to_string();
    assert!(error.contains("can77"), "{error}");
}
