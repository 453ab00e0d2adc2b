//! A law of friction from its file to the loop: MODEL.toml, as `muprime diagnose --save-model` writes it, a
//! law table, a ridge table or the surrogate of `muprime model adapt`. The text says which it is.

use crate::setup::Setup;
use calibration::certificate::sha256_hex;
use effects::corrected::{Corrected, SavedModel};
use models::law::{BuiltIn, Named};
use models::law_table::{ANSWERS, LawTable};
use models::sparse::Sparse;
use models::surrogate::{DEFAULT_TABLE, Surrogate};
use models::{Finger, FrictionModel};
use std::path::Path;
use std::sync::Arc;

/// What begins the comment of a law table that states the hash of what follows.
pub const HASH_MARK: &str = "# sha256 ";

/// A built-in law for a finger; `None`: no law has that name.
///
/// # Errors
/// A finger outside the domain of the law.
pub fn built_in(name: &str, finger: &Finger) -> Option<miette::Result<Arc<dyn FrictionModel>>> {
    let law = BuiltIn::by_name(name)?;
    Some(law.law(finger).map_err(|e| miette::miette!("{name}: {e}")).map(|built| match law {
        BuiltIn::Surrogate => named(built, name, DEFAULT_TABLE),
        _ => built,
    }))
}

fn named(law: Arc<dyn FrictionModel>, name: &str, hashed: &str) -> Arc<dyn FrictionModel> {
    Arc::new(Named { law, name: name.to_string(), sha256: sha256_hex(hashed.as_bytes()) })
}

/// The model of a file for a finger of the paper, made ready for the loop.
///
/// # Errors
/// A file that cannot be used, with the place or the reason.
pub fn load(name: &str, text: &str) -> miette::Result<Arc<dyn FrictionModel>> {
    law(&Finger::paper(), name, text)
}

/// The same for a run of this setup: everything that the model's laws need must be known in every cycle.
///
/// # Errors
/// As [`load`]; a law that needs what the setup does not state.
pub fn load_for(setup: &Setup, name: &str, text: &str) -> miette::Result<Arc<dyn FrictionModel>> {
    let finger = &setup.tip.finger;
    if !is_corrected(text) {
        return law(finger, name, text);
    }
    let model = compiled(finger, name, text)?;
    if let Some(lack) = model.lacks(&setup.file.stated_air()) {
        miette::bail!(
            help = format!("state `{}` in the setup, as read at the bench", lack.covariate.name),
            "{name}: {lack}; the setup {} states none, and without it the law would do nothing",
            setup.origin
        );
    }
    Ok(Arc::new(model))
}

/// The law of a file for a finger, with the errors of [`load`]. Its name is that of the file.
pub fn law(finger: &Finger, name: &str, text: &str) -> miette::Result<Arc<dyn FrictionModel>> {
    let text = text.trim_start_matches('\u{feff}');
    let stem = Path::new(name).file_stem().map_or(name.into(), |s| s.to_string_lossy());
    let refused = |why: String| miette::miette!("{name}: {why}");
    if text.starts_with("muprime ridge table") {
        let table = Surrogate::from_text(text).map_err(|e| refused(e.to_string()))?;
        Ok(named(Arc::new(table.for_finger(finger)), &stem, text))
    } else if text.trim_start().starts_with('{') {
        Ok(named(Arc::new(Sparse::from_json(text, finger).map_err(refused)?), &stem, text))
    } else if is_corrected(text) {
        Ok(Arc::new(compiled(finger, name, text)?))
    } else {
        let table = LawTable::from_csv(text).map_err(|e| refused(e.to_string()))?;
        let rows = hashed(text);
        if let Some(stated) = text.lines().find_map(|line| line.strip_prefix(HASH_MARK))
            && stated.trim() != sha256_hex(rows.as_bytes())
        {
            miette::bail!(
                help = "tabulate it again; or remove its comment lines, and it is a table of your own",
                "{name}: the table was changed after it was tabulated: its hash is another than its header states"
            );
        }
        Ok(named(Arc::new(table), &stem, &rows))
    }
}

/// What the hash of a law table is of: its lines without comments.
pub fn hashed(table: &str) -> String {
    let rows = table.trim_start_matches('\u{feff}').lines().filter(|line| !line.starts_with('#'));
    rows.flat_map(|line| [line, "\n"]).collect()
}

/// Whether a text is none of a law table, a ridge table and a surrogate: then it is to be a MODEL.toml.
pub(crate) fn is_corrected(text: &str) -> bool {
    let text = text.trim_start_matches('\u{feff}');
    let rows = hashed(text);
    let head = rows.lines().find(|line| !line.trim().is_empty()).unwrap_or_default();
    let cells = head.trim().contains([',', ';', '\t']) && !head.contains('=');
    let table = cells && !head.starts_with('[') || head.trim() == ANSWERS[0].0;
    !table && !text.starts_with("muprime ridge table") && !text.trim_start().starts_with('{')
}

fn compiled(finger: &Finger, name: &str, text: &str) -> miette::Result<Corrected> {
    let saved: SavedModel = crate::input::parse_toml(name, text).map_err(|why| {
        miette::Report::new(why).wrap_err(format!(
            "{name} is not a model file; 'muprime diagnose DATA --save-model FILE' writes one"
        ))
    })?;
    let base = match saved.law.as_ref().map(|l| (&l.name, &l.table)) {
        None => None,
        Some((base, Some(table))) => Some(law(finger, base, table)?),
        Some((base, None)) => Some(built_in(base, finger).unwrap_or_else(|| {
            Err(miette::miette!(
                "{name}: the base law '{base}' is none that is built in, and its table is missing"
            ))
        })?),
    };
    Corrected::compile_on(&saved, base).map_err(|e| miette::miette!("{name}: {e}"))
}

#[cfg(test)]
mod tests {
    use super::{HASH_MARK, load};

    fn refusal(text: &str) -> String {
        load("law.csv", text).err().map(|why| why.to_string()).unwrap_or_default()
    }

    /// It was refused as a TOML file.
    #[test]
    fn a_law_table_with_semicolons_is_refused_as_one() {
        let why = refusal("# mine\namplitude_pp_m;mu_relative\n0;1\n2e-6;0,3\n");
        assert!(
            why.contains("line 2") && why.contains("semicolons") && why.contains("decimal comma"),
            "{why}"
        );
    }

    /// The mark of a hash on the first line was not seen behind a byte-order mark.
    #[test]
    fn a_byte_order_mark_hides_no_hash() {
        let table = format!("{HASH_MARK}00\namplitude_pp_m,mu_relative\n0,1\n2e-6,0.3\n");
        for text in [table.clone(), format!("\u{feff}{table}")] {
            assert!(refusal(&text).contains("was changed after it was tabulated"));
        }
        assert!(!super::is_corrected("\u{feff}{}") && !super::is_corrected("\u{feff}muprime ridge table"));
        load("table.txt", &format!("\u{feff}{}", models::surrogate::DEFAULT_TABLE)).map(drop).unwrap();
    }
}
