//! A fingertip that is the paper's finite element ridge instead of a slider on springs, read from its table.
//!
//! It is a truth of another kind for whoever tests a law against the virtual rig: the ridge has mass, layers
//! and a changing contact, and no closed form. Its plate may move by a multiple of the stroke, which is how a
//! reading of the paper's `w` is built (`models::reading`).

use super::{ConfigError, WorldConfig};
use crate::contact::{Contact, Steady};
use crate::defects::Surroundings;
use crate::finger::VirtualFinger;
use crate::world::{Point, steady_contact};
use models::{PeakToPeak, Surrogate};

/// The ridge under the finger.
pub(super) struct RidgeTable {
    table: Surrogate,
    strokes: f64,
    young_modulus_pa: f64,
}

/// Places along the travel at which defects are looked for that act on the contact, and which the table does not know.
const LOOKED_AT: u32 = 64;

impl RidgeTable {
    /// The ridge of a configuration, where its finger is one.
    pub(super) fn of(config: &WorldConfig) -> Result<Option<Self>, ConfigError> {
        let (strokes, young_modulus_pa) = (config.finger.ridge_table_strokes, config.finger.young_modulus_pa);
        if strokes == 0.0 {
            return Ok(None);
        }
        let refuse = |needed| ConfigError { field: "finger.ridge_table_strokes", value: strokes, needed };
        if config.alters_the_contact() {
            return Err(refuse(
                "the ridge's table knows no defect of the contact: leave those out, or take a slider (0)",
            ));
        }
        let table = Surrogate::shipped().map_err(|_| refuse("the table that ships cannot be read"))?;
        Ok(Some(RidgeTable { table, strokes, young_modulus_pa }))
    }

    /// The periodic state of the ridge where the slider would have this contact.
    pub(super) fn steady(&self, contact: &Contact) -> Steady {
        let whole = contact.limit_at_rest_n();
        if contact.sine_amplitude_m <= 0.0 || contact.normal_force_n <= 0.0 {
            return Steady { lateral_force_n: whole, contact_fraction: 1.0 };
        }
        let at = self.table.at(
            PeakToPeak::from_metres(2.0 * contact.sine_amplitude_m * self.strokes),
            contact.frequency_hz,
            contact.speed_m_s / contact.friction,
            contact.normal_force_n,
            self.young_modulus_pa,
        );
        Steady { lateral_force_n: at.mu_relative * whole, contact_fraction: at.contact_fraction }
    }
}

impl WorldConfig {
    /// Whether a defect changes the contact itself, beyond the plate's motion: somewhere on the travel, soon or late, at any load.
    fn alters_the_contact(&self) -> bool {
        let finger = VirtualFinger::new(&self.finger, 0);
        let [from, to] = self.stage.travel_m;
        (0..LOOKED_AT).any(|i| {
            let share = f64::from(i) / f64::from(LOOKED_AT - 1);
            let at = Surroundings {
                time_s: 1e3 * share,
                contact_time_s: 1e3 * share,
                position_m: from + share * (to - from),
                direction: if i % 2 == 0 { 1.0 } else { -1.0 },
                frequency_hz: 27.5e3,
                normal_force_n: 0.1 + 0.1 * f64::from(i % 5),
                ambient_pressure_pa: self.room.ambient_pressure_pa,
                temperature_c: self.room.temperature_c + 5.0 * share,
            };
            let point = Point { at, known_pp_m: 2e-6, speed_m_s: 0.02 };
            let found = steady_contact(&finger, &self.defects, &point);
            let plain =
                finger.contact(found.sine_amplitude_m, at.frequency_hz, point.speed_m_s, at.normal_force_n);
            found != plain
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::defects::Defects;

    #[test]
    fn a_defect_of_the_contact_is_refused_and_one_of_the_plate_is_not() {
        let with = |name: &str| {
            let mut config = WorldConfig::ideal();
            config.finger.ridge_table_strokes = 1.0;
            config.defects = Defects::sealed(name, 1).expect("a defect");
            RidgeTable::of(&config)
        };
        for name in ["squeeze_film", "contact_ageing", "adhesion", "second_harmonic", "contaminated_patch"] {
            assert!(with(name).is_err(), "{name}");
        }
        for name in ["mode_shape", "amplitude_miscalibration", "lateral_gain"] {
            assert!(with(name).is_ok_and(|ridge| ridge.is_some()), "{name}");
        }
        assert!(RidgeTable::of(&WorldConfig::ideal()).is_ok_and(|ridge| ridge.is_none()));
    }

    #[test]
    fn it_says_what_the_table_says() {
        let mut config = WorldConfig::ideal();
        config.finger.ridge_table_strokes = 2.0;
        let ridge = RidgeTable::of(&config).unwrap().unwrap();
        let contact = Contact::ideal(3.9e6, 1.5e6, 0.5, 0.25, 0.5e-6, 27.5e3, 0.02);
        // 1 um of stroke moves by 2 um: 0.294 on a fine mesh (docs/ridge.md), and the table's own is coarse.
        let mu = ridge.steady(&contact).lateral_force_n / (0.5 * 0.25);
        assert!((mu - 0.294).abs() < 0.015, "{mu}");
        let still = Contact { sine_amplitude_m: 0.0, ..contact };
        assert_eq!(ridge.steady(&still).lateral_force_n, 0.125);
    }
}
