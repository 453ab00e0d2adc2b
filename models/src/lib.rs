//! The nouns and the laws of ultrasonic friction reduction. Pure `f64`: no clock, no file, no randomness.
//!
//! Paper: Vezzoli et al., 'Friction Reduction Through Ultrasonic Vibration, Part 1: Modelling
//! Intermittent Contact'. Equation numbers in these docs are that paper's.
//!
//! | module | purpose |
//! |---|---|
//! | [`quantity`] | `PeakToPeak` and its one conversion |
//! | [`condition`], [`finger`] | one operating point; the fingertip |
//! | [`covariate`] | what tells one condition from another: name, unit, words, range, getter |
//! | [`spring_slider`] | Eqs. 6-15 and section 5.3 |
//! | [`psi`] | Eqs. 16-20 |
//! | [`psi_fit`] | its constant Psi* fitted, with an interval |
//! | [`psi_star`] | Psi* of a rig's own passes, with an interval |
//! | [`reading`], [`reading_evidence`] | how the paper's w may be read; which reading the passes support |
//! | [`ridge`] | the finite element model of section 3 |
//! | [`surrogate`], [`inverse`] | a table of the ridge that is quick to read; the amplitude for a wanted friction |
//! | [`target`] | a wanted friction over position |
//! | [`prediction`], `regime` | what every friction law answers |
//! | [`law`], [`law_table`], [`sparse`] | laws by name; own laws as tables; the surrogate of `model adapt` |
//! | [`pass`] | the data vocabulary: passes, the point table |
//! | [`rig_file`] | `rig.toml`: finger, repeatability, what certificates leave open |
//! | [`root`] | roots in a bracket |
//!
//! ```
//! use muprime_models::condition::Condition;
//! use muprime_models::finger::Finger;
//! use muprime_models::prediction::{FrictionModel, SpringSlider};
//! use muprime_models::quantity::PeakToPeak;
//!
//! let model = SpringSlider::new(Finger::paper())?;
//! // The paper's nominal point: 2 um peak-to-peak at 27.5 kHz, a finger of 0.25 N sliding at 20 mm/s.
//! let vibrating = model.predict(&Condition::paper())?;
//! assert!((vibrating.mu_relative - 0.296).abs() < 1e-3);
//! // Without vibration the whole friction is there.
//! let still = Condition { amplitude: PeakToPeak::ZERO, ..Condition::paper() };
//! assert_eq!(model.predict(&still)?.mu_relative, 1.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod condition;
pub mod covariate;
pub mod finger;
pub mod inverse;
pub mod law;
pub mod law_table;
pub mod pass;
pub mod prediction;
pub mod psi;
pub mod psi_fit;
pub mod psi_star;
pub mod quantity;
pub mod reading;
pub mod reading_evidence;
mod regime;
pub mod ridge;
pub mod rig_file;
pub mod root;
pub mod sparse;
pub mod spring_slider;
pub mod surrogate;
pub mod target;

pub use condition::{Ambient, Condition, OutOfDomain};
pub use covariate::Covariate;
pub use finger::Finger;
pub use law::BuiltIn;
pub use pass::Pass;
pub use prediction::{FrictionModel, SpringSlider};
pub use quantity::{Direction, PeakToPeak};
pub use reading::Reading;
pub use rig_file::{Calibration, PassNoise, RigFile};
pub use surrogate::Surrogate;
pub use target::Target;
