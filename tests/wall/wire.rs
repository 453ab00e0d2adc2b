//! The drivers and the doctor against emulators and misbehaving servers, over real sockets, in wall-clock time.

#[path = "wire/doctor.rs"]
mod doctor;
#[path = "wire/main_job.rs"]
mod main_job;
#[path = "wire/modbus_tcp.rs"]
mod modbus_tcp;
