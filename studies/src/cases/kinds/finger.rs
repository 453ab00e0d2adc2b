//! The identification of one finger from its phases a case: a population of fingers.

use super::{Case, CaseKind, line, number, text};
use crate::cases::file::Header;
use calibration::certificate::sha256_hex;
use calibration::phase::table::read_phases;
use miette::Context;
use runs::input::{MAX_TABLE_BYTES, bytes_of};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use tables::calibrate::inverse::{self, Options};

/// The kind.
pub const KIND: CaseKind = CaseKind {
    name: "finger",
    words: "the skin of one finger from its phase table, as `muprime calibrate finger` finds it",
    model: models::ridge::study::MODEL_VERSION,
    columns: &[
        number("young_modulus_pa", "modulus of the stratum corneum, elastic skin"),
        number("young_modulus_low_pa", "lower end of its 95 % interval"),
        number("young_modulus_high_pa", "upper end"),
        number("residual_rms_deg", "root mean square of the residuals"),
        text("document", "elastic skin, and with penalty and retardation time free, as JSON"),
    ],
    prepare,
};

/// A line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Line {
    /// Phase table; relative paths are to the file of cases.
    pub phases: PathBuf,
    /// Frequency of a table without that column, Hz.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frequency_hz: Option<f64>,
    /// Normal force of a table without that column, N.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normal_force_n: Option<f64>,
}

/// What all cases share.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FingerSettings {
    /// Elements of the mesh, about.
    pub elements: usize,
    /// Identify the modulus alone.
    pub modulus_only: bool,
    /// Moduli searched, Pa.
    pub modulus_range_pa: [f64; 2],
}

impl Default for FingerSettings {
    fn default() -> Self {
        let elements = models::ridge::case::ELEMENTS;
        FingerSettings { elements, modulus_only: false, modulus_range_pa: [10e6, 1e9] }
    }
}

fn prepare(header: &Header, folder: &Path) -> miette::Result<super::Make> {
    let settings: FingerSettings = super::settings(header)?;
    let rest = serde_json::to_string(&settings).unwrap_or_default();
    let FingerSettings { elements, modulus_only, modulus_range_pa } = settings;
    let folder = folder.to_path_buf();
    Ok(Box::new(move |index, given| {
        let Line { phases, frequency_hz, normal_force_n } = line(index, given)?;
        let path = folder.join(phases);
        let bytes = bytes_of(&path, MAX_TABLE_BYTES).wrap_err_with(|| format!("case {index}"))?;
        let inputs = format!("{} {frequency_hz:?} {normal_force_n:?} {rest}", sha256_hex(&bytes));
        let (modulus_range_pa, shown) = (modulus_range_pa.into(), false);
        let options =
            Options { frequency_hz, normal_force_n, modulus_range_pa, elements, modulus_only, shown };
        let run = move || {
            let points = read_phases(bytes.as_slice()).map_err(|e| e.to_string())?;
            let (elastic, skin) = inverse::analyse(&options, &points).map_err(|why| why.to_string())?;
            let document = serde_json::json!({ "elastic": elastic, "all_free": skin });
            Ok(vec![
                elastic.young_modulus_pa.into(),
                elastic.ci95_pa[0].into(),
                elastic.ci95_pa[1].into(),
                elastic.residual_deg[0].into(),
                document.to_string().into(),
            ])
        };
        Ok(Case { inputs, run: Box::new(run) })
    }))
}
