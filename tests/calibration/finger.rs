//! Finger: friction without vibration of the virtual fingertip, its coefficient withheld.

use crate::bench::{Coverage, TRIALS, seed};
use calibration::finger::friction::{FrictionPoint, friction};
use calibration::uncertainty::student::coverage_factor;
use sim::defects::{Defects, Surroundings};
use sim::finger::{Finger, FingerConfig};
use sim::noise::Noise;
use sim::world::{Point, steady_forces};

/// Passes over loads and speeds with pass-to-pass scatter and force noise, as the rig would measure them.
fn passes(finger: &Finger, defects: &Defects, draw: &mut Noise) -> Vec<FrictionPoint> {
    let mut points = Vec::new();
    for normal_force_n in [0.1, 0.2, 0.4, 0.8] {
        for speed_m_s in [0.01, 0.03, 0.1] {
            for _ in 0..3 {
                let at = Surroundings {
                    time_s: 0.0,
                    contact_time_s: 5.0,
                    position_m: 0.0,
                    direction: 1.0,
                    frequency_hz: 27_500.0,
                    normal_force_n,
                    ambient_pressure_pa: 101_325.0,
                    temperature_c: 22.0,
                };
                let forces = steady_forces(finger, defects, &Point { at, known_pp_m: 0.0, speed_m_s });
                let lateral = forces.lateral_n * (1.0 + 0.015 * draw.normal()) + 2e-4 * draw.normal();
                points.push(FrictionPoint {
                    normal_force_n: forces.normal_n + 2e-4 * draw.normal(),
                    speed_m_s,
                    lateral_force_n: lateral,
                    contact_time_s: None,
                });
            }
        }
    }
    points
}

#[test]
fn friction_and_its_exponents_are_covered_as_stated() {
    let mut covered: [Coverage; 3] = Default::default();
    for trial in 0..TRIALS {
        let mut draw = Noise::new(seed(trial), "friction bench");
        let config = FingerConfig { mu0: draw.between(0.2, 1.2), ..FingerConfig::default() };
        let finger = Finger::new(&config, seed(trial));
        let found = friction(&passes(&finger, &Defects::none(), &mut draw)).unwrap();
        let k = coverage_factor(0.95, found.fit.degrees_of_freedom);
        // A Coulombic world: no dependence on load or speed.
        for (i, truth) in [config.mu0.ln(), 0.0, 0.0].into_iter().enumerate() {
            let (value, half) = (found.fit.estimates[i], k * found.fit.standard_uncertainty(i));
            covered[i].add([value - half, value + half], truth);
        }
    }
    for (c, name) in covered.iter().zip(["mu0", "load exponent", "speed exponent"]) {
        c.judge(name);
    }
}

#[test]
fn a_contact_that_is_not_coulombic_is_seen() {
    let text = "[[defect]]\nname = \"load_dependent_friction\"\nparameters = { area_share = 0.9 }\n";
    let mut draw = Noise::new(seed(0), "friction bench");
    let finger = Finger::new(&FingerConfig::default(), 1);
    let found = friction(&passes(&finger, &Defects::parse(text).unwrap(), &mut draw)).unwrap();
    let (exponent, u) = (found.fit.estimates[1], found.fit.standard_uncertainty(1));
    // Between Coulomb (0) and a Hertz contact's area (-1/3).
    assert!(exponent + 3.0 * u < 0.0 && exponent > -0.34, "{exponent} +- {u}");
}
