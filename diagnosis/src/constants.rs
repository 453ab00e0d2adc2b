//! Every tunable constant of the diagnosis: name, value, meaning and source.
//!
//! A diagnosis takes its constants from [`Constants`]; the defaults are those of every verdict. A study may set one apart
//! ([`Constants::set`], `muprime blind --constant NAME=VALUE`) or scale it ([`Constants::scale`], for
//! docs/diagnosis/sensitivity.md). The table of docs/diagnosis/constants.md is [`markdown`], held equal by a test.
//!
//! Sources: a reference; `contract`: docs/contract.md; `numerical`: an accuracy or effort; `development`: set on
//! development sets, with what they showed; `judgement`: no measurement, the sensitivity table is all there is.

mod value;

pub use value::Value;

/// The stage of a diagnosis at which a constant enters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EntersAt {
    /// The fits and evidences of all hypotheses, and all that follows.
    Fit,
    /// The verdict rule, from finished fits.
    Decision,
    /// What is reported beside the verdict.
    Report,
}

/// One constant as the table shows it.
#[derive(Debug, Clone, PartialEq)]
pub struct ConstantRow {
    /// Name.
    pub name: &'static str,
    /// Stage at which it enters.
    pub stage: EntersAt,
    /// Value or values.
    pub values: Vec<f64>,
    /// Meaning, with its unit.
    pub meaning: &'static str,
    /// Where it comes from.
    pub source: &'static str,
}

/// A constant that a study asks for and that is none, or a value that it cannot have.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of an error says what its fields are")]
pub enum ConstantError {
    /// No such name.
    #[error("no constant is named '{0}'; docs/diagnosis/constants.md lists them")]
    Name(String),
    /// Not as many numbers as the constant has, or text that is none.
    #[error("constant '{name}' takes {needed} number(s), separated by commas")]
    Value { name: String, needed: usize },
}

macro_rules! constants {
    ($($stage:ident { $($name:ident: $kind:ty = $value:expr, $meaning:literal, $source:expr;)* })*) => {
        /// The constants; [`rows`](Constants::rows) says what each means.
        #[derive(Debug, Clone, PartialEq)]
        pub struct Constants {
            $($(#[doc = $meaning] pub $name: $kind,)*)*
        }

        impl Default for Constants {
            fn default() -> Self {
                Constants { $($($name: $value,)*)* }
            }
        }

        impl Constants {
            /// Every constant with its present value.
            pub fn rows(&self) -> Vec<ConstantRow> {
                vec![$($(ConstantRow {
                    name: stringify!($name),
                    stage: EntersAt::$stage,
                    values: self.$name.numbers(),
                    meaning: $meaning,
                    source: $source,
                },)*)*]
            }

            /// Whether there is such a constant that can have these numbers; it then has them.
            fn replace(&mut self, name: &str, numbers: &mut dyn Iterator<Item = f64>) -> bool {
                match name {
                    $($(stringify!($name) => {
                        Value::from_numbers(numbers).map(|value| self.$name = value).is_some()
                    })*)*
                    _ => false,
                }
            }
        }
    };
}

/// A covariate that a kernel does not see.
const FAR: f64 = f64::INFINITY;
/// Sources that several constants share.
const JUDGEMENT: &str = "judgement: chosen without a measurement";
const NUMERICAL: &str = "numerical: effort of a search";
const CONTRACT: &str = "contract";
const LEADERS: &str = "development: 184 leading single causes of two generators, 166 of them true (logistic \
    regression, rounded); 101 pairs";

constants! {
    Fit {
    prior_no_gap: f64 = 0.5, "Prior probability of no gap.", "a gap is as likely as none (indifference)";
    prior_single: f64 = 0.36, "Prior probability of one cause of the library, shared evenly by the testable ones.", JUDGEMENT;
    prior_pair: f64 = 0.07, "Prior probability of two causes, shared evenly by their pairs.", JUDGEMENT;
    prior_open_set: f64 = 0.07, "Prior probability of the open set.", JUDGEMENT;
    structure_share: f64 = 0.5, "Share of the open set's weight for departures that are sudden, periodic or local.", JUDGEMENT;
    structure_asked_nats: f64 = 10.0, "Nats behind the best hypothesis up to which the structure of no gap is searched.", NUMERICAL;
    unlisted_share: f64 = 0.1, "Share of the open set's smooth part for causes of known form that the library does not name.", JUDGEMENT;
    lapse_probability: f64 = 0.02, "Probability that a certificate no longer holds when a table is taken.", "judgement: one certificate in fifty is outdated by a knock or a change";
    mu0_log_sd: [f64; 2] = [0.3, 0.8], "Prior deviation of ln mu0, with passes at w = 0 and without.", "judgement: wide against the 1 % to which such passes give mu0";
    stiffness_sd_floor: f64 = 1e-3, "Least prior deviation of ln stiffness, whatever rig.toml states.", "numerical: keeps the prior proper";

    stated_freedom: f64 = 40.0, "Degrees of freedom that the repeatability stated in rig.toml counts for.", "judgement: a statement is worth some forty replicates (scaled inverse chi2 prior, Gelman et al. 2013, sec. 2.6)";
    variance_factor_bounds: [f64; 2] = [0.8, 3.0], "Bounds of the factor that replicates put on the stated variance.", JUDGEMENT;
    scatter_log_sd: f64 = 0.3, "Prior deviation of the logarithm of true over stated scatter.", "judgement: laboratories state their repeatability within a third or so";
    scatter_scales: [f64; 13] = [0.6, 0.7, 0.8, 0.9, 1.0, 1.12, 1.25, 1.4, 1.6, 1.8, 2.1, 2.5, 3.0], "True over stated scatter: values that are tried.", NUMERICAL;
    statement_nats: f64 = 3.0, "Nats by which the scatter about the baseline must speak against the statement of repeatability for half of it to be believed.", "development: a gain of the amplitude that recalibration half takes up gave 1.7";
    structure_nats: f64 = 3.0, "Nats by which a surface must beat the baseline alone, each with the scatter that suits it, before a large scatter counts as structure and the statement stands.", JUDGEMENT;
    clustered_p: f64 = 0.02, "Family-wise p-value of clusters of what the baseline leaves at which a large scatter counts as half structure.", JUDGEMENT;
    run_sds: [f64; 10] = [0.0, 0.004, 0.008, 0.015, 0.025, 0.04, 0.06, 0.09, 0.14, 0.22], "Relative deviations of the level from run to run that are tried.", NUMERICAL;
    run_sd_prior: f64 = 0.1, "Deviation of the half-normal prior of that.", "judgement: repeated tests on one pair shifted by 4 to 17 %";
    run_nats: f64 = 1.0, "Nats that a shift between runs must gain.", JUDGEMENT;
    outside_prior: [f64; 2] = [1.0, 50.0], "Share of passes that do not belong: as if so many had been seen, of so many (beta prior).", "judgement: one pass in fifty";
    outside_width: f64 = 5.0, "Half-width of the Cauchy density of such passes, in deviations of a pass.", "judgement: a pass at 3.5 deviations, Iglewicz & Hoaglin's (1993) limit, is then even at that share";
    suspect_probability: f64 = 0.5, "Probability of not belonging from which a pass is called suspect.", "the likelier of two";
    most_suspects: f64 = 0.2, "Share of suspect passes above which they are a departure.", JUDGEMENT;
    together_level: f64 = 0.01, "Family-wise level at which suspect passes lie together, which makes them a departure.", "one in a hundred";
    cause_holds_spread: f64 = 1.3, "Median size of the residuals about a leading cause over 0.6745, in deviations, up to which it holds and passes that deviate from it are bad.", JUDGEMENT;
    explained_sd: f64 = 3.0, "Deviations within which a cause explains a suspect pass, which then belongs.", "three standard deviations";
    serial_probability: f64 = 0.7, "Probability from which scatter is taken to last from pass to pass.", JUDGEMENT;
    serial_modes: usize = 16, "Cosines of its slow part.", "numerical: a drift over the table has less than eight turns";
    slow_sizes: [f64; 8] = [0.0, 0.5, 0.8, 1.3, 2.0, 3.0, 5.0, 8.0], "Scatter that lasts beyond the statement, over the independent one: values that are tried.", NUMERICAL;
    slow_correlations: [f64; 4] = [0.6, 0.8, 0.9, 0.95], "Its correlation from pass to pass: values that are tried.", NUMERICAL;
    slow_within: f64 = 6.0, "Correlation times of it that a run must hold: what wanders for longer is a drift.", "judgement: a mean over a run then tells scatter from running in";
    slow_long_run: usize = 48, "Passes of a run from which it is tried.", JUDGEMENT;
    slow_nats: f64 = 3.0, "Nats that scatter that lasts must gain.", JUDGEMENT;
    slow_modes: usize = 80, "Cosines of its slow part, at most a third as many as passes.", "numerical: beyond them a correlation of 0.9 is nearly independent";

    form_shares: [f64; 3] = [0.05, 0.15, 0.35], "Standard deviation of a cause's departure from its form, as a share of its net change.", "development: true causes under another formula left 13 to 49 % of their gap";
    form_weights: [f64; 5] = [0.4, 0.4, 0.2, 0.4, 0.1], "Prior weights of those shares, and of what a cause acts on, and of its size, bent by `bend_share`.", JUDGEMENT;
    bend_share: f64 = 0.7, "Standard deviation by which what a cause acts on may depart from its law, as a share of its net change.", JUDGEMENT;
    bend_length: f64 = 1.0, "Correlation length of it over the covariates of the cause's mechanism, in standard deviations of each.", "development: with 0.6, 1 and 1.5 29, 30 and 30 of 49 causes named right, 2, 1 and 1 wrong";
    bend_place_length: f64 = 0.3, "The same over the place on the plate.", JUDGEMENT;
    form_length: f64 = 1.5, "Correlation length of the departure, in standard deviations of each covariate and of time.", JUDGEMENT;
    form_rank: usize = 40, "Most pivots of the departure's kernel.", "numerical: incomplete Cholesky (Fine & Scheinberg 2001)";
    kernel_rest: f64 = 0.02, "Share of variance that a kernel's pivots may leave at a pass.", "numerical: incomplete Cholesky";

    discrepancy_lengths: [f64; 6] = [1.2, 1.5, 2.5, 4.0, 2.5, 4.0], "Correlation lengths of the open set over conditions, in standard deviations of each covariate.", JUDGEMENT;
    discrepancy_time_lengths: [f64; 6] = [0.8, 1.5, 2.5, 4.0, 2.5, 4.0], "The same over time.", JUDGEMENT;
    discrepancy_position_lengths: [f64; 6] = [0.8, FAR, FAR, 0.3, FAR, FAR], "The same along the plate; infinite leaves the position out.", JUDGEMENT;
    discrepancy_climate_lengths: [f64; 6] = [FAR, FAR, FAR, FAR, 1.2, 0.7], "The same over temperature and humidity; tried only where these change by themselves.", JUDGEMENT;
    discrepancy_rank: usize = 56, "Most pivots of the open set's kernel.", "numerical: incomplete Cholesky";
    discrepancy_even: [f64; 6] = [0.0, 0.015, 0.05, 0.15, 0.45, 1.3], "Scales of the open set's part that turns with the direction, in units of friction.", "judgement: a factor of three from the noise to more than all friction";
    discrepancy_odd: [f64; 4] = [0.0, 0.012, 0.06, 0.4], "Scales of its part that does not turn with the direction.", "judgement: as above";
    discrepancy_white: [f64; 4] = [0.0, 0.02, 0.08, 0.3], "Scales of its white excess.", "judgement: as above";

    start_share: f64 = 0.15, "Share of the smooth gap below which starts of a search do not look.", NUMERICAL;
    driven_sd: f64 = 3.0, "Deviations of its prior beyond which a nuisance is taken to imitate a cause; searches then start at the calibration too.", NUMERICAL;
    prune_nats: f64 = 15.0, "Nats behind the best law from which a law keeps the middle form share only.", NUMERICAL;
    hopeless: [f64; 2] = [1.5, 60.0], "Factor on the best tempered cost, and offset in chi2, beyond which a law is not refined.", NUMERICAL;
    pairs_from_nats: f64 = 3.0, "Nats by which a hypothesis must beat no gap before pairs are tried, passes judged again or the table fitted again.", NUMERICAL;
    misfit_sd: f64 = 2.5, "Deviations of chi2 above its mean from which the best single cause is taken to leave something.", NUMERICAL;
    pair_seeds: usize = 6, "Single causes from which pairs are grown, and of which the size is tried as a function of the place and the weather.", NUMERICAL;
    pairs_fitted: usize = 20, "Pairs that are fitted in full.", NUMERICAL;
    pairs_searched: usize = 4, "Pairs that are sought again in each two laws.", NUMERICAL;
    laws_refined: usize = 16, "Laws of those pairs that are followed.", NUMERICAL;
    one_change_cosine: f64 = 0.98, "Cosine between two changes above which they are one.", JUDGEMENT;

    }
    Decision {
    region_cuts: [f64; 2] = [0.28, 0.72], "Quantiles that bound the lower and upper region of a covariate.", "judgement: a little more than a quarter each, so that two levels of four are not parted";
    region_least: usize = 6, "Fewest passes of a region.", JUDGEMENT;
    region_most: f64 = 0.6, "Largest share of the passes in the end of a covariate.", JUDGEMENT;
    region_most_level: f64 = 0.8, "Largest share of the passes at one frequency, or at low pressure.", JUDGEMENT;
    late_share: f64 = 0.25, "Share of the passes that the late region holds.", JUDGEMENT;
    low_pressure: f64 = 0.8, "Share of the largest pressure below which a pass is at low pressure.", JUDGEMENT;
    informed_share: f64 = 0.1, "Share of the gap, and of each cause's own change, that the rest must hold for a region to count in full.", JUDGEMENT;
    uninformed_weight: f64 = 0.5, "Weight of a region whose rest holds less.", JUDGEMENT;
    carrying_sd: f64 = 3.0, "Deviations of the floor's scatter from which a region carries gap.", "three standard deviations";
    region_allowance_sd: f64 = 2.0, "Deviations of its sampling error that a region's rest is granted before it counts as open.", "two standard deviations";
    pooled_allowance_sd: f64 = 3.0, "The same for the pool of regions, which overlap: each pass counts about four times.", JUDGEMENT;
    region_closed: f64 = 0.5, "Share of its gap from which a region counts as closed.", CONTRACT;
    closure: [f64; 2] = [0.77, 0.55], "Pooled closure at which a cause and a mimic are as likely: one cause that leads the open set by nothing, two causes.", LEADERS;
    closure_power: [f64; 2] = [3.0, 6.0], "Power of the share left open by which those odds fall: one cause, two.", LEADERS;
    closure_rest: f64 = 0.02, "Share left open that closing everything counts as.", JUDGEMENT;
    half_open_survival: f64 = 0.1, "Largest share of the probability that survives where fewer than half of the regions are closed.", "contract asks for half of the regions; the value is judgement";
    bent_law_takes: f64 = 0.4, "Share of the gap's chi2 that the law of a bent leader takes up alone; below it the probability falls in proportion.", "development: of 81 bent single causes that were named, four strangers took up 0.05 to 0.34, two true ones 0.16 and 0.26, the others 0.38 and more";
    few_regions: usize = 3, "Number of carrying regions below which their count says nothing.", JUDGEMENT;

    temper: f64 = 2.0, "Divisor of differences of log evidence in probabilities.", "development: calibrates what is stated as 0.99";
    doubt: f64 = 0.01, "Probability that the method errs and does not see it.", "development: of names on labelled sets one in a hundred was wrong";
    foreign_form: f64 = 0.15, "Share of the open set's probability that is left to the library's causes, in forms that neither their laws nor a function reaches.", "development: on two collections in forms that nobody had fitted 30 of 78 answers `unknown` at 0.99 and more were causes of the library; with 0.1 to 0.2 what is stated at 0.99 is right in 46 of 47 and 27 of 29";
    doubt_temper: f64 = 60.0, "Divisor of differences of log evidence where it does.", "development: on two collections in forms that nobody had fitted the log score is -1.11 and -1.97; -1.16 and -2.08 with 30, -1.11 and -1.96 with 90";
    alias_nats: f64 = 5.0, "Nats within which the data do not tell two hypotheses apart (chi2 of 10).", CONTRACT;
    name_probability: f64 = 0.9, "Probability that a name needs.", CONTRACT;
    alone_share: [f64; 2] = [0.93, 0.993], "Share of its alias class that a name needs: one cause, two.", "development: one cause was never wrong between 0.93 and 0.98 on 190 sets; pairs were wrong by up to 4.5 nats";
    pair_leaves_sd: f64 = 5.0, "Deviations of chi2 that a pair that is named may leave by its mechanism.", "development: on three collections in forms that nobody had fitted pairs that left more were right in 1 of 6 names, the others in 18 of 24";
    same_forces_chi2: f64 = 4.0, "chi2 between the forces of two hypotheses below which they say the same of a table.", JUDGEMENT;
    prior_nats: f64 = 10.0, "Nats up to which such a hypothesis stays in the leader's class: priors alone make no name.", JUDGEMENT;
    claim_probability: f64 = 0.1, "Probability of no gap above which no gap is claimed.", "judgement: the complement of `name_probability`";
    pair_gain_share: f64 = 0.03, "First way for a pair to keep its weight: share of the gap's chi2 by which its second cause raises twice the log evidence, beside `pair_least_nats`.", "development: single causes under another form gained up to 0.026 by a spurious companion, on two generators";
    pair_folded: [f64; 2] = [0.95, 0.5], "Share of its weight that goes to its members where it says little more than they: for a small and for a large gain; the rest stays.", "development: of 18 such pairs seven were true, where one set in three had a pair; what a name of the single needs is left";
    pair_folded_nats: f64 = 10.0, "Nats above which such a gain is large; the pair then joins the class of its leading member.", "development: on five collections 28 leading members were named that a pair beat by more than 10 nats, 13 of them rightly; of six with 5 to 10 nats five";
    pair_halves: f64 = 0.5, "Second way: of what the better single cause leaves as a misfit, the share below which the pair leaves, beside `pair_nats`.", JUDGEMENT;
    pair_nats: f64 = 50.0, "Nats by which the second way raises the log evidence.", "development: spurious companions gained up to 34";
    pair_complete_sd: f64 = 1.0, "Third way: deviations of scatter within which the pair leaves nothing where the better single cause leaves a misfit, beside `pair_least_nats`.", JUDGEMENT;
    pair_least_nats: f64 = 20.0, "Nats by which the first and the third way raise the log evidence.", "development: of 21 spurious companions 12 gained less, of 29 true ones four";
    pair_pull_chi2: f64 = 50.0, "Fourth way: chi2 by which the pair frees the nuisances.", "development: true single causes pull them by up to 30, a gain that hides in a stiffness by hundreds";
    pair_departure: f64 = 0.3, "Root mean square share of the gap up to which what a member of a pair leaves alone, with a smooth departure from its form, makes the pair untold from it.", "development: forms of one cause that pairs were named for left up to 0.29 of the gap";
    pair_own_form_nats: f64 = 30.0, "Evidence for a pair over a member alone from which the second cause is named all the same.", "development: of 128 single causes one had a pair in front, by 22 nats; of nine true pairs that the rule kept from a name seven had 30 to 700";

    }
    Report {
    folds: usize = 5, "Parts that are held out in turn.", "Hastie, Tibshirani & Friedman 2009, sec. 7.10: five or ten";
    resamples: usize = 400, "Resamples of the bootstrap.", "numerical: Efron & Tibshirani 1993";
    gapless_sd: f64 = 2.0, "Deviations of the mean square's scatter within which held-out passes show no gap to shrink.", "two standard deviations";
    misstated: f64 = 1.25, "Factor from which a statement of repeatability is reported as wrong.", JUDGEMENT;
    stands_out_sd: f64 = 2.0, "Deviations of a pass by which the gap at a condition must stand out.", "two standard deviations";
    least_contraction: f64 = 0.05, "Least contraction of the prior variance before a pull of a stiffness, or an interval of a parameter, is stated.", JUDGEMENT;

    design_least_nats: f64 = 0.05, "Nats below which an experiment is not worth asking for.", JUDGEMENT;
    settled_probability: f64 = 0.99, "Probability of no gap from which there is nothing to part.", JUDGEMENT;
    design_candidates: usize = 6, "Candidates that a design takes into account.", NUMERICAL;
    design_least_probability: f64 = 0.01, "Probability that each hypothesis counts for at least.", JUDGEMENT;
    design_pass_nats: f64 = 4.0, "Nats that one pass may count for: beyond them an outlier is the likelier explanation.", JUDGEMENT;
    check_most_nats: f64 = 500.0, "Nats of an instrument's check beyond which more says nothing.", NUMERICAL;
    }
}

impl Constants {
    /// Sets a constant from text: one number, or as many as it has, separated by commas.
    ///
    /// # Errors
    /// A name that is none, or numbers that do not fit.
    pub fn set(&mut self, name: &str, text: &str) -> Result<(), ConstantError> {
        let needed = self.numbers(name)?.len();
        let refused = || ConstantError::Value { name: name.to_string(), needed };
        let given: Result<Vec<f64>, _> = text.split(',').map(|t| t.trim().parse::<f64>()).collect();
        let given = given.map_err(|_| refused())?;
        if given.len() != needed || given.iter().any(|v| v.is_nan()) {
            return Err(refused());
        }
        if self.replace(name, &mut given.into_iter()) { Ok(()) } else { Err(refused()) }
    }

    /// Multiplies a constant, all of its numbers alike; whole numbers are rounded and stay one at least.
    ///
    /// # Errors
    /// A name that is none.
    pub fn scale(&mut self, name: &str, factor: f64) -> Result<(), ConstantError> {
        let scaled: Vec<f64> = self.numbers(name)?.iter().map(|v| v * factor).collect();
        self.replace(name, &mut scaled.into_iter());
        Ok(())
    }

    fn numbers(&self, name: &str) -> Result<Vec<f64>, ConstantError> {
        let row = self.rows().into_iter().find(|r| r.name == name);
        row.map(|r| r.values).ok_or_else(|| ConstantError::Name(name.to_string()))
    }
}

/// The table of all constants for docs/diagnosis/constants.md.
pub fn markdown() -> String {
    let mut text = String::from("| constant | value | meaning | source |\n|---|---|---|---|\n");
    for row in Constants::default().rows() {
        let values: Vec<String> = row.values.iter().map(f64::to_string).collect();
        text += &format!("| `{}` | {} | {} | {} |\n", row.name, values.join(", "), row.meaning, row.source);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A study sets and scales by name; what is none, or does not fit, is refused and changes nothing.
    #[test]
    fn constants_are_set_and_scaled_by_name() {
        let mut c = Constants::default();
        c.set("form_shares", "0.1, 0.2,0.3").unwrap();
        assert_eq!(c.form_shares, [0.1, 0.2, 0.3]);
        c.scale("form_rank", 0.5).unwrap();
        assert_eq!(c.form_rank, 20);
        c.scale("pairs_searched", 0.01).unwrap();
        assert_eq!(c.pairs_searched, 1);
        let before = c.clone();
        assert_eq!(c.set("nonsense", "1"), Err(ConstantError::Name("nonsense".into())));
        let short = ConstantError::Value { name: "form_shares".into(), needed: 3 };
        assert_eq!(c.set("form_shares", "0.1"), Err(short));
        assert!(c.set("alias_nats", "five").is_err() && c.set("alias_nats", "NaN").is_err());
        assert_eq!(c, before);
    }

    /// The documented table is the table.
    #[test]
    fn the_documented_constants_are_those_of_the_code() {
        let page =
            std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/diagnosis/constants.md"));
        assert!(page.unwrap().contains(&markdown()), "docs/diagnosis/constants.md: put in\n{}", markdown());
    }
}
