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
    /// The first sentence of its first comment, which says what it is; of a fingertip the material.
    pub fn about(&self) -> String {
        let lines = self.text.lines().skip_while(|line| !line.starts_with("# "));
        let comment: Vec<&str> = lines.map_while(|line| line.strip_prefix("# ")).collect();
        let material = || self.text.lines().find_map(|line| line.strip_prefix("material = "));
        let Some(all) = Some(comment.join(" ")).filter(|all| !all.is_empty()) else {
            return material().unwrap_or_default().trim_matches('"').to_string();
        };
        all.split_inclusive(". ").next().unwrap_or_default().trim_end().to_string()
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
