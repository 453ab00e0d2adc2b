//! What comes with the program, by name.

use serde::Serialize;

/// One bundled file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Bundled {
    /// `plan`, `setup`, `fingertip` or `profile`.
    pub kind: &'static str,
    /// Name.
    pub name: &'static str,
    /// The file.
    #[serde(skip)]
    pub text: &'static str,
}

impl Bundled {
    /// Its first comment, which says what it is.
    pub fn about(&self) -> &'static str {
        self.text.lines().find_map(|l| l.strip_prefix("# ")).unwrap_or_default()
    }
}

/// Everything that is bundled.
pub fn all() -> Vec<Bundled> {
    let of = |kind, list: &[(&'static str, &'static str)]| {
        list.iter().map(|(name, text)| Bundled { kind, name, text }).collect::<Vec<_>>()
    };
    let mut all = of("plan", runs::plan::BUNDLED);
    all.extend(of("campaign", runs::campaign::BUNDLED));
    all.extend(of("setup", runs::setup::BUNDLED));
    all.extend(of("fingertip", runs::fingertip::BUNDLED));
    let text = |id| drivers::bundled::text(id).map(|text| Bundled { kind: "profile", name: id, text });
    all.extend(drivers::bundled::ids().filter_map(text));
    all
}
