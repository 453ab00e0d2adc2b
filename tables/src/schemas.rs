//! Words for everything that people write: schemas, commented beginnings, and what is bundled.

pub mod bundled;
pub mod init;
pub mod schema;
