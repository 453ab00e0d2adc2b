//! A hypothesis on a table, in coordinates that are N(0, 1) a priori. docs/diagnosis/model.md, section 2.

use crate::base_law::BaseLaw;
use crate::constants::Constants;
use crate::data::RigFile;
pub use crate::regression::member::Member;
use crate::regression::{Covariance, HALF_LN_2PI, Layout, NUISANCES, beside_each_other};
use effects::{Active, Baseline, Contact, Design, Input, library};
use models::Condition;
use models::rig_file::CertifiedKey;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Step of a difference in a nuisance's coordinate and in an effect's.
const STEPS: [f64; 2] = [1e-3, 2e-3];
/// Farthest coordinate of a nuisance that a fit may take, in deviations of its prior.
const FARTHEST_NUISANCE: f64 = 40.0;
/// Certified deviations below this share of a law's own prior are taken as this: closer to exact than any
/// table can tell, and still a number to divide by.
const EXACT: f64 = 1e-6;

/// The data of a fit: passes, forces and their variances; a subset of a table where rows were left out.
#[derive(Debug, Clone)]
pub struct Problem {
    /// Conditions.
    pub passes: Vec<Condition>,
    /// Measured lateral forces, N.
    pub lateral: Vec<f64>,
    /// Variances of the lateral forces, N^2: of what each pass has by itself.
    pub variance: Vec<f64>,
    /// Scatter that passes have in common, N: independent standard deviates times these columns (shifts of
    /// runs, slow parts of a serial correlation). No columns where passes scatter independently.
    pub common: DMatrix<f64>,
    /// Scales of the table.
    pub design: Design,
    /// Baseline at the prior's centre.
    pub nominal: Baseline,
    /// Prior deviations of the logarithms of mu0, normal and lateral stiffness.
    pub prior_sd: [f64; NUISANCES],
    /// Certified deviations of effect sizes, by effect and law, in units of the law's own prior.
    pub certified: Vec<(Member, f64)>,
    /// Whether predictions may be rough: where a search only looks for places to begin.
    pub rough: bool,
    /// Tunable constants of the diagnosis.
    pub constants: Arc<Constants>,
    /// The base law; none: the spring-slider.
    pub law: Option<Arc<BaseLaw>>,
    /// Effects of the user's own that are tried; beyond their tables there is no prediction.
    pub own: Vec<usize>,
    /// Of each pass: force of the base law beside the nominal spring-slider's, and the law's uncertainty, N.
    /// Empty without a law.
    pub beside: Vec<[f64; 2]>,
}

/// Instrument errors that no table of passes tells from another baseline, with the logarithmic change of the
/// baseline's parameters that each is. What a certificate leaves open of them is part of the recalibration;
/// without a certificate the instrument is taken at its word, and a pull of the stiffnesses is the only sign.
fn gains_within_the_baseline() -> impl Iterator<Item = (CertifiedKey, [f64; NUISANCES])> {
    library()
        .iter()
        .filter(|e| e.needs.iter().any(|n| n.is_standard()))
        .flat_map(|e| e.laws)
        .filter_map(|law| Some((law.certified_by?, law.acts_as?)))
}

impl Problem {
    /// The problem of a whole table.
    pub fn new(table: &crate::data::Table, rig: &RigFile, constants: &Arc<Constants>) -> Self {
        let mu0 = table.still_coefficient();
        let sd = rig.finger.stiffness_relative_sd.max(constants.stiffness_sd_floor);
        let mut certified = Vec::new();
        for (index, effect) in library().iter().enumerate() {
            for (law, form) in effect.laws.iter().enumerate() {
                if let (Some(sd), effects::Prior::Normal(wide) | effects::Prior::HalfNormal(wide)) = (
                    form.certified_by.and_then(|key| rig.calibration.sd(key)),
                    form.parameters[0].at_load(table.design.reference_load_n).prior,
                ) {
                    certified.push((Member { effect: index, law }, (sd / wide).clamp(EXACT, 1.0)));
                }
            }
        }
        let mut prior_sd = [constants.mu0_log_sd[usize::from(mu0.is_none())], sd, sd];
        for (key, e_folds) in gains_within_the_baseline() {
            let open = rig.calibration.sd(key).unwrap_or(0.0);
            prior_sd.iter_mut().zip(e_folds).for_each(|(own, e_fold)| *own = own.hypot(e_fold * open));
        }
        Problem {
            passes: table.passes.clone(),
            lateral: table.lateral.clone(),
            variance: vec![1.0; table.len()],
            common: DMatrix::zeros(table.len(), 0),
            design: table.design,
            nominal: Baseline {
                mu0: table.nominal_mu0(),
                normal_stiffness_n_per_m: rig.finger.normal_stiffness_n_per_m,
                lateral_stiffness_n_per_m: rig.finger.lateral_stiffness_n_per_m,
            },
            prior_sd,
            certified,
            rough: false,
            constants: constants.clone(),
            law: None,
            own: Vec::new(),
            beside: Vec::new(),
        }
    }

    /// The same problem on a base law, which is read once for each pass.
    pub fn on(self, law: Option<&Arc<BaseLaw>>) -> Self {
        let beside =
            law.map_or_else(Vec::new, |law| self.passes.iter().map(|p| self.beside(law, p)).collect());
        Problem { law: law.cloned(), beside, ..self }
    }

    fn beside(&self, law: &BaseLaw, pass: &Condition) -> [f64; 2] {
        law.beside(&self.nominal, &self.design, pass)
    }

    /// Variance of a pass by the base law's own uncertainty, N^2.
    pub fn law_variance(&self, row: usize) -> f64 {
        self.beside.get(row).map_or(0.0, |b| b[1] * b[1])
    }

    /// Whether the base law and the user's own effects can tell at a condition; spring-slider and library always can.
    pub fn tells(&self, pass: &Condition) -> bool {
        let at = Condition { mu0: self.nominal.mu0, ..*pass };
        let reached = |e: &usize| effects::at(*e).own.is_none_or(|own| own.factor(1.0, &at).is_ok());
        self.law.as_ref().is_none_or(|law| law.tells(at.mu0, pass)) && self.own.iter().all(reached)
    }

    /// Full friction at each pass, N: the unit of the errors of docs/contract.md.
    pub fn full_friction(&self) -> Vec<f64> {
        self.passes.iter().map(|p| self.nominal.mu0 * p.normal_force_n).collect()
    }

    /// Number of passes.
    pub fn len(&self) -> usize {
        self.passes.len()
    }

    /// True without passes.
    pub fn is_empty(&self) -> bool {
        self.passes.is_empty()
    }

    /// The same problem on some of its rows.
    pub fn select(&self, rows: &[usize]) -> Self {
        Problem {
            passes: rows.iter().map(|&i| self.passes[i]).collect(),
            lateral: rows.iter().map(|&i| self.lateral[i]).collect(),
            variance: rows.iter().map(|&i| self.variance[i]).collect(),
            common: self.common.select_rows(rows.iter()),
            certified: self.certified.clone(),
            constants: self.constants.clone(),
            law: self.law.clone(),
            own: self.own.clone(),
            beside: rows.iter().filter(|_| self.law.is_some()).map(|&i| self.beside[i]).collect(),
            ..*self
        }
    }

    /// The same problem at other conditions, where nothing was measured.
    pub fn at(&self, passes: &[Condition]) -> Self {
        let n = passes.len();
        Problem {
            passes: passes.to_vec(),
            lateral: vec![0.0; n],
            variance: vec![1.0; n],
            common: DMatrix::zeros(n, 0),
            ..self.select(&[])
        }
        .on(self.law.as_ref())
    }

    /// Covariance of the forces: scatter, and smooth parts in the columns of `phi`, whose weights come first.
    pub fn covariance(&self, phi: &DMatrix<f64>) -> Covariance {
        Covariance::new(&self.variance, &self.beside_common(phi))
    }

    /// The columns of `phi`, and after them those of the scatter that passes have in common.
    pub fn beside_common(&self, phi: &DMatrix<f64>) -> DMatrix<f64> {
        beside_each_other(phi, &self.common)
    }

    /// chi2 of a residual: what scatter does not explain. Its expectation is the number of passes.
    pub fn chi2(&self, residual: &DVector<f64>) -> f64 {
        self.covariance(&DMatrix::zeros(self.len(), 0)).quadratic(residual)
    }

    /// chi2 of the measured forces about a prediction.
    pub fn misfit(&self, prediction: &DVector<f64>) -> f64 {
        self.chi2(&(DVector::from_column_slice(&self.lateral) - prediction))
    }

    /// Variance of a pass's whole scatter, N^2.
    pub fn whole_variance(&self, row: usize) -> f64 {
        self.variance[row] + self.common.row(row).norm_squared()
    }

    /// The baseline at coordinates.
    pub fn baseline(&self, u: &[f64]) -> Baseline {
        Baseline {
            mu0: self.nominal.mu0 * (self.prior_sd[0] * u[0]).exp(),
            normal_stiffness_n_per_m: self.nominal.normal_stiffness_n_per_m * (self.prior_sd[1] * u[1]).exp(),
            lateral_stiffness_n_per_m: self.nominal.lateral_stiffness_n_per_m
                * (self.prior_sd[2] * u[2]).exp(),
        }
    }

    /// Bounds of the coordinates.
    pub fn bounds(&self, members: &[Member]) -> Vec<(f64, f64)> {
        let own = members.iter().flat_map(|m| m.parameters(&self.design));
        let nuisances = [(-FARTHEST_NUISANCE, FARTHEST_NUISANCE); NUISANCES].into_iter();
        nuisances.chain(own.map(|p| p.coordinate_bounds())).collect()
    }

    /// Precision of the Gaussian prior of each coordinate; zero for a uniform one.
    pub fn prior_precision(&self, members: &[Member]) -> Vec<f64> {
        let mut list = vec![1.0; NUISANCES];
        for m in members {
            for (i, p) in m.parameters(&self.design).iter().enumerate() {
                list.push(match p.prior {
                    effects::Prior::Uniform(..) => 0.0,
                    _ if i == 0 => 1.0 / self.certificate(m).powi(2),
                    _ => 1.0,
                });
            }
        }
        list
    }

    fn certificate(&self, member: &Member) -> f64 {
        self.certified.iter().find(|(m, _)| m == member).map_or(1.0, |(_, sd)| *sd)
    }

    /// Log prior density at coordinates.
    pub fn log_prior(&self, members: &[Member], u: &[f64]) -> f64 {
        let mut sum: f64 = u[..NUISANCES].iter().map(|x| -0.5 * x * x - HALF_LN_2PI).sum();
        for (m, places) in members.iter().zip(Layout::of(members).members()) {
            for (i, (p, u)) in m.parameters(&self.design).iter().zip(&u[places]).enumerate() {
                let sd = if i == 0 { self.certificate(m) } else { 1.0 };
                sum += p.log_prior(u / sd) - sd.ln();
            }
        }
        sum
    }

    /// Parameters in the laws' own units.
    pub fn thetas(&self, members: &[Member], u: &[f64]) -> Vec<Vec<f64>> {
        let own = |(m, places): (&Member, std::ops::Range<usize>)| {
            m.parameters(&self.design).iter().zip(&u[places]).map(|(p, u)| p.value(*u)).collect()
        };
        members.iter().zip(Layout::of(members).members()).map(own).collect()
    }

    /// Predicted lateral forces, N.
    pub fn predict(&self, members: &[Member], u: &[f64]) -> DVector<f64> {
        self.slider_beside_law(members, u, None)
    }

    /// Predicted lateral forces at other conditions, N; NaN where the base law cannot tell.
    pub fn predict_at(&self, members: &[Member], u: &[f64], passes: &[Condition]) -> DVector<f64> {
        let mut forces = self.slider(members, u, passes, None);
        if let Some(law) = &self.law {
            forces.iter_mut().zip(passes).for_each(|(force, p)| *force += self.beside(law, p)[0]);
        }
        forces
    }

    /// The forces at the passes of the problem, N, with an input beside its value where one is given.
    fn slider_beside_law(&self, members: &[Member], u: &[f64], moved: Option<(Input, f64)>) -> DVector<f64> {
        let mut forces = self.slider(members, u, &self.passes, moved);
        forces.iter_mut().zip(&self.beside).for_each(|(force, [beside, _])| *force += beside);
        forces
    }

    /// The spring-slider's forces, N.
    fn slider(
        &self,
        members: &[Member],
        u: &[f64],
        passes: &[Condition],
        moved: Option<(Input, f64)>,
    ) -> DVector<f64> {
        let baseline = self.baseline(u);
        let thetas = self.thetas(members, u);
        // Effects act in the library's order, whatever the order of the hypothesis.
        let mut order: Vec<usize> = (0..members.len()).collect();
        order.sort_by_key(|&k| members[k]);
        let active = |k: usize| {
            let Member { effect, law } = members[k];
            Active { effect: effects::at(effect), law, theta: &thetas[k] }
        };
        let active: Vec<Active<'_>> = order.into_iter().map(active).collect();
        let force = |p: &Condition| {
            let contact = Contact { coarse: self.rough, ..baseline.contact(p, &self.design) };
            effects::read(contact, &active, moved, p, &self.design)
        };
        DVector::from_iterator(passes.len(), passes.iter().map(force))
    }

    /// Change of the predictions for a unit of an input, as [`effects::Input`] has it, with the hypothesis
    /// in force.
    pub fn sensitivity(
        &self,
        members: &[Member],
        u: &[f64],
        at: &DVector<f64>,
        input: Input,
    ) -> DVector<f64> {
        let step = STEPS[1] * if input == Input::Load { self.design.reference_load_n } else { 1.0 };
        (self.slider_beside_law(members, u, Some((input, step))) - at) / step
    }

    /// Change of the predictions for a unit of a member's size, in its coordinate.
    pub fn size_sensitivity(
        &self,
        members: &[Member],
        u: &[f64],
        at: &DVector<f64>,
        member: usize,
    ) -> DVector<f64> {
        let k = Layout::of(members).member(member).start;
        let (step, mut moved) = (STEPS[1], u.to_vec());
        moved[k] += if u[k] + step > self.bounds(members)[k].1 { -step } else { step };
        (self.predict(members, &moved) - at) / (moved[k] - u[k])
    }

    /// Derivatives of the predictions by the coordinates, by differences into the feasible side.
    pub fn jacobian(&self, members: &[Member], u: &[f64], at: &DVector<f64>) -> DMatrix<f64> {
        let bounds = self.bounds(members);
        let mut jacobian = DMatrix::zeros(self.len(), u.len());
        let mut moved = u.to_vec();
        for k in 0..u.len() {
            let size = STEPS[usize::from(k >= NUISANCES)];
            let step = if u[k] + size > bounds[k].1 { -size } else { size };
            moved[k] = u[k] + step;
            let there = self.predict(members, &moved);
            moved[k] = u[k];
            jacobian.set_column(k, &((there - at) / step));
        }
        jacobian
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{Deviates, rig, table};
    use models::RigFile;

    /// Whatever certificate rig.toml may state reaches the prior of the law that it bounds.
    #[test]
    fn every_certificate_narrows_the_prior_of_its_law() {
        let table = table(&mut Deviates(2), 0.0);
        for key in CertifiedKey::ALL {
            let text = format!("{}\n[calibration]\n{} = 1e-4\n", rig().to_toml().unwrap(), key.name());
            let rig = RigFile::parse(&text).unwrap();
            let problem = Problem::new(&table, &rig, &Arc::default());
            let narrowed: Vec<_> =
                problem.certified.iter().filter(|(m, _)| m.form().certified_by == Some(key)).collect();
            // A cross-talk certificate stands for the other direction too.
            assert!(!narrowed.is_empty(), "{} bounds no law", key.name());
            for (member, sd) in narrowed {
                let precision = problem.prior_precision(&[*member])[Layout::of(&[*member]).size(0)];
                assert!(*sd < 0.2 && (precision * sd * sd - 1.0).abs() < 1e-9, "{}: {sd}", key.name());
            }
        }
    }
}
