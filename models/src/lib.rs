//! The nouns and the laws of ultrasonic friction reduction. Pure `f64`: no clock, no file, no randomness.
//!
//! Paper: Vezzoli et al., 'Friction Reduction Through Ultrasonic Vibration, Part 1: Modelling
//! Intermittent Contact'. Equation numbers in these docs are that paper's.
//!
//! | room | purpose |
//! |---|---|
//! | [`quantity`] | `PeakToPeak` and its one conversion |
//! | [`condition`], [`finger`] | one operating point; the fingertip |
//! | [`covariate`] | what tells one condition from another: name, unit, words, range, getter |
//! | [`spring_slider`] | Eqs. 6-15 and section 5.3 |
//! | [`psi`] | Eqs. 16-20 |
//! | [`prediction`] | what every friction law answers |
//! | [`record`] | the data vocabulary: passes, the point table |
//! | [`rig_file`] | `rig.toml`: finger, repeatability, what certificates leave open |

pub mod condition;
pub mod covariate;
pub mod finger;
pub mod inverse;
pub mod prediction;
pub mod psi;
pub mod psi_fit;
pub mod quantity;
pub mod record;
pub mod ridge;
pub mod rig_file;
pub mod root;
pub mod spring_slider;
pub mod surrogate;
