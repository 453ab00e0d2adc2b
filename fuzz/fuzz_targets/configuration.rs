//! Coverage-guided: the functions of `tests/fuzz/configuration.rs`. The first byte says which, the next eight
//! are the seed of its choices, the rest is its input.
#![no_main]

#[path = "../../tests/fuzz/chance.rs"]
mod chance;
#[path = "../../tests/fuzz/configuration.rs"]
mod target;

use chance::Chance;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let Some((head, input)) = data.split_first_chunk::<9>() else { return };
    let mut seed = [0; 8];
    seed.copy_from_slice(&head[1..]);
    let (_, held) = target::ALL[usize::from(head[0]) % target::ALL.len()];
    held(input, &mut Chance(u64::from_be_bytes(seed)));
});
