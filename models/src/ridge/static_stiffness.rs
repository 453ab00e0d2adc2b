//! The static stiffnesses of a ridge on a plate, across it (`k_n`) and along it (`k_l`): their ratio is what
//! Eq. 16 has in Psi.
//!
//! The stiffness matrix is the kernel's own at its first geometry: layers, hourglass control and all
//! ([`banded`]). The skin is held at a depth ([`HeldAt`]), pressed without friction on the plate up to a
//! load, through the penalty springs where it touches. Then the plate is moved a little either way with the
//! touching nodes stuck to it.
//!
//! All is per metre of depth and linear: small strain, relaxed moduli.

pub mod banded;

use super::{Mesh, RidgeCase, RidgeError};
use banded::{Banded, surface_compliance};
use serde::Serialize;

/// Where the skin is held.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum HeldAt {
    /// At the base of the stratum corneum: the contact and the ridge alone.
    CorneumBase,
    /// At the base of the dermis.
    DermisBase,
    /// At the top, as the model is: with the soft tissue.
    Top,
}

impl HeldAt {
    /// All.
    pub const ALL: [HeldAt; 3] = [HeldAt::CorneumBase, HeldAt::DermisBase, HeldAt::Top];
}

/// The springs between plate and skin at each node of the surface, N/m per metre of depth; infinite for none.
#[derive(Clone, Debug, PartialEq)]
pub struct Springs {
    /// Across the plate.
    pub across: Vec<f64>,
    /// Along it.
    pub along: Vec<f64>,
}

/// Stiffnesses of one contact, per metre of depth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct StaticStiffness {
    /// Load, N/m.
    pub line_load_n_m: f64,
    /// Width of a Hertz contact whose pressure has the same second moment, m; that of the nodes themselves is
    /// up to a node wider.
    pub contact_width_m: f64,
    /// Greatest mean pressure over a node's width, Pa.
    pub peak_pressure_pa: f64,
    /// Nodes that touch.
    pub nodes: usize,
    /// Approach of plate and held place since first touch, m.
    pub approach_m: f64,
    /// Load over approach, Pa.
    pub normal_secant_pa: f64,
    /// `k_n`: growth of the load with the approach, touching nodes stuck, Pa (N/m per metre of depth).
    pub normal_pa: f64,
    /// The same with nodes that slip freely, Pa.
    pub normal_frictionless_pa: f64,
    /// `k_l`: growth of the lateral force with the plate's way, touching nodes stuck, Pa.
    pub lateral_pa: f64,
    /// `k_l / k_n`.
    pub lateral_over_normal: f64,
    /// `k_l` over the secant `k_n`, which is the one in Eqs. 6 and 16.
    pub lateral_over_normal_secant: f64,
}

/// The stiffnesses of a case's ridge under `line_load_n_m`, held at a depth.
///
/// # Errors
/// A case that makes no sense.
pub fn of_case(case: &RidgeCase, line_load_n_m: f64, held: HeldAt) -> Result<StaticStiffness, RidgeError> {
    case.check()?;
    let built = case.geometry.mesh(case.materials(), case.elements)?;
    let plate = case.plate(&built)?;
    let springs = Springs { across: plate.penalty.clone(), along: plate.along.clone() };
    let soft_rows = (built.mesh.ny - built.corneum_rows) / 2;
    let row = match held {
        HeldAt::CorneumBase => built.corneum_rows,
        HeldAt::DermisBase => built.corneum_rows + soft_rows,
        HeldAt::Top => built.mesh.ny,
    };
    of_mesh(&built.mesh, row, &springs, line_load_n_m)
}

/// The stiffnesses of any mesh, whose node row `held` and all above it are held.
///
/// # Errors
/// A load that is not positive, or a body that nothing holds.
pub fn of_mesh(
    mesh: &Mesh,
    held: usize,
    springs: &Springs,
    line_load_n_m: f64,
) -> Result<StaticStiffness, RidgeError> {
    let possible = line_load_n_m > 0.0 && line_load_n_m.is_finite() && held > 0 && held <= mesh.ny;
    let range = "above 0, with a held row above the surface";
    RidgeError::unless(possible, "line load in N/m", line_load_n_m, range)?;
    let compliance = surface_compliance(mesh, held)?;
    let columns = compliance.len() / 2;
    let lowest = mesh.y_m[..columns].iter().copied().fold(f64::INFINITY, f64::min);
    let gap: Vec<f64> = mesh.y_m[..columns].iter().map(|y| y - lowest).collect();
    let (touching, approach_m, forces) = press(&compliance, &gap, springs, line_load_n_m)?;
    let width = mesh.tributary_width_m(0);
    let share = |k: usize| if mesh.periodic { width[k] } else { width[k].max(f64::MIN_POSITIVE) };
    let moment = |power: i32, about: f64| -> f64 {
        touching.iter().zip(&forces).map(|(i, f)| f * (mesh.x_m[*i] - about).powi(power)).sum::<f64>()
            / line_load_n_m
    };
    let contact_width_m = 4.0 * moment(2, moment(1, 0.0)).max(0.0).sqrt();
    let peak_pressure_pa = touching.iter().zip(&forces).map(|(i, f)| f / share(*i)).fold(0.0, f64::max);
    // Both axes at each touching node, stuck to the plate through its springs.
    let stuck: Vec<usize> = touching.iter().flat_map(|i| [2 * i, 2 * i + 1]).collect();
    let spring = |place: usize| [&springs.along, &springs.across][place % 2][place / 2];
    let system = dense(&compliance, &stuck, spring)?;
    let moved = |axis: usize| -> f64 {
        let mut right: Vec<f64> = stuck.iter().map(|p| f64::from(u8::from(p % 2 == axis))).collect();
        system.solve(&mut right);
        stuck.iter().zip(&right).filter(|(p, _)| *p % 2 == axis).map(|(_, f)| f).sum()
    };
    let (lateral_pa, normal_pa) = (moved(0), moved(1));
    let free: Vec<usize> = touching.iter().map(|i| 2 * i + 1).collect();
    let mut ones = vec![1.0; free.len()];
    dense(&compliance, &free, spring)?.solve(&mut ones);
    let normal_secant_pa = line_load_n_m / approach_m;
    Ok(StaticStiffness {
        line_load_n_m,
        contact_width_m,
        peak_pressure_pa,
        nodes: touching.len(),
        approach_m,
        normal_secant_pa,
        normal_pa,
        normal_frictionless_pa: ones.iter().sum(),
        lateral_pa,
        lateral_over_normal: lateral_pa / normal_pa,
        lateral_over_normal_secant: lateral_pa / normal_secant_pa,
    })
}

/// Compliance of chosen places with their springs in series, factorised.
fn dense(
    compliance: &[Vec<f64>],
    places: &[usize],
    spring: impl Fn(usize) -> f64,
) -> Result<Banded, RidgeError> {
    let n = places.len();
    let mut matrix = Banded::zeros(n, n.saturating_sub(1));
    for (a, p) in places.iter().enumerate() {
        for (b, q) in places[..=a].iter().enumerate() {
            let own = if a == b { 1.0 / spring(*p) } else { 0.0 };
            matrix.set(a, b, compliance[*q][*p] + own);
        }
    }
    matrix.factorised()
}

/// Presses without friction up to a load: the nodes that touch, the approach, and their forces.
fn press(
    compliance: &[Vec<f64>],
    gap: &[f64],
    springs: &Springs,
    load: f64,
) -> Result<(Vec<usize>, f64, Vec<f64>), RidgeError> {
    let able = |i: &usize| springs.across[*i] > 0.0;
    let mut touching: Vec<usize> = (0..gap.len()).filter(able).collect();
    // Nodes that pull are let go, those that the plate has passed are taken: it settles within a few rounds.
    for _ in 0..10 * gap.len() {
        let places: Vec<usize> = touching.iter().map(|i| 2 * i + 1).collect();
        let system = dense(compliance, &places, |p| springs.across[p / 2])?;
        let mut unit = vec![1.0; places.len()];
        let mut shape: Vec<f64> = touching.iter().map(|i| gap[*i]).collect();
        system.solve(&mut unit);
        system.solve(&mut shape);
        let approach = (load + shape.iter().sum::<f64>()) / unit.iter().sum::<f64>();
        let force: Vec<f64> = unit.iter().zip(&shape).map(|(u, s)| approach * u - s).collect();
        if force.iter().any(|f| *f < 0.0) {
            let pressed = touching.iter().zip(&force).filter(|(_, f)| **f >= 0.0).map(|(i, _)| *i);
            touching = pressed.collect();
            continue;
        }
        let lift = |i: usize| -> f64 {
            touching.iter().zip(&force).map(|(k, f)| compliance[2 * k + 1][2 * i + 1] * f).sum()
        };
        let passed =
            |i: &usize| able(i) && !touching.contains(i) && approach - gap[*i] - lift(*i) > 1e-12 * approach;
        let more: Vec<usize> = (0..gap.len()).filter(passed).collect();
        if more.is_empty() {
            return Ok((touching, approach, force));
        }
        touching.extend(more);
        touching.sort_unstable();
    }
    let rounds = 10.0 * gap.len() as f64;
    Err(RidgeError::input("rounds of the contact search", rounds, "fewer: the contact does not settle"))
}
