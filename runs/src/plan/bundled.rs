//! Plans that come with the program.

/// Name and text of every bundled plan. Add one: a file in `runs/plans/` and a line here.
pub const BUNDLED: &[(&str, &str)] = &[
    ("first-sweep", include_str!("../../plans/first-sweep.toml")),
    ("fig9-artificial", include_str!("../../plans/fig9-artificial.toml")),
    ("part2-validation", include_str!("../../plans/part2-validation.toml")),
    ("render-grating", include_str!("../../plans/render-grating.toml")),
    ("psi-reading", include_str!("../../plans/psi-reading.toml")),
];
