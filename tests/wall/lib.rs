//! What tests in wall-clock time share: judgements beside stalls (`wall_time`), a `bench` behind sockets.

pub mod bench;
mod wall_time;

pub use wall_time::{
    Stopwatch, again_beside_a_stall, cut_by_a_stall, in_wall_clock_time, outcome_alone, sweep_taken_up_again,
    sweep_unless_the_machine_stalls, undecided, unless_the_machine_stalls,
};

use tests::served::AmplifierWatch;

/// Waits until a served amplifier is on, or off.
///
/// # Panics
/// Where it never is within a minute.
pub fn wait_until(amplifier: &mut AmplifierWatch, on: bool) {
    let began = std::time::Instant::now();
    while amplifier.read().on != on {
        assert!(began.elapsed().as_secs() < 60, "the amplifier never shows {on}");
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
}
