//! The profiles that come with the program. A new one: a file in `profiles/` and one line here.

const PROFILES: &[(&str, &str)] = &[
    ("ati-netft-can", include_str!("../../profiles/ati-netft-can.toml")),
    ("cia402-profile-velocity", include_str!("../../profiles/cia402-profile-velocity.toml")),
    ("hbk-wtx110", include_str!("../../profiles/hbk-wtx110.toml")),
    ("keysight-33500b", include_str!("../../profiles/keysight-33500b.toml")),
    ("me-gsv4-can", include_str!("../../profiles/me-gsv4-can.toml")),
    ("muprime-amplifier", include_str!("../../profiles/muprime-amplifier.toml")),
    ("muprime-force2", include_str!("../../profiles/muprime-force2.toml")),
    ("muprime-stage", include_str!("../../profiles/muprime-stage.toml")),
    ("piezodrive-pdus210", include_str!("../../profiles/piezodrive-pdus210.toml")),
    ("robotiq-ft300", include_str!("../../profiles/robotiq-ft300.toml")),
    ("robotiq-ft300-stream", include_str!("../../profiles/robotiq-ft300-stream.toml")),
];

/// The files that profiles name.
const FILES: &[(&str, &str)] = &[("muprime-can.dbc", include_str!("../../profiles/muprime-can.dbc"))];

/// The text of a file that a profile names.
#[must_use]
pub fn file(name: &str) -> Option<&'static str> {
    FILES.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}

/// The text of the profile of that name.
#[must_use]
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
