//! From a table and the rig.toml beside it to a verdict, its page, and the files in a run's folder.
//! `Subject::diagnose` adds the remarks that only the table and its run give: record, empty cells, law.

use crate::import::{never_lifts, points, remarks_of};
use crate::law::Loaded;
use crate::passes::parse_passes;
use calibration::certificate::sha256_hex;
use diagnosis::base_law::{BaseLaw, CannotTell};
use diagnosis::data::{DataError, Table};
use diagnosis::{Diagnosis, Options, diagnose};
use miette::{IntoDiagnostic, WrapErr};
use models::{BuiltIn, Pass, RigFile};
use runs::edges::add_record;
use runs::input::{MAX_TABLE_BYTES, bytes_of, rig_file};
use runs::report::diagnosis::page;
use runs::run_data::about;
use runs::run_dir::{damage_in, is_held, record_facts};
use runs::verdict_text::files;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The point table of `data`, a table or a run's folder, and the rig.toml: `rig`, or the one beside it.
pub fn inputs(data: &Path, rig: Option<PathBuf>) -> (PathBuf, PathBuf) {
    let (table, folder) = match data.is_dir() {
        true => (data.join("points.csv"), data),
        false => (data.to_path_buf(), data.parent().unwrap_or(Path::new("."))),
    };
    (table, rig.unwrap_or_else(|| folder.join("rig.toml")))
}

/// A table and what is known of its rig: the subject of a verdict.
pub struct Subject {
    /// All passes that were read.
    pub passes: Vec<Pass>,
    /// Those that are diagnosed.
    pub table: Table,
    /// What the rig's calibration states.
    pub rig: RigFile,
    law: Option<Arc<BaseLaw>>,
    sha256: String,
}

/// The refusal of passes that cannot be diagnosed, with a remedy of its own where a new table would not help.
pub fn unfit(why: DataError) -> miette::Report {
    let help = "a plan with more settings or replicates gives more passes; `muprime run` with the same --out \
                continues a run";
    match why {
        DataError::TooFew(_) => miette::miette!(help = help, "{why}"),
        why => miette::Report::msg(why),
    }
}

impl Subject {
    /// The passes of a table; `bytes` are those of its file.
    ///
    /// # Errors
    /// Passes that cannot be diagnosed: [`Table::measured`].
    pub fn of(passes: Vec<Pass>, bytes: &[u8], rig: RigFile) -> Result<Self, DataError> {
        let (table, sha256) = (Table::measured(&passes)?, sha256_hex(bytes));
        Ok(Subject { passes, table, rig, law: None, sha256 })
    }

    /// The same on a base law in place of the spring-slider.
    ///
    /// # Errors
    /// A law that can tell at too few passes: [`BaseLaw::on`].
    pub fn on(self, base: Loaded) -> Result<Self, CannotTell> {
        let (law, table) = BaseLaw::on(base.model, base.file.map(|(_, text)| text), &self.table)?;
        Ok(Subject { law: Some(Arc::new(law)), table, ..self })
    }

    /// The verdict, with what the record in the folder `run` says of time.
    ///
    /// # Errors
    /// A record that cannot be opened.
    pub fn diagnose(&self, options: Options, run: Option<&Path>) -> miette::Result<Diagnosis> {
        let options = Options { law: self.law.clone(), ..options };
        let mut result = diagnose(&self.table, &self.rig, &options, self.sha256.clone());
        run.map_or(Ok(()), |run| add_record(&mut result, run, &self.rig))?;
        result.report.remarks.extend(run.filter(|_| self.law.is_none()).and_then(another_law));
        let lack = points(&self.passes, |p| p.lateral_force_n.is_none());
        let unused = |(count, points)| {
            let all = self.passes.len();
            format!("Not used, because lateral_force_n is empty: point {points} ({count} of {all} passes).")
        };
        result.report.remarks.extend(lack.map(unused));
        result.report.remarks.extend(remarks_of(&self.passes));
        result.report.remarks.extend(never_lifts(&self.passes, &self.rig.finger));
        Ok(result)
    }

    /// The page of a verdict on a run's folder.
    ///
    /// # Errors
    /// Those of the drawing library.
    pub fn page_of_run(&self, result: &Diagnosis, run: &Path) -> miette::Result<String> {
        let facts = record_facts(run).unwrap_or_default();
        page(result, &self.table, &about::of_run(run, &facts, Some(&self.rig)))
    }

    /// The page of a verdict on a table; with the names of table and rig.toml.
    ///
    /// # Errors
    /// Those of the drawing library.
    pub fn page_of_table(&self, result: &Diagnosis, table: &str, rig: &str) -> miette::Result<String> {
        let named = vec![("table", table.to_string()), ("rig", rig.to_string())];
        page(result, &self.table, &[named, about::of_rig(&self.rig)].concat())
    }
}

/// A word on a run that was compared with another law than the verdict's, the spring-slider.
fn another_law(run: &Path) -> Option<String> {
    let facts = record_facts(run).ok()?;
    let law = facts.get("model").filter(|law| *law != BuiltIn::SpringSlider.name())?;
    Some(format!("This verdict is of the spring-slider; the run was compared with '{law}' (--model)."))
}

/// Diagnoses a run that is over and writes what comes of it into its folder.
///
/// # Errors
/// A run that goes on, a folder without one, a table that cannot be diagnosed.
pub fn diagnose_run(run: &Path) -> miette::Result<()> {
    if is_held(run) {
        miette::bail!("{}: the run goes on; diagnose it when it is over", run.display());
    }
    let (path, rig) = inputs(run, None);
    let bytes = bytes_of(&path, MAX_TABLE_BYTES)?;
    let passes = parse_passes(&path, &bytes)?;
    let subject = Subject::of(passes, &bytes, rig_file(&rig)?);
    let subject = subject.into_diagnostic().wrap_err_with(|| path.display().to_string())?;
    let result = subject.diagnose(Options::default(), Some(run))?;
    files::write(run, &result, &subject.rig, &subject.page_of_run(&result, run)?, &damage_in(run)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use models::{Condition, Direction};

    /// A pass without a force, and a unit that has slipped, are remarked on with the verdict, not by `check` alone.
    #[test]
    fn what_is_wrong_with_a_table_is_remarked_on_with_its_verdict() {
        let pass = |k: u64| {
            let direction = if k.is_multiple_of(2) { Direction::Forward } else { Direction::Backward };
            let force = direction.sign() * (0.1 + 0.001 * (k % 7) as f64);
            let at = Condition { speed_m_s: 20.0, direction, time_s: k as f64, ..Condition::paper() };
            Pass::at(k, &at, (k != 7).then_some(force))
        };
        let rig = "[finger]\nnormal_stiffness_n_per_m = 3.9e6\nlateral_stiffness_n_per_m = 1.5e6\n\
                   stiffness_relative_sd = 0.05\npoisson_ratio = 0.33\n\
                   [noise]\npass_relative_sd = 0.02\nforce_sd_n = 0.001\n";
        let mut passes: Vec<Pass> = (0..24).map(pass).collect();
        let subject = Subject::of(passes.clone(), b"", RigFile::parse(rig).unwrap()).unwrap();
        let options = Options { pairs: false, ..Options::default() };
        let remarks = subject.diagnose(options.clone(), None).unwrap().report.remarks.join("\n");
        assert!(remarks.contains("lateral_force_n is empty: point 7 (1 of 24 passes)"), "{remarks}");
        assert!(remarks.contains("speed_m_s: 20000 mm/s is a thousand times too large"), "{remarks}");
        assert!(!remarks.contains("loses contact"), "{remarks}");
        for pass in &mut passes {
            (pass.speed_m_s, pass.normal_force_n) = (0.02, 1000.0 * pass.normal_force_n);
            pass.lateral_force_n = pass.lateral_force_n.map(|force| 1000.0 * force);
        }
        let subject = Subject::of(passes, b"", RigFile::parse(rig).unwrap()).unwrap();
        let remarks = subject.diagnose(options, None).unwrap().report.remarks.join("\n");
        assert!(remarks.contains("no vibration loses contact") && remarks.contains("mN"), "{remarks}");
    }
}
