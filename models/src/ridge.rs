//! The paper's finite element model of one fingerprint ridge on a vibrating plate (section 3).
//!
//! | file | holds |
//! |---|---|
//! | `mesh.rs` | the structured mesh and the ridge's sizes (Table 1) |
//! | `material.rs` | elastic and viscoelastic tissue |
//! | `field.rs` | numbers that start on a cache line |
//! | `lanes.rs`, `kernel.rs` | one step of all elements and nodes in SIMD |
//! | `layers.rs` | soft layers that move in longer steps |
//! | `body.rs` | the fields the kernel works on, energies |
//! | `contact.rs` | the rigid plate, penalty and friction |
//! | `stability.rs` | the stable time step |
//! | `static_stiffness.rs` | `k_n`, `k_l` and their ratio, statically |
//! | `case.rs` | one case and the declared defaults |
//! | `loading.rs` | press, slide, vibrate (Fig. 6), and what is read from it |
//! | `patch.rs` | several ridges, and a ridge of finite length |
//! | `phase_curves.rs` | phase shift over a grid of skins, for the inverse analysis |
//! | `short_study.rs` | Psi* from a part of Fig. 12, for surveys |
//! | `study.rs` | parametric studies (Fig. 9), content keys |
//! | `cycle.rs` | one vibration cycle, steadiness, phase, period doubling |
//!
//! Forces and masses are per metre of depth (plane strain). `docs/ridge.md` states every assumption and
//! how it was checked.

pub mod body;
pub mod case;
pub mod contact;
pub mod cycle;
mod field;
mod kernel;
mod lanes;
mod layers;
pub mod loading;
pub mod material;
pub mod mesh;
pub mod patch;
pub mod phase_curves;
pub mod short_study;
pub mod stability;
pub mod static_stiffness;
pub mod study;

pub use body::{Body, Energy, Strain, Work};
pub use case::RidgeCase;
pub use contact::{ContactForce, FrictionRule, Plate};
pub use cycle::{RidgeCycle, Steady};
pub use kernel::Surface;
pub use lanes::Instructions;
pub use loading::{RidgeRun, RunSettings, run, run_watched};
pub use material::Material;
pub use mesh::{Mesh, RidgeGeometry, RidgeMesh, RidgeProfile};
pub use phase_curves::{PhaseCurves, Skin, SkinGrid};

/// Why a ridge could not be built or computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of an error says what its fields are")]
pub enum RidgeError {
    /// A value that makes no sense, with what it may be.
    #[error("{what} is {value}: must be {range}")]
    Input { what: String, value: f64, range: String },
    /// The requested time step is above the stable one.
    #[error("a time step of {wanted_s:e} s is unstable here: at most {stable_s:e} s (or leave it out)")]
    UnstableStep { wanted_s: f64, stable_s: f64 },
    /// The run has run away; its numbers mean nothing.
    #[error("the run diverged: velocities beyond 1e6 m/s or not numbers; use a smaller time step")]
    Diverged,
}

impl RidgeError {
    fn input(what: impl Into<String>, value: f64, range: impl Into<String>) -> Self {
        Self::Input { what: what.into(), value, range: range.into() }
    }

    fn unless(ok: bool, what: impl Into<String>, value: f64, range: impl Into<String>) -> Result<(), Self> {
        if ok { Ok(()) } else { Err(Self::input(what, value, range)) }
    }
}
