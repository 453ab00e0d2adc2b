//! The candidate causes, one file each.
//!
//! A file holds everything that is known of its cause: laws, priors and sources, what a table must hold to show it,
//! which certificate bounds it, what does the same, and which check sees it without going through friction. Nothing
//! of that stands anywhere else. To add a cause: its file, and its line in the list below.

use crate::effect::Effect;

/// What every cause's file needs.
mod prelude {
    pub use crate::contact::Contact;
    pub use crate::effect::{Effect, Law, Need, Parameter, Place};
    pub use crate::operating::{Design, Operating, Reading, atmospheres};
}

/// Declares the files of this folder and lists their causes.
macro_rules! causes {
    (library { $($file:ident::$cause:ident)* } open_set { $($other_file:ident::$other:ident)* }) => {
        $(pub mod $file;)*
        $(pub mod $other_file;)*
        static LIBRARY: &[&dyn Effect] = &[$(&$file::$cause),*];
        static KNOWN: &[&dyn Effect] = &[$(&$file::$cause,)* $(&$other_file::$other),*];
    };
}

causes! {
    // In the order in which a signal passes them: instruments that falsify the condition, plate, finger, contact,
    // instruments that read the force.
    library {
        normal_offset::NormalOffset
        speed_error::SpeedError
        speed_ripple::SpeedRipple
        amplitude_miscalibration::AmplitudeMiscalibration
        amplitude_saturation::AmplitudeSaturation
        resonance_detuning::ResonanceDetuning
        mode_shape::ModeShape
        amplitude_droop::AmplitudeDroop
        stiffness_error::StiffnessError
        subsurface_relaxation::SubsurfaceRelaxation
        moisture_drift::MoistureDrift
        rate_dependent_friction::RateDependentFriction
        load_dependent_friction::LoadDependentFriction
        adhesion::Adhesion
        multi_asperity::MultiAsperity
        normal_damping::NormalDamping
        lateral_recovery::LateralRecovery
        contact_ageing::ContactAgeing
        ridge_inertia::RidgeInertia
        squeeze_film::SqueezeFilm
        plate_tilt::PlateTilt
        force_crosstalk::ForceCrosstalk
        lateral_gain::LateralGain
        lateral_offset_drift::LateralOffsetDrift
        sensor_lag::SensorLag
        time_misalignment::TimeMisalignment
    }
    // Causes of known form that no verdict names: the open set of a diagnosis takes them in.
    open_set {
        frictional_heating::FrictionalHeating
    }
}

/// Every effect that a verdict may name, in the order in which effects act.
pub fn library() -> &'static [&'static dyn Effect] {
    LIBRARY
}

/// The library, and after it causes of known form that it does not name: a diagnosis' open set takes them in.
pub fn known() -> &'static [&'static dyn Effect] {
    KNOWN
}

/// The effect of that name in the library.
pub fn by_name(name: &str) -> Option<&'static dyn Effect> {
    library().iter().copied().find(|effect| effect.name() == name)
}
