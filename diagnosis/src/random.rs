//! Numbers that look drawn by chance, the same each time: the same data gives the same answer.

/// A normal deviate by the sum of twelve.
pub(crate) fn deviate(state: &mut u64) -> f64 {
    (0..12).map(|_| (split_mix(state) >> 11) as f64 / (1u64 << 53) as f64).sum::<f64>() - 6.0
}

/// SplitMix64: a fixed stream, so that the same data gives the same interval.
pub(crate) fn split_mix(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}
