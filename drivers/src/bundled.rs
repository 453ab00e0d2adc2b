//! The profiles that come with the program. A new one: a file in `profiles/` and one line here.

const PROFILES: &[(&str, &str)] = &[
    ("ati-digital-ft", include_str!("../profiles/ati-digital-ft.toml")),
    ("ati-netft-can", include_str!("../profiles/ati-netft-can.toml")),
    ("ati-netft-rdt", include_str!("../profiles/ati-netft-rdt.toml")),
    ("cia402-profile-velocity", include_str!("../profiles/cia402-profile-velocity.toml")),
    ("hbk-wtx110", include_str!("../profiles/hbk-wtx110.toml")),
    ("iio-voltage", include_str!("../profiles/iio-voltage.toml")),
    ("keysight-33500b", include_str!("../profiles/keysight-33500b.toml")),
    ("labjack-t7", include_str!("../profiles/labjack-t7.toml")),
    ("me-gsv4-can", include_str!("../profiles/me-gsv4-can.toml")),
    ("muprime-amplifier", include_str!("../profiles/muprime-amplifier.toml")),
    ("muprime-chamber", include_str!("../profiles/muprime-chamber.toml")),
    ("muprime-force2", include_str!("../profiles/muprime-force2.toml")),
    ("muprime-relay", include_str!("../profiles/muprime-relay.toml")),
    ("muprime-stage", include_str!("../profiles/muprime-stage.toml")),
    ("piezodrive-pdus210", include_str!("../profiles/piezodrive-pdus210.toml")),
    ("polytec-ofv5000", include_str!("../profiles/polytec-ofv5000.toml")),
    ("robotiq-ft300", include_str!("../profiles/robotiq-ft300.toml")),
    ("robotiq-ft300-stream", include_str!("../profiles/robotiq-ft300-stream.toml")),
    ("siglent-sdg", include_str!("../profiles/siglent-sdg.toml")),
    ("wago-750-watchdog", include_str!("../profiles/wago-750-watchdog.toml")),
    ("zaber-x-lsm", include_str!("../profiles/zaber-x-lsm.toml")),
];

/// The files that profiles name.
const FILES: &[(&str, &str)] = &[
    ("cia402-profile-velocity.eds", include_str!("../profiles/cia402-profile-velocity.eds")),
    ("muprime-can.dbc", include_str!("../profiles/muprime-can.dbc")),
];

/// The text of a file that a profile names.
pub fn file(name: &str) -> Option<&'static str> {
    FILES.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}

/// The text of the profile of that name.
pub fn text(id: &str) -> Option<&'static str> {
    PROFILES.iter().find(|(known, _)| *known == id).map(|(_, text)| *text)
}

/// The names of all bundled profiles.
pub fn ids() -> impl Iterator<Item = &'static str> {
    PROFILES.iter().map(|(id, _)| *id)
}

#[cfg(test)]
mod tests {
    use super::*;
    use instruments::Profile;

    #[test]
    fn every_bundled_profile_is_read_and_its_vectors_hold() {
        for id in ids() {
            let text = text(id).expect(id);
            let profile = Profile::parse_with(text, &|name| file(name).map(String::from))
                .unwrap_or_else(|error| panic!("{id}: {error}"));
            profile.check(text).unwrap_or_else(|error| panic!("{id}: {error}"));
            assert_eq!(profile.id(), id);
        }
    }

    /// What is worked out from a gage at its converter's rail is no good force; a count of it is a step of the matrix.
    #[test]
    fn a_gage_at_its_rail_saturates_every_force() {
        use instruments::profile::Refusal;
        let profile = crate::profile("ati-digital-ft").unwrap();
        let mut values = profile.values();
        let frame = |name: &str| profile.frame(name).unwrap();
        for vector in profile.description.vector.iter().filter(|vector| vector.registers.is_some()) {
            let bytes: Vec<u8> = vector.registers.iter().flatten().flat_map(|r| r.to_be_bytes()).collect();
            let named = vector.frame.as_deref().and_then(|name| profile.frame(name));
            if let Some(frame) = named {
                profile.decode(frame, &bytes, &mut values).unwrap();
            }
        }
        let fx = profile.signal("fx").unwrap();
        assert!((profile.lsb_si(fx, &values) - 610e-6).abs() < 1e-9, "610 by the matrix over 10^6 counts");
        assert!(profile.lsb_si(fx, &profile.values()).is_nan(), "not known before the matrix is");
        let mut sample = [0_u8; 13];
        profile.decode(frame("stream"), &sample, &mut values).unwrap();
        assert_eq!(profile.refusal(fx, &values), None);
        sample[6..8].copy_from_slice(&i16::MAX.to_be_bytes());
        profile.decode(frame("stream"), &sample, &mut values).unwrap();
        assert_eq!(profile.refusal(fx, &values), Some(Refusal::OutOfRange));
    }

    /// A check that cannot fail is none: each number of each vector, changed, must be noticed.
    #[test]
    fn a_wrong_vector_is_noticed() {
        for id in ids() {
            let text = text(id).expect(id);
            let profile = Profile::parse_with(text, &|name| file(name).map(String::from)).expect(id);
            let all: Vec<(usize, String)> = profile
                .description
                .vector
                .iter()
                .enumerate()
                .flat_map(|(i, vector)| vector.expect.as_ref().keys().map(move |name| (i, name.clone())))
                .collect();
            for (vector, name) in all {
                let mut wrong = profile.clone();
                let expect = wrong.description.vector[vector].expect.as_mut();
                *expect.get_mut(&name).expect("named above") += 0.5;
                assert!(wrong.check(text).is_err(), "{id}: vector {vector}, {name}");
            }
        }
    }
}
