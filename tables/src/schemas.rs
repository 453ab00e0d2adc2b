//! Words for everything that people write: schemas, a reference of all keys, commented beginnings, and what is bundled.

pub mod bundled;
pub mod init;
pub mod reference;
pub mod schema;
