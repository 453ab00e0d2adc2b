//! Speeds of the loop and of the virtual rig: `cargo bench -p muprime-rig --bench rig`.
#![allow(clippy::disallowed_methods, reason = "it measures time")]

use divan::Bencher;
use divan::counter::ItemsCount;
use drivers::modbus::Registers;
use models::prediction::{EmpiricalPsi, FrictionModel, SpringSlider};
use models::{Condition, Finger};
use realtime::cycle::{self, Command, CycleState, Inputs, Marker, Phase};
use realtime::estimate::Mu0;
use realtime::ports::{AmplifierState, Contacts, Forces, Nanos, NoData, Quality, Sample, StageState};
use realtime::safety::{Observation, Request};
use runs::{Plan, Setup};
use sim::wire::SharedPlant;
use sim::wire::modbus_tcp::ModbusTcpServer;
use sim::wire::world::WorldPlant;
use sim::world::{World, WorldConfig};
use std::sync::Arc;
use std::time::Instant;
use tokio_modbus::client::Reader;

#[path = "../../tests/memory.rs"]
#[allow(dead_code, reason = "what a sweep comes to is the tests' concern")]
mod memory;

fn main() {
    divan::main();
}

#[divan::bench]
fn prediction_spring_slider(bencher: Bencher<'_, '_>) {
    let law = SpringSlider::new(Finger { stiffness_relative_sd: 0.05, ..Finger::paper() }).unwrap();
    bencher.bench_local(|| law.predict(divan::black_box(&Condition::paper())).unwrap());
}

#[divan::bench]
fn prediction_spring_slider_finite_recovery(bencher: Bencher<'_, '_>) {
    let law = SpringSlider::new(Finger { lateral_recovery_m_per_s: Some(5e-3), ..Finger::paper() }).unwrap();
    bencher.bench_local(|| law.predict(divan::black_box(&Condition::paper())).unwrap());
}

#[divan::bench]
fn prediction_psi(bencher: Bencher<'_, '_>) {
    let law = EmpiricalPsi::paper(Finger::paper()).unwrap();
    bencher.bench_local(|| law.predict(divan::black_box(&Condition::paper())).unwrap());
}

/// One cycle of the loop, armed and sliding, prediction included; without ports and rings.
#[divan::bench]
fn step(bencher: Bencher<'_, '_>) {
    let setup = Setup::load("virtual").unwrap();
    let model = SpringSlider::new(setup.tip.finger).unwrap();
    let mut state = CycleState::default();
    let mut n = 0u32;
    bencher.bench_local(|| {
        n += 1;
        let now = Nanos(u64::from(n) * 1_000_000);
        let reading = |value: f64| {
            let raw = i64::from(n % 7);
            Ok(Sample { value, raw, taken_at: now, sequence: n, quality: Quality::Good })
        };
        let request = Request {
            amplitude: Condition::paper().amplitude,
            frequency_hz: 27_500.0,
            velocity_m_s: 0.02,
            normal_force_n: 0.25,
        };
        let mut commands = [None; 4];
        match n {
            2 => commands[0] = Some(Command::Reset),
            3 => {
                commands[0] = Some(Command::Set(request, Marker { point: 1, phase: Phase::Measure }));
                commands[1] = Some(Command::Mu0(Mu0 { value: 0.5, sd: 0.005 }));
            }
            _ => {}
        }
        let amplifier = AmplifierState {
            amplitude: reading(if n > 3 { 2e-6 } else { 0.0 }),
            echoed_amplitude: request.amplitude,
            echoed_frequency_hz: 27_500.0,
            output_on: n > 3,
            watchdog_tripped: false,
            fault: false,
            temperature_c: reading(25.0),
            taken_at: now,
            sequence: n,
        };
        let stage = StageState {
            position_m: 0.0,
            velocity_m_s: 0.02,
            at_limit: false,
            fault: false,
            taken_at: now,
            sequence: n,
        };
        let seen = Observation {
            forces: Forces { lateral: reading(0.03), normal: reading(0.25) },
            amplifier: Ok(amplifier),
            stage: Ok(stage),
            lateness: Nanos(0),
            supply: Err(NoData::NotFitted),
            contacts: Contacts::default(),
        };
        let out = cycle::step(&setup.config, &model, &mut state, &Inputs { commands, seen }, now);
        assert!(n < 100 || out.online.is_some());
        out
    });
}

/// A whole sweep in virtual time; items are virtual milliseconds, so 1 Kitem/s is real time.
#[divan::bench(sample_count = 5, sample_size = 1)]
fn sweep_in_virtual_time(bencher: Bencher<'_, '_>) {
    let setup = Setup::load("virtual").unwrap();
    let plan = Plan::load("first-sweep").unwrap();
    let model: Arc<dyn FrictionModel> = Arc::new(SpringSlider::new(setup.tip.finger).unwrap());
    let run = |seed| {
        memory::sweep_in_memory(&setup, &plan, seed, &WorldConfig::bundled(), Arc::clone(&model), &mut |_| {})
            .unwrap()
    };
    let cycles = run(1).cycles;
    bencher.counter(ItemsCount::new(cycles)).bench_local(|| run(1));
}

/// A virtual rig behind Modbus TCP on loopback.
fn server() -> ModbusTcpServer {
    let setup = Setup::load("virtual").unwrap();
    let world = World::new(&WorldConfig::ideal(), 1).unwrap();
    let plant = SharedPlant::new(WorldPlant::new(world), Instant::now());
    let devices = muprime_rig::emulators::emulators(&setup.instruments()).unwrap();
    ModbusTcpServer::start("127.0.0.1:0".parse().unwrap(), devices, plant).unwrap()
}

/// A read of the force instrument's registers with nothing but tokio-modbus: what the wire itself costs.
#[divan::bench]
fn modbus_round_trip_bare_client(bencher: Bencher<'_, '_>) {
    let server = server();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let profile = drivers::profile("muprime-force2").unwrap();
    let poll = profile.frames()[0].spans[0];
    let slave = tokio_modbus::Slave(profile.description.link.unit.unwrap_or(1));
    let mut client = runtime
        .block_on(async {
            let stream = tokio::net::TcpStream::connect(server.address()).await?;
            stream.set_nodelay(true)?;
            Ok::<_, std::io::Error>(tokio_modbus::client::tcp::attach_slave(stream, slave))
        })
        .unwrap();
    bencher.bench_local(|| {
        runtime.block_on(client.read_holding_registers(poll.address, poll.count)).unwrap().unwrap()
    });
}

/// The same read as the driver makes it: with its deadline, and as bytes for the decoder.
#[divan::bench]
fn modbus_round_trip_driver(bencher: Bencher<'_, '_>) {
    let server = server();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let profile = drivers::profile("muprime-force2").unwrap();
    let (table, poll) = (profile.description.poll[0].table, profile.frames()[0].spans[0]);
    let link = &profile.description.link;
    let unit = link.unit.unwrap_or(1);
    let clock = realtime::clock::Clock::from(std::time::Instant::now());
    let mut wire = drivers::modbus_tcp::Tcp::connect(
        (&runtime, &clock),
        server.address(),
        unit,
        1000,
        link.response_timeout_ms,
    )
    .unwrap();
    bencher.bench_local(|| wire.read(table, poll.address, poll.count).unwrap());
}
