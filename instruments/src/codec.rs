//! Frames of the wires: one file a protocol. Pure bytes, no port.
//!
//! | room | purpose |
//! |---|---|
//! | [`modbus_rtu`] | Modbus RTU: requests, answers, both directions |
//! | [`stream`] | sensor streams without a request: sync bytes, length, checksum, resynchronisation |
//! | [`checksum`] | the checks that frames end with |

pub mod checksum;
pub mod modbus_rtu;
pub mod stream;
