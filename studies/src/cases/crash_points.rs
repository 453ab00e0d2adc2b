//! Fault points: the worker kills itself, as a power cut or an out-of-memory killer would, at a step that a test names.

/// Names the step; unset in earnest.
pub const VARIABLE: &str = "MUPRIME_CASE_DIES_AT";

/// The steps of the worker in their order.
pub const STEPS: [&str; 9] = [
    "start",
    "study-written",
    "study-moved",
    "part-made",
    "half-written",
    "written",
    "synced",
    "moved",
    "folder-synced",
];

/// Ends this process by SIGKILL where [`VARIABLE`] names this step: nothing is cleaned up, nothing flushed.
pub fn here(step: &'static str) {
    debug_assert!(STEPS.contains(&step));
    if std::env::var_os(VARIABLE).is_some_and(|named| named == step) {
        // As a kill would: nothing is cleaned up.
        std::process::abort();
    }
}
