//! Setups that come with the program.

/// Name and text of every bundled setup. Add one: a file in `runs/setups/` and a line here.
pub const BUNDLED: &[(&str, &str)] = &[
    ("virtual", include_str!("../../setups/virtual.toml")),
    ("virtual-ideal", include_str!("../../setups/virtual-ideal.toml")),
    ("virtual-mixed", include_str!("../../setups/virtual-mixed.toml")),
    ("virtual-relay", include_str!("../../setups/virtual-relay.toml")),
    ("virtual-rtu", include_str!("../../setups/virtual-rtu.toml")),
    ("virtual-slcan", include_str!("../../setups/virtual-slcan.toml")),
    ("virtual-socketcan", include_str!("../../setups/virtual-socketcan.toml")),
];
