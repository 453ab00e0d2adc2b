//! Sealed data sets: point tables whose cause is known to their label alone.
//!
//! [`generate`] makes one set from a seed and a [`Stratum`]: a design, a fingertip, perhaps a cause of a size
//! drawn evenly in its logarithm through the limit of detection, forces from this world's own contact, and
//! noise of its own. The set holds what a diagnoser may see (table, rig.toml, hidden conditions) apart from
//! what only a scorer may (label and noise-free truth); [`Set::write`] puts them in two folders.
//!
//! | module | purpose |
//! |---|---|
//! | [`design`] | which passes were made |
//! | [`oracle`] | what the noise-free data could tell at best |
//! | [`imitate`] | which other cause would do as well |
//! | [`rough`] | sets whose scatter is not what rig.toml states |
//! | [`form`] | how far a cause may depart from its formula |
//! | `set_maker` | fingertip, noise, sizes, and the measurement itself |
//! | `files` | the folders |

pub mod design;
mod files;
pub mod form;
pub mod imitate;
pub mod oracle;
pub mod rough;
mod set_maker;

use crate::defects::{ALL, Defect, DefectKind, Defects, compatible};
use crate::noise::Noise;
use design::{Design, Planned};
use imitate::Imitator;
use models::{Condition, Pass};
use oracle::{Case, ImitationFit};
use serde::{Deserialize, Serialize};
pub use set_maker::SetNoise;
use set_maker::{GAP, SetMaker};

/// What kind of truth a set holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stratum {
    /// No cause.
    None,
    /// One cause that the library knows by name.
    Single,
    /// Two of them.
    Pair,
    /// One of the causes that others imitate exactly or nearly.
    Alias,
    /// One cause that the library does not know.
    Outside,
}

impl Stratum {
    /// The stratum of a seed: 20 % none, 35 % single, 10 % pairs, 15 % aliases, 20 % outside the library.
    pub fn draw(seed: u64) -> Self {
        match Noise::new(seed, "stratum").uniform() {
            u if u < 0.20 => Stratum::None,
            u if u < 0.55 => Stratum::Single,
            u if u < 0.65 => Stratum::Pair,
            u if u < 0.80 => Stratum::Alias,
            _ => Stratum::Outside,
        }
    }

    fn kinds(self, noise: &mut Noise) -> Vec<&'static DefectKind> {
        let has = |kind: &&DefectKind| match self {
            Stratum::None => false,
            Stratum::Single => kind.in_library && !kind.imitated,
            Stratum::Pair => kind.in_library,
            Stratum::Alias => kind.imitated,
            Stratum::Outside => !kind.in_library,
        };
        let pool: Vec<_> = ALL.iter().copied().filter(|kind| kind.in_tables && has(kind)).collect();
        if pool.is_empty() {
            return pool;
        }
        let first = pool[noise.below(pool.len())];
        if self != Stratum::Pair {
            return vec![first];
        }
        loop {
            let second = pool[noise.below(pool.len())];
            if second.name != first.name && compatible(second, first) {
                return vec![first, second];
            }
        }
    }
}

/// A cause with its parameters, for the label.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cause {
    /// Name.
    pub name: String,
    /// Whether the library has an effect of that name.
    pub in_library: bool,
    /// Parameters by name.
    pub parameters: std::collections::BTreeMap<String, f64>,
}

/// What only the scorer may see.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Label {
    /// Always `muprime.sealed/1`.
    pub schema: String,
    /// Seed of the set.
    pub seed: u64,
    /// Stratum.
    pub stratum: Stratum,
    /// chi2 by which the truth is better than the recalibrated baseline, from noise-free forces. 30 and more:
    /// detectable.
    pub chi2_gain: f64,
    /// Share of the recalibrated gap that the best single cause of the library leaves, its size, its shapes
    /// and the stiffnesses sought for it alone; none but for detectable pairs for which it was computed.
    pub best_single_leaves: Option<f64>,
    /// Rms over the hidden passes of the nominal baseline's error over mu0 F.
    pub hidden_before_rmse: f64,
    /// The same for the recalibrated baseline.
    pub hidden_recalibrated_rmse: f64,
    /// What repeatability leaves there.
    pub hidden_floor_rmse: f64,
    /// True normal stiffness (N/m).
    pub true_normal_stiffness_n_per_m: f64,
    /// True lateral stiffness (N/m).
    pub true_lateral_stiffness_n_per_m: f64,
    /// True coefficient of friction.
    pub true_mu0: f64,
    /// The noise.
    pub noise: SetNoise,
    /// The design.
    pub design: Design,
    /// The causes, strongest first; none for `none`.
    pub causes: Vec<Cause>,
    /// Best imitations by library causes, best first: of each cause while the others act beside it; for pairs
    /// of which the best single leaves less than [`PAIR_LEAVES`], of both together. Empty if they were not
    /// requested, or if the gain is under [`DETECTABLE`].
    pub imitators: Vec<Imitator>,
}

impl Label {
    /// Whether no other requested cause imitates the truth, form uncertainty included.
    pub fn decidable(&self) -> bool {
        !self.imitators.iter().any(|i| i.is_near())
    }
}

/// One sealed set.
#[derive(Clone, Debug, PartialEq)]
pub struct Set {
    /// The table.
    pub passes: Vec<Pass>,
    /// The rig.toml beside it.
    pub rig_toml: String,
    /// Hidden conditions, without lateral forces.
    pub conditions: Vec<Pass>,
    /// Noise-free lateral forces at the hidden conditions (N): for the scorer.
    pub truth_n: Vec<f64>,
    /// The same without the causes (N): for the scorer.
    pub without_n: Vec<f64>,
    /// Lateral forces of the recalibrated baseline there (N): for the scorer.
    pub recalibrated_n: Vec<f64>,
    /// Standard deviation of a measured pass there (N): for the scorer.
    pub sd_n: Vec<f64>,
    /// The label: for the scorer.
    pub label: Label,
}

/// What the oracle computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Ask {
    /// The gain of the truth over the recalibrated baseline.
    #[default]
    Gain,
    /// And which library causes imitate it; those dear to compute are tried on a part of the passes first.
    Imitators,
    /// And the dear ones (ridges that fly or recover late) on all passes from the start: seconds a set.
    AllImitators,
}

/// chi2 by which the truth must beat the recalibrated baseline for a set to show its cause at all.
pub const DETECTABLE: f64 = 30.0;
/// Share of the gap that the best single cause must leave for both causes to be requested.
pub const PAIR_LEAVES: f64 = 0.25;
/// Passes hidden for scoring.
const HIDDEN: usize = 100;

/// The maker of a set, for further passes: what a designed next experiment is tried on.
pub struct SealedRig {
    maker: SetMaker,
    defects: Defects,
    noise: Noise,
    pace_s: f64,
    runs: usize,
    points: usize,
}

impl SealedRig {
    /// Measures further passes in a new run, in the order given. Of a condition, `time_s` and `mu0` are not
    /// used: passes follow each other at the set's pace.
    pub fn measure(&mut self, conditions: &[Condition]) -> Vec<Pass> {
        let plan = |(i, condition): (usize, &Condition)| {
            let condition = Condition { time_s: 5.0 + i as f64 * self.pace_s, ..*condition };
            Planned { condition, replicate: 0, run: self.runs }
        };
        let planned: Vec<Planned> = conditions.iter().enumerate().map(plan).collect();
        let points = self.maker.circumstances(&planned, true, &mut self.noise);
        let mut passes = self.maker.measure(&points, &planned, &self.defects, &mut self.noise);
        for pass in &mut passes {
            pass.point += self.points as u64;
        }
        self.points += passes.len();
        self.runs += 1;
        passes
    }
}

/// The set of a seed.
pub fn generate(seed: u64, stratum: Stratum, ask: Ask) -> Set {
    generate_with_rig(seed, stratum, ask).0
}

/// The set of a seed, and its rig.
pub fn generate_with_rig(seed: u64, stratum: Stratum, ask: Ask) -> (Set, SealedRig) {
    let mut noise = Noise::new(seed, "sealed");
    let design = Design::draw(&mut noise);
    let planned = design.plan(&mut noise);
    let hidden = design.hidden(&mut noise, &planned, HIDDEN);
    let maker = SetMaker::draw(&mut noise, seed);
    let kinds = stratum.kinds(&mut noise);
    let seen = maker.circumstances(&planned, true, &mut noise);
    let defects = maker.sized(&kinds, &seen, GAP, &mut noise);
    let passes = maker.measure(&seen, &planned, &defects, &mut noise);

    let data = maker.noise_free(&seen, &defects);
    let case = maker.case(&data);
    let base = case.fit(&Defects::none(), 8);
    let truth = case.fit_from(&maker.finger, &defects, 2);
    let gain = base.chi2 - truth.chi2;
    let (best_single_leaves, imitators) = match ask {
        Ask::Gain => (None, Vec::new()),
        _ if gain < DETECTABLE || kinds.is_empty() => (None, Vec::new()),
        _ => imitations(&case, &defects.defects, &base, truth.chi2, ask == Ask::AllImitators),
    };

    let seen_hidden = maker.circumstances(&hidden, false, &mut noise);
    let at_hidden = maker.noise_free(&seen_hidden, &defects);
    let without = maker.noise_free(&seen_hidden, &Defects::none());
    // Nominal baseline: docs/contract.md's mu0, from the table's passes without vibration.
    let mut nominal = maker.nominal;
    nominal.mu0 = models::pass::coulomb_coefficient(&passes).unwrap_or(nominal.mu0);
    let label = Label {
        schema: "muprime.sealed/1".to_string(),
        seed,
        stratum,
        chi2_gain: gain,
        best_single_leaves,
        hidden_before_rmse: maker.error(&at_hidden, &nominal),
        hidden_recalibrated_rmse: maker.error(&at_hidden, &base.finger),
        hidden_floor_rmse: maker.floor(&at_hidden),
        true_normal_stiffness_n_per_m: maker.finger.normal_stiffness_n_per_m,
        true_lateral_stiffness_n_per_m: maker.finger.lateral_stiffness_n_per_m,
        true_mu0: maker.finger.mu0,
        noise: maker.scatter,
        design,
        causes: defects.defects.iter().map(cause).collect(),
        imitators,
    };
    let rig = SealedRig {
        noise: Noise::new(seed, "further passes"),
        pace_s: label.design.pace_s,
        runs: planned.iter().map(|p| p.run + 1).max().unwrap_or(0),
        points: passes.len(),
        defects,
        maker,
    };
    let set = Set {
        conditions: rig.maker.conditions(&at_hidden, &hidden),
        rig_toml: rig.maker.rig_file().to_toml().expect("a sealed set's rig is within every range"),
        recalibrated_n: rig.maker.ideal(&at_hidden, &base.finger),
        sd_n: at_hidden.sd_n,
        passes,
        truth_n: at_hidden.lateral_n,
        without_n: without.lateral_n,
        label,
    };
    (set, rig)
}

/// What the best single cause leaves of a pair's gap, and every cause's imitators.
fn imitations(
    case: &Case<'_>,
    causes: &[Defect],
    base: &ImitationFit,
    truth_chi2: f64,
    whole: bool,
) -> (Option<f64>, Vec<Imitator>) {
    let mut leaves = None;
    if causes.len() > 1 {
        let singles = case.imitators(causes, base, truth_chi2, whole);
        leaves = singles.first().map(|best| best.share_left.max(0.0));
        // One cause all but explains the data: there is no pair to find.
        if leaves.is_some_and(|share| share < PAIR_LEAVES) {
            return (leaves, singles);
        }
    }
    // Each cause in turn gives way to an imitator while the others stay as they are.
    let one = |place: usize| {
        let mut beside = causes.to_vec();
        let own = beside.remove(place);
        let case = Case { beside: &beside, place, ..*case };
        let own_base = (!beside.is_empty()).then(|| case.fit(&Defects::none(), 8));
        case.imitators(&[own], own_base.as_ref().unwrap_or(base), truth_chi2, whole)
    };
    let mut all: Vec<Imitator> = (0..causes.len()).flat_map(one).collect();
    all.sort_by(|a, b| a.chi2_left.total_cmp(&b.chi2_left));
    (leaves, all)
}

fn cause(defect: &Defect) -> Cause {
    let names = defect.kind.parameters.iter().map(|p| p.name.to_string());
    Cause {
        name: defect.kind.name.to_string(),
        in_library: defect.kind.in_library,
        parameters: names.zip(defect.values).collect(),
    }
}
