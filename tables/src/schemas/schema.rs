//! A JSON Schema for every kind of file, from the types that read it.

use crate::import::targets::{ColumnKind as Cell, TARGETS};
use clap::ValueEnum;
use models::covariate;
use schemars::generate::SchemaSettings;
use serde_json::{Map, Value, json};

/// A kind of file or document.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Kind {
    /// A plan of passes (TOML), for `muprime run PLAN`
    Plan,
    /// A campaign (TOML): one plan with several tips, conditions and days, for `muprime run CAMPAIGN`
    Campaign,
    /// A rig (TOML), for `--setup`; the defaults and hard ranges of its limits are in setup.md as well
    Setup,
    /// A fingertip (TOML), for `[finger] tip` of a setup
    Fingertip,
    /// `rig.toml` beside a point table, for `muprime diagnose`
    Rig,
    /// A row of a point table (CSV or Parquet), for `muprime diagnose`
    Table,
    /// What `muprime calibrate` writes (TOML) and a setup names under `certificates`
    Certificate,
    /// MODEL.toml, what `muprime diagnose --save-model` writes and `muprime run --model` reads
    Model,
    /// An instrument's description (TOML), for `profile` of an instrument in a setup
    Profile,
    /// What `muprime diagnose --json` prints (JSON)
    Verdict,
}

impl Kind {
    /// Every kind.
    pub fn all() -> impl Iterator<Item = Kind> {
        Kind::value_variants().iter().copied()
    }

    /// Its name on the command line.
    pub fn name(self) -> String {
        typed(self)
    }

    /// What it is and where it is used.
    pub fn words(self) -> String {
        let help = self.to_possible_value().and_then(|value| value.get_help().map(ToString::to_string));
        help.unwrap_or_default()
    }

    /// The schema, JSON Schema 2020-12.
    pub fn schema(self) -> Value {
        let reads = || SchemaSettings::draft2020_12().into_generator();
        let schema = match self {
            Kind::Plan => reads().into_root_schema_for::<runs::plan::PlanFile>(),
            Kind::Campaign => reads().into_root_schema_for::<runs::campaign::CampaignFile>(),
            Kind::Setup => reads().into_root_schema_for::<runs::setup::SetupFile>(),
            Kind::Fingertip => reads().into_root_schema_for::<runs::fingertip::FingertipFile>(),
            Kind::Rig => reads().into_root_schema_for::<models::rig_file::RigFile>(),
            Kind::Table => return table(),
            Kind::Certificate => reads().into_root_schema_for::<calibration::certificate::Certificate>(),
            Kind::Model => reads().into_root_schema_for::<effects::corrected::SavedModel>(),
            Kind::Profile => instruments::schema::json_schema(),
            Kind::Verdict => {
                let writes = SchemaSettings::draft2020_12().for_serialize();
                writes.into_generator().into_root_schema_for::<diagnosis::report::document::Document<'_>>()
            }
        };
        schema.to_value()
    }

    /// The schema for editors: a quantity may also be a text with its unit, as the readers of these files
    /// take it.
    pub fn for_editors(self) -> Value {
        let mut schema = self.schema();
        if matches!(self, Kind::Plan | Kind::Campaign | Kind::Setup | Kind::Fingertip | Kind::Rig) {
            admit_units(&mut schema, "");
        }
        schema
    }
}

/// A choice of the command line, as it is typed.
pub fn typed(choice: impl clap::ValueEnum) -> String {
    choice.to_possible_value().map(|value| value.get_name().to_owned()).unwrap_or_default()
}

/// Lets each number below the key of a quantity (`speed_m_s`) be a text with a unit as well: `"20mm/s"`.
fn admit_units(schema: &mut Value, unit: &str) {
    let numeric =
        schema["type"] == "number" || schema["type"].as_array().is_some_and(|t| t.contains(&json!("number")));
    match schema {
        Value::Object(number) if numeric && !unit.is_empty() => {
            let description = number.remove("description");
            let text = json!({ "type": "string", "pattern": "^[-+]?[0-9.]+([eE][-+]?[0-9]+)? *[A-Za-z%\u{b5}\u{b0}].*$" });
            let mut both = json!({ "anyOf": [Value::Object(std::mem::take(number)), text] });
            both["description"] =
                description.unwrap_or_else(|| json!(format!("In {unit}, or a text with a unit.")));
            *schema = both;
        }
        Value::Object(object) => {
            for (key, below) in object {
                match (key.as_str(), below) {
                    ("properties", Value::Object(all)) => {
                        all.iter_mut().for_each(|(name, of)| admit_units(of, runs::input::unit_of(name)));
                    }
                    (_, below) => admit_units(below, unit),
                }
            }
        }
        Value::Array(all) => all.iter_mut().for_each(|of| admit_units(of, unit)),
        _ => {}
    }
}

/// The row of a point table: its columns by the targets of the import, which have words for all of them, with
/// the ranges of the covariates.
fn table() -> Value {
    let mut properties = Map::new();
    for target in TARGETS {
        let covariate = covariate::by_name(target.column);
        if properties.contains_key(target.column) {
            continue;
        }
        let kind = match target.kind {
            Cell::Text => "string",
            Cell::Count | Cell::Way => "integer",
            Cell::Number(_) => "number",
        };
        let unit = target.dimension().map_or(String::new(), |dimension| format!(", in {}", dimension.si()));
        let needed = covariate.map_or(String::new(), |c| format!(": {}", c.needed));
        let mut property = json!({ "type": kind, "description": format!("{}{unit}{needed}.", target.words) });
        if let Some(c) = covariate {
            property["minimum"] = json!(c.range[0]);
            property["maximum"] = json!(c.range[1]);
        }
        properties.insert(target.column.into(), property);
    }
    let may_lack = ["position_m", "frequency_hz"];
    let required = covariate::REQUIRED.iter().map(|c| c.name).filter(|c| !may_lack.contains(c));
    let required: Vec<&str> = std::iter::once("point").chain(required).collect();
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "PointTable",
        "description": "One row a steady pass. A table of one place leaves position_m out, a plate that stands still frequency_hz; further columns are ignored.",
        "type": "object",
        "properties": properties,
        "required": required,
    })
}

#[cfg(test)]
mod tests {
    use super::Kind;

    #[test]
    fn editors_are_offered_texts_with_units_where_the_readers_take_them() {
        let plan = Kind::Plan.for_editors();
        let text = |of: &serde_json::Value| of["anyOf"][1]["type"].clone();
        assert_eq!(text(&plan["$defs"]["Base"]["properties"]["speed_m_s"]), "string", "{plan:#}");
        assert_eq!(
            text(&plan["$defs"]["Series"]["properties"]["frequency_hz"]["items"]),
            "string",
            "{plan:#}"
        );
        assert_eq!(plan["properties"]["seed"], Kind::Plan.schema()["properties"]["seed"]);
        assert_eq!(Kind::Verdict.for_editors(), Kind::Verdict.schema());
    }
}
