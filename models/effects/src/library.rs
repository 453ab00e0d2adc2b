//! The candidate causes, one file each.
//!
//! A file holds everything that is known of its cause: laws, priors and sources, what a table must hold to
//! show it, which certificate bounds it, what does the same, and which check sees it without going through
//! friction. Nothing of that stands anywhere else. To add a cause: its file, and its line in the list below.

use crate::effect::{Effect, Law};
use crate::own::by_name;

/// What every cause's file needs.
mod prelude {
    pub use crate::contact::Contact;
    pub use crate::effect::{Acts, Effect, Input, Law, Location, Need, Parameter, STATED_AT_N};
    pub use crate::operating::{Design, LEAST_SHARE, atmospheres};
    pub use models::condition::Condition;
    pub use models::covariate;
    pub use models::rig_file::CertifiedKey;

    /// What is left alone between runs recovers in part.
    pub const IN_RUN: Parameter = Parameter::positive("share_of_time_in_run", "1", 0.4, 1.0).bending();
    /// Growth of a lever arm, or of a bowed plate's angle, along the plate.
    pub const ALONG: Parameter = Parameter::signed("growth_over_stroke", "1", 0.7, -3.0, 3.0).bending();
    /// Growth as a sensor or a mount yields under the load.
    pub const LOADED: Parameter = Parameter::signed("growth_with_load", "1", 0.3, -0.9, 2.0).bending();

    /// What the vibration does as a share of that at the largest amplitude and the reference frequency: by
    /// powers of both.
    pub fn vibrating(exponents: &[f64], pass: &Condition, design: &Design) -> f64 {
        let amplitude = pass.amplitude.metres() / design.largest_amplitude_m.max(1e-12);
        let frequency = pass.frequency_hz / design.reference_frequency_hz;
        amplitude.powf(exponents[0]) * frequency.powf(exponents[1])
    }

    /// Growth in the course of the table, as wax or glue creeps.
    pub const LATER: Parameter = Parameter::signed("growth_over_table", "1", 0.5, -2.0, 2.0).bending();

    /// A size alone, or one that changes by [`ALONG`], [`LOADED`] and [`LATER`].
    pub fn bent(theta: &[f64], pass: &Condition, design: &Design) -> f64 {
        let [size, along, loaded, later] = *theta else { return theta[0] };
        let place = if design.stroke_m > 0.0 { pass.position_m / design.stroke_m } else { 0.0 };
        let load = pass.normal_force_n / design.reference_load_n - 1.0;
        let time = pass.time_s / design.duration_s.max(1e-9);
        size * (1.0 + along * place) * (1.0 + loaded * load) * (1.0 + later * time)
    }
}

/// Declares the files of this folder and lists their causes.
macro_rules! causes {
    (library { $($file:ident)* } open_set { $($other:ident)* }) => {
        $(mod $file;)*
        $(mod $other;)*
        static LIBRARY: &[&Effect] = &[$(&$file::EFFECT),*];
        pub(crate) static KNOWN: &[&Effect] = &[$(&$file::EFFECT,)* $(&$other::EFFECT),*];
    };
}

causes! {
    // In the order in which a signal passes them: instruments that falsify the condition, plate, finger,
    // contact, instruments that read the force.
    library {
        normal_offset
        normal_gain
        speed_error
        speed_ripple
        amplitude_miscalibration
        amplitude_saturation
        resonance_detuning
        mode_shape
        amplitude_droop
        stiffness_error
        subsurface_relaxation
        moisture_drift
        rate_dependent_friction
        load_dependent_friction
        adhesion
        multi_asperity
        normal_damping
        lateral_recovery
        contact_ageing
        ridge_inertia
        squeeze_film
        plate_tilt
        force_crosstalk
        lateral_gain
        lateral_offset_drift
        sensor_lag
        time_misalignment
    }
    // Causes of known form that no verdict names: the open set of a diagnosis takes them in.
    open_set {
        charging
        drag
        frictional_heating
        gain_drift
        lateral_resonance
        second_harmonic
    }
}

/// Every effect that a verdict may name, in the order in which effects act.
pub fn library() -> &'static [&'static Effect] {
    LIBRARY
}

/// The library, and after it causes of known form that it does not name: a diagnosis' open set takes them in.
pub fn known() -> &'static [&'static Effect] {
    KNOWN
}

/// Whether two effects are one cause under two names: a law of one states that it does the same as a law of the other.
pub fn one_cause(a: &str, b: &str) -> bool {
    let states = |one: &str, other: &str| {
        let laws = by_name(one).map_or(&[][..], |e| e.laws);
        laws.iter().any(|l| l.same_as.is_some_and(|(effect, _)| effect == other))
    };
    states(a, b) || states(b, a)
}

/// The cause outside of the library that these effects of it together nearly imitate, where there is one.
pub fn imitated(names: &[&str]) -> Option<&'static Effect> {
    let by = |e: &&&Effect| !e.imitated_by.is_empty() && e.imitated_by.iter().all(|n| names.contains(n));
    known().iter().find(by).copied()
}

/// Every two laws that do the same for the same size, by index of effect and law: those that act as one
/// change of the baseline, and those that say so of each other.
pub fn twins() -> Vec<[(usize, usize); 2]> {
    let laws: Vec<(usize, usize, &Law)> = (library().iter().enumerate())
        .flat_map(|(e, effect)| effect.laws.iter().enumerate().map(move |(l, law)| (e, l, law)))
        .collect();
    let says = |a: &(usize, usize, &Law), b: &(usize, usize, &Law)| {
        a.2.same_as == Some((library()[b.0].name, b.2.name))
    };
    let mut list = Vec::new();
    for (k, a) in laws.iter().enumerate() {
        for b in laws[k + 1..].iter().filter(|b| b.0 != a.0) {
            let one = a.2.acts_as.is_some() && a.2.acts_as == b.2.acts_as;
            if one || says(a, b) || says(b, a) {
                list.push([(a.0, a.1), (b.0, b.1)]);
            }
        }
    }
    list
}
