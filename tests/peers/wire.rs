//! The drivers and the emulators against programs that nobody here wrote, on real sockets and lines.

#[path = "wire/ati_digital.rs"]
mod ati_digital;
#[path = "wire/instruments.rs"]
mod instruments;
#[path = "wire/line_peers.rs"]
mod line_peers;
#[path = "wire/lines.rs"]
mod lines;
#[path = "wire/own_profiles.rs"]
mod own_profiles;
#[path = "wire/peek.rs"]
mod peek;
#[path = "wire/peers.rs"]
mod peers;
