//! The drivers against emulators and misbehaving servers, over real sockets.

#[path = "wire/ati_digital.rs"]
mod ati_digital;
#[path = "wire/bench.rs"]
mod bench;
#[path = "wire/doctor.rs"]
mod doctor;
#[path = "wire/documents.rs"]
mod documents;
#[path = "wire/instruments.rs"]
mod instruments;
#[path = "wire/line_peers.rs"]
mod line_peers;
#[path = "wire/lines.rs"]
mod lines;
#[path = "wire/main_job.rs"]
mod main_job;
#[path = "wire/modbus_tcp.rs"]
mod modbus_tcp;
#[path = "wire/own_profiles.rs"]
mod own_profiles;
#[path = "wire/peers.rs"]
mod peers;
