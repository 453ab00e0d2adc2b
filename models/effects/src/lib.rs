//! Candidate effects: what may part reality from the baseline model, one file each.
//!
//! An effect changes what the contact is given ([`contact::Contact`]) or what the instruments make of the
//! force ([`operating::Reading`]); the contact itself is solved in one place. Effects therefore combine, and
//! each nests the baseline exactly. To add one: a file, and one line in [`library`]'s list.

pub mod asperities;
pub mod contact;
pub mod corrected;
pub mod effect;
pub mod impact;
pub mod listing;
pub mod operating;
pub mod predict;
pub mod sweep;

pub mod adhesion;
pub mod amplitude_droop;
pub mod amplitude_miscalibration;
pub mod amplitude_saturation;
pub mod contact_ageing;
pub mod force_crosstalk;
pub mod frictional_heating;
pub mod lateral_gain;
pub mod lateral_offset_drift;
pub mod lateral_recovery;
pub mod load_dependent_friction;
pub mod mode_shape;
pub mod moisture_drift;
pub mod multi_asperity;
pub mod normal_damping;
pub mod normal_offset;
pub mod plate_tilt;
pub mod rate_dependent_friction;
pub mod resonance_detuning;
pub mod ridge_inertia;
pub mod sensor_lag;
pub mod speed_error;
pub mod speed_ripple;
pub mod squeeze_film;
pub mod stiffness_error;
pub mod subsurface_relaxation;
pub mod time_misalignment;

pub use effect::{Effect, Law, Need, Parameter, Place, Prior};
pub use operating::{Baseline, Design, Reading};
pub use predict::{Active, lateral_force};

/// What every effect's file needs.
mod prelude {
    pub use crate::contact::Contact;
    pub use crate::effect::{Effect, Law, Need, Parameter, Place};
    pub use crate::operating::{Design, Reading, atmospheres};
    pub use models::condition::Condition;
}

/// Every effect of the library, in the order in which a signal passes them: instruments that falsify the
/// condition first, then plate, finger and contact.
pub fn library() -> &'static [&'static dyn Effect] {
    &KNOWN[..LIBRARY]
}

/// Number of effects in the library.
const LIBRARY: usize = 26;

/// The library, and after it causes of known form that it does not name: a diagnosis' open set takes them in.
pub fn known() -> &'static [&'static dyn Effect] {
    &KNOWN
}

static KNOWN: [&dyn Effect; LIBRARY + 1] = [
    &normal_offset::NormalOffset,
    &speed_error::SpeedError,
    &speed_ripple::SpeedRipple,
    &amplitude_miscalibration::AmplitudeMiscalibration,
    &amplitude_saturation::AmplitudeSaturation,
    &resonance_detuning::ResonanceDetuning,
    &mode_shape::ModeShape,
    &amplitude_droop::AmplitudeDroop,
    &stiffness_error::StiffnessError,
    &subsurface_relaxation::SubsurfaceRelaxation,
    &moisture_drift::MoistureDrift,
    &rate_dependent_friction::RateDependentFriction,
    &load_dependent_friction::LoadDependentFriction,
    &adhesion::Adhesion,
    &multi_asperity::MultiAsperity,
    &normal_damping::NormalDamping,
    &lateral_recovery::LateralRecovery,
    &contact_ageing::ContactAgeing,
    &ridge_inertia::RidgeInertia,
    &squeeze_film::SqueezeFilm,
    &plate_tilt::PlateTilt,
    &force_crosstalk::ForceCrosstalk,
    &lateral_gain::LateralGain,
    &lateral_offset_drift::LateralOffsetDrift,
    &sensor_lag::SensorLag,
    &time_misalignment::TimeMisalignment,
    &frictional_heating::FrictionalHeating,
];

/// The effect of that name.
pub fn by_name(name: &str) -> Option<&'static dyn Effect> {
    library().iter().copied().find(|effect| effect.name() == name)
}
