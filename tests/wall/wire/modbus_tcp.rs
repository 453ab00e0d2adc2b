//! Modbus TCP: emulators, wrong instruments, late answers.

use drivers::{AxisSetup, InstrumentSetup, InstrumentsSetup};
use realtime::ports::{NoData, Quality};
use realtime::safety::{DriveCommand, StageCommand};
use sim::wire::{Command, Quantity};
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};
use wall::bench::{self, Bench, eventually, now, opened};

/// A setup whose instruments all stand at one address.
fn setup(address: SocketAddr) -> InstrumentsSetup {
    let address = address.to_string();
    InstrumentsSetup {
        force: vec![InstrumentSetup::new("muprime-force2", &address)],
        amplifier: InstrumentSetup::new("muprime-amplifier", &address),
        stage: InstrumentSetup::new("muprime-stage", &address),
        ..Default::default()
    }
}

#[test]
fn what_stands_in_the_registers_comes_out_of_the_ports() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    for (quantity, value) in [
        (Quantity::LateralForce, -0.12345),
        (Quantity::NormalForce, 0.25),
        // An output that is found on, or a plate that vibrates, is switched off by the link: then the registers would not stand.
        (Quantity::Amplitude, 99.5e-9),
        (Quantity::AmplitudeSetPoint, 2e-6),
        (Quantity::FrequencySetPoint, 27_500.3),
        (Quantity::Temperature, 31.4),
        (Quantity::OutputOn, 0.0),
        (Quantity::Position, 0.012_345_678),
        (Quantity::Velocity, -0.02),
    ] {
        bench.set(quantity, value);
    }
    let server = bench::serve_apart(&bench, epoch);
    let mut rig = opened(&setup(server.address()), epoch);
    let forces = eventually("a force", || Some(rig.force.read(now(epoch))).filter(|f| f.lateral.is_ok()));
    let (lateral, normal) = (forces.lateral.unwrap(), forces.normal.unwrap());
    assert!((lateral.value - -0.12345).abs() < 1e-12 && lateral.raw == -12345, "{lateral:?}");
    assert!((normal.value - 0.25).abs() < 1e-12 && normal.raw == 25000, "{normal:?}");
    assert_eq!(
        (lateral.sequence, lateral.taken_at),
        (normal.sequence, normal.taken_at),
        "one read, one sample"
    );
    assert_eq!(lateral.quality, Quality::Good);

    let amplifier = eventually("an amplifier state", || rig.amplifier.state(now(epoch)).ok());
    assert!((amplifier.amplitude.unwrap().value - 99.5e-9).abs() < 1e-15);
    assert!(
        (amplifier.echoed_amplitude.metres() - 2e-6).abs() < 1e-15,
        "{amplifier:?} after {:?}",
        bench.0.lock().unwrap().commands
    );
    assert!((amplifier.echoed_frequency_hz - 27_500.3).abs() < 1e-6);
    assert!((amplifier.temperature_c.unwrap().value - 31.4).abs() < 1e-9);
    assert!(!amplifier.output_on && !amplifier.watchdog_tripped && !amplifier.fault);

    let stage = eventually("a stage state", || rig.stage.state(now(epoch)).ok());
    assert!((stage.position_m - 0.012_345_678).abs() < 1e-12 && (stage.velocity_m_s + 0.02).abs() < 1e-12);
}

/// The bench samples at 1 kHz and stamps each sample: the age that the loop sees is the true one,
/// plus the quickest answer's delay, never less.
#[test]
fn ages_are_those_of_the_instrument() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    let server = bench::serve_apart(&bench, epoch);
    let mut rig = opened(&setup(server.address()), epoch);
    let mut last = None;
    for _ in 0..200 {
        let reading = eventually("a newer sample", || {
            rig.force
                .read(now(epoch))
                .normal
                .ok()
                .filter(|reading| last.is_none_or(|last| reading.sequence > last))
        });
        let true_time_s = f64::from(reading.sequence) * 1e-3;
        let late = reading.taken_at.seconds() - true_time_s;
        assert!((-1e-6..0.5).contains(&late), "sample {}: {late} s late", reading.sequence);
        last = Some(reading.sequence);
    }
}

#[test]
fn saturation_and_faults_reach_the_loop() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    let server = bench::serve_apart(&bench, epoch);
    let mut rig = opened(&setup(server.address()), epoch);
    bench.set(Quantity::LateralForce, 25.0);
    eventually("the lateral axis at its rail", || {
        rig.force.read(now(epoch)).lateral.ok().filter(|r| r.quality == Quality::Saturated)
    });
    assert_eq!(rig.force.read(now(epoch)).normal.unwrap().quality, Quality::Good, "the other axis is not");
    bench.set(Quantity::ForceFault, 1.0);
    eventually("no reading", || {
        rig.force.read(now(epoch)).normal.err().filter(|&why| why == NoData::Invalid)
    });
}

#[test]
fn another_instrument_is_refused_before_anything_is_commanded() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    let server =
        bench::serve(&bench, &[(1, "muprime-force2"), (2, "muprime-stage"), (3, "muprime-stage")], epoch);
    let error = drivers::open(&setup(server.address()), epoch).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("muprime-amplifier"), "{error}");
    let mut wrong = setup(server.address());
    wrong.amplifier.unit = Some(9);
    let error = drivers::open(&wrong, epoch).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("refused"), "{error}");
    assert!(bench.0.lock().unwrap().commands.is_empty());
}

#[test]
fn a_setup_that_does_not_fit_its_profiles_is_refused_with_a_reason() {
    let nowhere: SocketAddr = "127.0.0.1:9".parse().unwrap();
    let mut wrong = setup(nowhere);
    wrong.force[0].lateral = Some(AxisSetup { signal: "fx".into(), gain: 1.0, offset_n: 0.0 });
    let error = drivers::open(&wrong, Instant::now()).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("no signal `fx`") && error.contains("lateral"), "{error}");
    wrong.force[0].profile = "nonesuch".into();
    let error = drivers::open(&wrong, Instant::now()).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("nonesuch") && error.contains("muprime-force2"), "{error}");
    let error = drivers::open(&setup(nowhere), Instant::now()).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("refused") || error.contains("no answer"), "{error}");
}

/// Two weighing terminals, an axis each: kilograms by the device's decimals, and two ages.
#[test]
fn two_terminals_give_an_axis_each() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    bench.set(Quantity::NormalForce, 0.25);
    let server = bench::serve_apart(&bench, epoch);
    let lateral = bench::serve(&bench, &[(0, "hbk-wtx110")], epoch);
    let normal = bench::serve(&bench, &[(0, "hbk-wtx110")], epoch);
    let mut setup = setup(server.address());
    let axis = |gain: f64| Some(AxisSetup { signal: "fz".into(), gain, offset_n: 0.0 });
    setup.force = vec![
        InstrumentSetup {
            lateral: axis(-1.0),
            ..InstrumentSetup::new("hbk-wtx110", &lateral.address().to_string())
        },
        InstrumentSetup {
            normal: axis(1.0),
            ..InstrumentSetup::new("hbk-wtx110", &normal.address().to_string())
        },
    ];
    let mut rig = opened(&setup, epoch);
    let forces = eventually("both", || {
        // The first samples were taken before the epoch, and show its time.
        let forces = rig.force.read(now(epoch));
        let later = |channel: realtime::ports::Channel| channel.is_ok_and(|reading| reading.taken_at.0 > 0);
        Some(forces).filter(|forces| later(forces.lateral) && later(forces.normal))
    });
    let (lateral, normal) = (forces.lateral.unwrap(), forces.normal.unwrap());
    // Five decimals of a kilogram: 98 uN a count.
    assert!((normal.value - 0.25).abs() <= 0.5 * 9.80665e-5, "{normal:?}");
    assert!((lateral.value + 0.25).abs() <= 0.5 * 9.80665e-5, "{lateral:?}");
    assert_ne!(lateral.taken_at, normal.taken_at, "they do not sample together, and must not look so");
}

#[test]
fn only_commands_in_time_leave_and_an_end_makes_safe() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    let server = bench::serve_apart(&bench, epoch);
    let mut rig = opened(&setup(server.address()), epoch);
    // Expired when it is given: it must never leave.
    rig.amplifier.command(DriveCommand::off(41, realtime::ports::Nanos(0)), now(epoch));
    std::thread::sleep(Duration::from_millis(30));
    assert!(bench.0.lock().unwrap().commands.is_empty());
    let soon = || now(epoch).plus(realtime::ports::Nanos::from_seconds(5.0));
    rig.amplifier.command(DriveCommand::off(42, soon()), now(epoch));
    rig.stage.command(StageCommand::stop(43, soon()), now(epoch));
    eventually("the heartbeat of the command", || {
        bench.commanded(Command::DriveHeartbeat).filter(|&beat| beat == 42.0)
    });
    eventually("the stage's command", || {
        bench.commanded(Command::StageHeartbeat).filter(|&beat| beat == 43.0)
    });
    let expired: u64 = rig.links.health().map(|(_, health)| health.commands_expired).sum();
    assert_eq!(expired, 1);
    bench.0.lock().unwrap().commands.clear();
    drop(rig);
    assert_eq!(bench.commanded(Command::Enable), Some(0.0), "the end of the links makes safe");
    assert_eq!(bench.commanded(Command::Velocity), Some(0.0));
    assert_eq!(bench.commanded(Command::NormalForce), Some(0.0));
}

/// How the server below misbehaves.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Prank {
    /// Answers the 20th request of the first connection only after the client's deadline.
    Late,
    /// Answers every request twice: the second answer is stale when the next request is made.
    Twice,
    /// Answers with one register less than asked, the byte count telling the truth.
    Short,
    /// Never answers again, but keeps the connection.
    Silent,
    /// Swaps the words of 32-bit numbers.
    SwapWords,
    /// Another unit answers.
    OtherUnit,
}

/// The force that a stale or corrupt answer would show; no sound answer ever does.
const WRONG_FORCE: i32 = 1_234_567;

/// A force instrument with a prank. Every answer but the prank's says 0.5 N and 0.25 N.
fn prankster(prank: Prank, from: usize, once: bool) -> (SocketAddr, Arc<AtomicUsize>, Arc<AtomicBool>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let (connections, played) = (Arc::new(AtomicUsize::new(0)), Arc::new(AtomicBool::new(false)));
    let (count, done) = (Arc::clone(&connections), Arc::clone(&played));
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            count.fetch_add(1, Ordering::SeqCst);
            let (mut stream, done) = (stream.unwrap(), Arc::clone(&done));
            std::thread::spawn(move || {
                for request in 0.. {
                    let mut header = [0; 12];
                    if stream.read_exact(&mut header).is_err() {
                        return;
                    }
                    let play = request >= from && !(once && done.load(Ordering::SeqCst));
                    let sound = answer(&header, 50_000, request, false);
                    let sent = if play {
                        done.store(true, Ordering::SeqCst);
                        match prank {
                            Prank::Late => {
                                std::thread::sleep(Duration::from_millis(120));
                                stream.write_all(&answer(&header, WRONG_FORCE, request, false))
                            }
                            Prank::Twice => stream.write_all(&sound).and_then(|()| {
                                stream.write_all(&answer(&header, WRONG_FORCE, request, false))
                            }),
                            Prank::Short => {
                                let mut short = answer(&header, WRONG_FORCE, request, false);
                                short.truncate(short.len() - 2);
                                short[5] -= 2;
                                short[8] -= 2;
                                stream.write_all(&short)
                            }
                            Prank::Silent => Ok(()),
                            Prank::SwapWords => {
                                stream.write_all(&answer(&header, WRONG_FORCE, request, true))
                            }
                            Prank::OtherUnit => {
                                let mut other = answer(&header, WRONG_FORCE, request, false);
                                other[6] = 77;
                                stream.write_all(&other)
                            }
                        }
                    } else {
                        stream.write_all(&sound)
                    };
                    if sent.is_err() {
                        return;
                    }
                }
            });
        }
    });
    (address, connections, played)
}

/// The answer to a read of 12 registers of a muprime-force2.
fn answer(header: &[u8; 12], lateral: i32, request: usize, swap_words: bool) -> Vec<u8> {
    let count = u32::try_from(request).unwrap() + 1;
    let mut registers: Vec<u8> = Vec::new();
    for number in [0x6D75_3246_u32, count, count * 1000, lateral as u32, 25_000, 0] {
        let bytes = number.to_be_bytes();
        registers.extend(if swap_words { [bytes[2], bytes[3], bytes[0], bytes[1]] } else { bytes });
    }
    let mut frame = header[..2].to_vec();
    frame.extend([0, 0, 0, 27, header[6], 3, 24]);
    frame.extend(registers);
    frame
}

/// A full setup whose force instrument is the prankster.
fn with_prankster(address: SocketAddr, others: SocketAddr) -> InstrumentsSetup {
    let mut setup = setup(others);
    setup.force[0].address = address.to_string();
    setup
}

#[test]
fn no_prank_ever_becomes_a_force() {
    for prank in [Prank::Late, Prank::Twice, Prank::Short, Prank::Silent, Prank::OtherUnit] {
        let (bench, epoch) = (Bench::default(), Instant::now());
        let others = bench::serve_apart(&bench, epoch);
        let (address, connections, played) = prankster(prank, 20, prank != Prank::Twice);
        let mut rig = opened(&with_prankster(address, others.address()), epoch);
        let mut wrong = 0;
        let mut down = false;
        let mut look = |rig: &mut drivers::Rig| {
            let lateral = rig.force.read(now(epoch)).lateral;
            wrong += usize::from(lateral.is_ok_and(|reading| reading.raw == i64::from(WRONG_FORCE)));
            down |= lateral == Err(NoData::Disconnected);
            lateral
        };
        eventually("the prank", || {
            let _ = look(&mut rig);
            played.load(Ordering::SeqCst).then_some(())
        });
        // The prank's answer may sit in a socket; whatever comes is watched until good samples flow on
        // a new connection.
        eventually("a new connection", || {
            let _ = look(&mut rig);
            (prank == Prank::Twice || connections.load(Ordering::SeqCst) >= 2).then_some(())
        });
        let until = Instant::now() + Duration::from_millis(300);
        while Instant::now() < until {
            let _ = look(&mut rig);
            std::thread::sleep(Duration::from_micros(200));
        }
        if prank != Prank::Twice {
            let good = eventually("good samples again", || look(&mut rig).ok());
            assert_eq!(good.raw, 50_000);
            assert!(down, "{prank:?}: the loop was not told that the link went down");
        }
        assert_eq!(wrong, 0, "{prank:?}: a wrong answer became a force");
    }
}

#[test]
fn swapped_words_are_refused_at_connection() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    let others = bench::serve_apart(&bench, epoch);
    let (address, _, _) = prankster(Prank::SwapWords, 0, false);
    let error =
        drivers::open(&with_prankster(address, others.address()), epoch).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("words come in another order"), "{error}");
    assert!(bench.0.lock().unwrap().commands.is_empty());
}

#[test]
fn more_clients_than_allowed_are_turned_away_and_a_place_is_freed() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    let server = bench::serve_apart(&bench, epoch);
    let ask = |stream: &mut std::net::TcpStream| {
        let mut byte = [0; 9];
        stream.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
        stream.write_all(&[0, 1, 0, 0, 0, 6, 1, 3, 0, 0, 0, 12]).is_ok()
            && stream.read_exact(&mut byte).is_ok()
    };
    let connect = || std::net::TcpStream::connect(server.address()).unwrap();
    let mut clients: Vec<_> = (0..sim::wire::modbus_tcp::MOST_CLIENTS).map(|_| connect()).collect();
    assert!(clients.iter_mut().all(ask));
    assert!(!ask(&mut connect()), "one too many was served");
    clients.clear();
    eventually("a free place", || ask(&mut connect()).then_some(()));
}

#[test]
fn idle_clients_make_room_and_the_world_is_kept_up() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    let server = bench::serve_apart(&bench, epoch);
    let connect = || std::net::TcpStream::connect(server.address()).unwrap();
    let ask = |stream: &mut std::net::TcpStream| {
        let mut byte = [0; 9];
        stream.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
        stream.write_all(&[0, 1, 0, 0, 0, 6, 1, 3, 0, 0, 0, 12]).is_ok()
            && stream.read_exact(&mut byte).is_ok()
    };
    let mut at_work = connect();
    let _idle: Vec<_> = (1..sim::wire::modbus_tcp::MOST_CLIENTS).map(|_| connect()).collect();
    let begun = Instant::now();
    while begun.elapsed() < sim::wire::modbus_tcp::IDLE + Duration::from_millis(200) {
        assert!(ask(&mut at_work));
        std::thread::sleep(Duration::from_millis(50));
    }
    assert!(ask(&mut connect()), "an idle client makes room");
    assert!(ask(&mut at_work), "one at work keeps its place");
}

#[test]
fn a_relay_and_safety_contacts_behind_coils_and_discrete_inputs() {
    use realtime::ports::{SafetyInputs, SupplyCommand, SupplySwitch};
    let (bench, epoch) = (Bench::default(), Instant::now());
    let units = [(1, "muprime-force2"), (2, "muprime-amplifier"), (3, "muprime-stage"), (4, "muprime-relay")];
    let server = bench::serve(&bench, &units, epoch);
    let mut setup = setup(server.address());
    let relay = InstrumentSetup::new("muprime-relay", &server.address().to_string());
    (setup.supply_relay, setup.safety_inputs) = (Some(relay.clone()), Some(relay));
    bench.set(Quantity::EmergencyStop, 1.0);
    let mut rig = opened(&setup, epoch);
    let (supply, contacts): (&mut dyn SupplySwitch, &mut dyn SafetyInputs) =
        (&mut *rig.supply, &mut *rig.contacts);
    eventually("the relay is open", || supply.state(now(epoch)).ok().filter(|state| state.cut));
    let seen = eventually("the contacts", || {
        let seen = contacts.read(now(epoch));
        seen.emergency_stop.is_ok().then_some(seen)
    });
    let closed = [seen.emergency_stop, seen.interlock, seen.dead_man].map(|contact| contact.unwrap().closed);
    assert_eq!(closed, [true, false, false]);
    eventually("closed and read back", || {
        supply.command(SupplyCommand::Restore, now(epoch));
        supply.state(now(epoch)).ok().filter(|state| !state.cut)
    });
    eventually("cut and read back", || {
        supply.command(SupplyCommand::Cut, now(epoch));
        supply.state(now(epoch)).ok().filter(|state| state.cut)
    });
    eventually("closed again", || {
        supply.command(SupplyCommand::Restore, now(epoch));
        supply.state(now(epoch)).ok().filter(|state| !state.cut)
    });
    // A loop that says nothing more closes no supply.
    eventually("open by itself", || supply.state(now(epoch)).ok().filter(|state| state.cut));
    let ends = rig.links.close();
    assert!(ends.iter().all(|end| !matches!(end.closed, drivers::Closed::NotReadBack(_))), "{ends:?}");
    assert_eq!(bench.commanded(Command::CloseSupply), Some(0.0));
}
