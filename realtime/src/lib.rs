//! What happens while the rig runs: the cyclic loop and everything it may touch.
//!
//! | room | purpose |
//! |---|---|
//! | [`ports`] | the seams `ForceSensor`, `Amplifier`, `Stage`; `Reading`, and `NoData` with its reason |
//! | [`safety`] | the only maker of a [`safety::DriveCommand`] |

pub mod ports;
pub mod safety;
