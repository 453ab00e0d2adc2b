//! The drivers against emulators and misbehaving servers, over real sockets.

#[path = "wire/bench.rs"]
mod bench;
#[path = "wire/lines.rs"]
mod lines;
#[path = "wire/modbus_tcp.rs"]
mod modbus_tcp;
#[path = "wire/peers.rs"]
mod peers;
