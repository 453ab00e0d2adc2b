//! The profiles that come with the program. A new one: a file in `profiles/` and one line here.

const PROFILES: &[(&str, &str)] = &[
    ("hbk-wtx110", include_str!("../../profiles/hbk-wtx110.toml")),
    ("muprime-amplifier", include_str!("../../profiles/muprime-amplifier.toml")),
    ("muprime-force2", include_str!("../../profiles/muprime-force2.toml")),
    ("muprime-stage", include_str!("../../profiles/muprime-stage.toml")),
];

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
            let profile = Profile::parse(text).unwrap_or_else(|error| panic!("{id}: {error}"));
            profile.check(text).unwrap_or_else(|error| panic!("{id}: {error}"));
            assert_eq!(profile.id(), id);
        }
    }

    /// A check that cannot fail is none: each number of each vector, changed, must be noticed.
    #[test]
    fn a_wrong_vector_is_noticed() {
        for id in ids() {
            let text = text(id).expect(id);
            let profile = Profile::parse(text).expect(id);
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
