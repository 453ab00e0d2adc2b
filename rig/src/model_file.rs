//! MODEL.toml, as `muprime diagnose --save-model` writes it.

use effects::corrected::{Corrected, SavedModel};
use models::prediction::FrictionModel;
use std::sync::Arc;

/// The model of a file, made ready for the loop.
///
/// # Errors
/// A file that cannot be used, with the place or the reason.
pub fn load(name: &str, text: &str) -> miette::Result<Arc<dyn FrictionModel>> {
    let saved: SavedModel = crate::input::parse_toml(name, text)?;
    let model = Corrected::compile(&saved).map_err(|e| miette::miette!("{name}: {e}"))?;
    Ok(Arc::new(model))
}
