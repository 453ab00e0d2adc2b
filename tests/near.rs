//! Effects of the library that nearly do the same, so that one is found where the other is missing.

/// Each two of them.
const NEAR: [(&str, &str); 13] = [
    ("stiffness_error", "speed_error"),
    ("stiffness_error", "amplitude_miscalibration"),
    ("stiffness_error", "subsurface_relaxation"),
    ("adhesion", "normal_offset"),
    ("load_dependent_friction", "adhesion"),
    ("load_dependent_friction", "normal_offset"),
    ("subsurface_relaxation", "speed_error"),
    ("subsurface_relaxation", "amplitude_miscalibration"),
    ("subsurface_relaxation", "resonance_detuning"),
    ("normal_damping", "ridge_inertia"),
    ("force_crosstalk", "plate_tilt"),
    ("speed_ripple", "mode_shape"),
    ("speed_error", "amplitude_miscalibration"),
];

/// Whether one of two effects nearly does what the other does.
pub fn near(a: &str, b: &str) -> bool {
    NEAR.contains(&(a, b)) || NEAR.contains(&(b, a))
}

#[test]
fn effects_that_are_near_are_of_the_library() {
    let names: Vec<&str> = effects::library().iter().map(|effect| effect.name).collect();
    assert!(NEAR.iter().all(|(a, b)| names.contains(a) && names.contains(b) && a != b));
}
