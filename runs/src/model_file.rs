//! MODEL.toml, as `muprime diagnose --save-model` writes it.

use crate::setup::Setup;
use effects::corrected::{Corrected, SavedModel};
use models::prediction::FrictionModel;
use std::sync::Arc;

/// The model of a file, made ready for the loop.
///
/// # Errors
/// A file that cannot be used, with the place or the reason.
pub fn load(name: &str, text: &str) -> miette::Result<Arc<dyn FrictionModel>> {
    Ok(Arc::new(compiled(name, text)?))
}

/// The same for a run of this setup: everything that the model's laws need must be known in every cycle.
///
/// # Errors
/// As [`load`]; a law that needs what the setup does not state.
pub fn load_for(setup: &Setup, name: &str, text: &str) -> miette::Result<Arc<dyn FrictionModel>> {
    let model = compiled(name, text)?;
    if let Some(lack) = model.lacks(&setup.ambient()) {
        miette::bail!(
            help = format!("state `{}` in the setup, as read at the bench", lack.covariate.name),
            "{name}: {lack}; the setup {} states none, and without it the law would do nothing",
            setup.origin
        );
    }
    Ok(Arc::new(model))
}

fn compiled(name: &str, text: &str) -> miette::Result<Corrected> {
    let saved: SavedModel = crate::input::parse_toml(name, text).map_err(|why| {
        miette::Report::new(why).wrap_err(format!(
            "{name} is no model file; 'muprime diagnose DATA --save-model FILE' writes one"
        ))
    })?;
    Corrected::compile(&saved).map_err(|e| miette::miette!("{name}: {e}"))
}
