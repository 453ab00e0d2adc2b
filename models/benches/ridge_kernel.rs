//! The element kernel on one core: beside its twin in C, in turn, and beside the bound of its own
//! instructions.
//!
//! `cargo bench -p muprime-models --bench ridge_kernel`: about 1500 elements, contact included, CPU seconds
//! of the thread; wants `cc` for the twin and `objdump` for the bound. `-- lanes`: eight cases side by side
//! in the lanes of a vector against one case along its rows, at 200, 400 and 800 elements, and single
//! precision, all in the twin. A ratio within a turn is what says something: the machine may be shared.
#![allow(clippy::disallowed_methods, reason = "it measures time and reads its arguments")]

#[path = "peers/mix.rs"]
mod mix;
#[path = "peers/turns.rs"]
mod turns;
#[path = "peers/twin.rs"]
mod twin;

use mix::Core;
use muprime_models::ridge::{
    Body, FrictionRule, Instructions, Material, Mesh, Plate, RidgeGeometry, Strain, stability,
};
use turns::{Spread, cycles_per_second, spread, timed};
use twin::{Frame, Lane, Twin, Variant};

const TURNS: usize = 11;
/// Steps in a turn: some 10 ms.
const STEPS: usize = 2000;
const DAMPING: f64 = 3e5;

fn main() {
    if std::env::args().any(|a| a == "lanes") {
        lanes();
        return;
    }
    for (instructions, name) in [(Instructions::Avx512, "AVX-512"), (Instructions::Avx2, "AVX2")] {
        if !instructions.here() {
            println!("{name}: not on this machine");
            continue;
        }
        for strain in [Strain::Small, Strain::Objective] {
            in_turn(instructions, name, strain);
        }
    }
    let mut viscous = Ridge::new(Strain::Objective, true, 1500);
    let rate = spread((0..TURNS).map(|_| viscous.updates() / viscous.turn() / 1e6));
    println!("objective with viscous arms: {}", rate_text(rate));
}

struct Ridge {
    body: Body,
    plate: Plate,
    dt: f64,
    mesh: Mesh,
}

impl Ridge {
    fn new(strain: Strain, viscous: bool, elements: usize) -> Ridge {
        let mut corneum = Material::elastic(28.3e6, 0.33, 750.0);
        if viscous {
            corneum.retardation_time_s = 1e-6;
        }
        let soft = |young| Material::elastic(young, 0.33, 750.0);
        let built = RidgeGeometry::TABLE_1.mesh([corneum, soft(1.5e6), soft(0.02e6)], elements);
        let mesh = built.expect("Table 1").mesh;
        let mut body = Body::new(mesh.clone(), strain);
        body.hold_top();
        let plate = Plate::new(vec![93e6; mesh.nx], FrictionRule::Global, 0.5).expect("valid");
        let dt = stability::stable_step_s(stability::highest_frequency_rad_s(&body, &plate.penalty));
        Ridge { body, plate, dt, mesh }
    }

    fn updates(&self) -> f64 {
        (self.mesh.elements() * STEPS) as f64
    }

    /// CPU seconds of a turn.
    fn turn(&mut self) -> f64 {
        let (plate, dt) = (&mut self.plate, self.dt);
        timed(|| {
            self.body.advance(dt, DAMPING, STEPS, &mut |mut s| {
                plate.touch(&mut s, 0.0, 0.02);
            });
        })
    }

    /// The same ridge in the twin; lanes differ in modulus.
    fn twin(&self, variant: Variant) -> Twin {
        let frame = Frame {
            mesh: &self.mesh,
            dt: self.dt,
            damping: DAMPING,
            base: (1, vec![0.0; self.mesh.nx]),
            spot: vec![0.0; self.mesh.nx],
        };
        let lane = |k: usize| {
            let softer = |m: &Material| Material {
                young_modulus_pa: m.young_modulus_pa * (1.0 - 0.01 * k as f64),
                ..*m
            };
            Lane {
                sine_m: 0.0,
                frequency_hz: 27.5e3,
                speed_m_s: 0.02,
                mu0: 0.5,
                penalty: self.plate.penalty.clone(),
                material: self.mesh.row_material.iter().map(softer).collect(),
            }
        };
        let all: Vec<Lane> = (0..variant.lanes).map(lane).collect();
        Twin::start(variant, &frame, &all)
    }
}

fn rate_text(s: Spread) -> String {
    format!("{:.0} million updates/s ({:.0} to {:.0})", s.median, s.least, s.most)
}

/// Kernel and twin in turn, and the kernel's share of its instructions' bound.
fn in_turn(instructions: Instructions, name: &str, strain: Strain) {
    let avx512 = instructions == Instructions::Avx512;
    let mut ridge = Ridge::new(strain, false, 1500);
    ridge.body.instructions = instructions;
    let mut twin = ridge.twin(Variant::plain(strain, avx512));
    ridge.turn();
    twin.run(STEPS, 0);
    let turns: Vec<[f64; 3]> =
        (0..TURNS).map(|_| [ridge.turn(), twin.run(STEPS, 0).0, cycles_per_second()]).collect();
    let updates = ridge.updates();
    let ratio = spread(turns.iter().map(|t| t[1] / t[0]));
    println!(
        "{name}, {strain:?}: kernel {}, twin in C {}, kernel over twin {:.2} ({:.2} to {:.2}) in {TURNS} turns",
        rate_text(spread(turns.iter().map(|t| updates / t[0] / 1e6))),
        rate_text(spread(turns.iter().map(|t| updates / t[1] / 1e6))),
        ratio.median,
        ratio.least,
        ratio.most
    );
    let Some(loops) = mix::loops(avx512) else {
        println!("  no bound: objdump is missing, or the loops are not known again");
        return;
    };
    let element = if strain == Strain::Small { loops.small } else { loops.objective };
    println!("  a vector of elements: {element:?}\n  a vector of nodes: {:?}", loops.nodes);
    let width = if avx512 { 8.0 } else { 4.0 };
    let rows = ridge.mesh.ny as f64;
    for core in [Core::zen4(avx512), Core::xeon(avx512)] {
        let ((elements, unit), (nodes, node_unit)) = (core.cycles(&element), core.cycles(&loops.nodes));
        let least = (elements + nodes * (rows + 1.0) / rows) / width;
        let share = spread(turns.iter().map(|t| updates / t[0] * least / t[2]));
        println!(
            "  bound on {}: {elements:.1} ({unit}) and {nodes:.1} ({node_unit}) cycles a vector, {least:.2} an update; \
             here {:.2} to {:.2} GHz: share {:.2} ({:.2} to {:.2})",
            core.name,
            spread(turns.iter().map(|t| t[2] / 1e9)).least,
            spread(turns.iter().map(|t| t[2] / 1e9)).most,
            share.median,
            share.least,
            share.most
        );
    }
}

/// Eight cases in the lanes of a vector, and single precision, against one case along its rows: all in the
/// twin, in turn.
fn lanes() {
    let avx512 = Instructions::Avx512.here();
    for elements in [200, 400, 800] {
        let mut ridge = Ridge::new(Strain::Objective, false, elements);
        let plain = Variant::plain(Strain::Objective, avx512);
        let variants = [
            ("8 cases in lanes", Variant { lanes: 8, ..plain }),
            ("single precision", Variant { single: true, ..plain }),
            ("single precision, 16 cases in lanes", Variant { single: true, lanes: 16, ..plain }),
        ];
        let mut rows = ridge.twin(plain);
        let mut others: Vec<Twin> = variants.iter().map(|(_, v)| ridge.twin(*v)).collect();
        let turns: Vec<(f64, f64, Vec<f64>)> = (0..TURNS)
            .map(|_| {
                let times = others.iter_mut().zip(&variants);
                let own = ridge.turn();
                let plain = rows.run(STEPS, 0).0;
                // As many steps of a case in all: lanes divide STEPS.
                let each = times.map(|(t, (_, v))| t.run(STEPS / v.lanes, 0).0);
                (own, plain, each.collect())
            })
            .collect();
        let updates = ridge.updates();
        println!(
            "{} elements, objective: twin along rows {}, kernel over it {:.2}",
            ridge.mesh.elements(),
            rate_text(spread(turns.iter().map(|t| updates / t.1 / 1e6))),
            spread(turns.iter().map(|t| t.1 / t.0)).median
        );
        for (k, (name, _)) in variants.iter().enumerate() {
            let ratio = spread(turns.iter().map(|t| t.1 / t.2[k]));
            println!(
                "  {name}: {:.2} times as many updates ({:.2} to {:.2})",
                ratio.median, ratio.least, ratio.most
            );
        }
    }
}
