//! How a hypothesis may depart from its form. docs/diagnosis/model.md, section 5.
//!
//! A cause's change may bend smoothly over all covariates, in proportion to itself. And where a cause acts
//! on one input (the amplitude, say) by a size that is a function of few covariates (of time alone), that
//! function may be any smooth one: the mechanism stays, the formula goes.

use crate::regression::{Basis, Bends, Layout, Member, NUISANCES, Problem, Recalibration, goes_with_place};
use models::covariate::{Covariate, CovariateRole};
use nalgebra::{DMatrix, DVector};

/// Standard deviations of the departures, as shares of the cause's change net of recalibration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Freedom {
    /// Of the change itself, over all covariates.
    pub share: f64,
    /// Of what is bent.
    pub bend: f64,
    /// What that is.
    pub bends: Bends,
}

impl Freedom {
    /// None: the library's form, or no cause.
    pub const NONE: Freedom = Freedom::share(0.0);

    /// Of the change alone.
    pub const fn share(share: f64) -> Self {
        Freedom { share, bend: 0.0, bends: Bends::Input }
    }
}

/// What departures are proportional to, at some passes.
#[derive(Debug, Clone)]
pub struct Change {
    /// The change by all members, net of what recalibration could imitate, N.
    pub net: DVector<f64>,
    /// Of each effect that is bent.
    pub bent: Vec<Bent>,
}

/// What one effect's bending makes.
#[derive(Debug, Clone)]
pub struct Bent {
    effect: usize,
    bends: Bends,
    /// Standard deviation, in the unit of its input, or in the coordinate of the size.
    sd: f64,
    /// One standard deviation, N.
    force: DVector<f64>,
}

impl Change {
    /// No cause changes anything.
    pub fn none(passes: usize) -> Self {
        Change { net: DVector::zeros(passes), bent: Vec::new() }
    }

    /// By a hypothesis at coordinates where it predicts this; what is bent has the net size of the member's
    /// own change.
    pub fn by(
        problem: &Problem,
        members: &[Member],
        u: &[f64],
        prediction: &DVector<f64>,
        basis: &Basis,
        freedom: Freedom,
    ) -> Self {
        if members.is_empty() {
            return Change::none(problem.len());
        }
        let recalibrated = Recalibration::of(problem, u, prediction);
        let net = recalibrated.net();
        let Recalibration { raw, jacobian, .. } = recalibrated;
        let mut bent = Vec::new();
        for (i, member) in members.iter().enumerate().filter(|_| freedom.bend > 0.0) {
            if basis.of(member.effect, freedom.bends).is_none() {
                continue;
            }
            let Some(slope) = slope(problem, members, u, prediction, (i, freedom.bends)) else { continue };
            let alone = members.len() == 1;
            let own = if alone { raw.clone() } else { prediction - without_member(problem, members, u, i) };
            let own = beside_recalibration(problem, &jacobian, &own);
            let unit = norm(problem, &beside_recalibration(problem, &jacobian, &slope));
            let sd = freedom.bend * norm(problem, &own) / unit.max(1e-300);
            bent.push(Bent { effect: member.effect, bends: freedom.bends, sd, force: slope * sd });
        }
        Change { net, bent }
    }

    /// The same at conditions of another problem, where the hypothesis predicts `plain`, with the
    /// recalibration and the deviations of this one.
    pub fn at(
        &self,
        out: &Problem,
        members: &[Member],
        u: &[f64],
        plain: &DVector<f64>,
        shift: &DVector<f64>,
    ) -> Self {
        let under = out.predict(&[], &u[..NUISANCES]);
        let net = plain - &under - out.jacobian(&[], &u[..NUISANCES], &under) * shift;
        let bent = self.bent.iter().filter_map(|bent| {
            let i = members.iter().position(|m| m.effect == bent.effect)?;
            let slope = slope(out, members, u, plain, (i, bent.bends))?;
            Some(Bent { force: slope * bent.sd, ..*bent })
        });
        Change { net, bent: bent.collect() }
    }

    /// Whether an effect is bent.
    pub fn bends(&self, effect: usize) -> bool {
        self.bent.iter().any(|b| b.effect == effect)
    }

    /// Whether something is bent over this covariate.
    pub fn bends_over(&self, covariate: &Covariate) -> bool {
        self.bent.iter().any(|b| match b.bends {
            Bends::Input => {
                let acts = effects::at(b.effect).acts;
                acts.is_some_and(|acts| acts.over.iter().any(|c| c.name == covariate.name))
            }
            Bends::Size => match covariate.role {
                CovariateRole::Place => goes_with_place(b.effect),
                role => role == CovariateRole::Climate,
            },
        })
    }

    /// Columns of the departure, N: independent standard deviates times these. What is bent comes first.
    pub fn columns(&self, basis: &Basis, share: f64) -> DMatrix<f64> {
        let smooth = (share > 0.0).then_some((&basis.smooth, &self.net, share));
        let bent =
            self.bent.iter().filter_map(|bent| Some((basis.of(bent.effect, bent.bends)?, &bent.force, 1.0)));
        let parts: Vec<_> = bent.chain(smooth).collect();
        let mut all = DMatrix::zeros(self.net.len(), parts.iter().map(|(m, ..)| m.ncols()).sum());
        let mut at = 0;
        for (m, by, factor) in parts {
            for column in m.column_iter() {
                all.set_column(at, &(column.component_mul(by) * factor));
                at += 1;
            }
        }
        all
    }
}

/// Change of the predictions for a unit of what is bent of a member.
fn slope(
    problem: &Problem,
    members: &[Member],
    u: &[f64],
    prediction: &DVector<f64>,
    (member, bends): (usize, Bends),
) -> Option<DVector<f64>> {
    let acts = effects::at(members[member].effect).acts;
    Some(match bends {
        Bends::Input => problem.sensitivity(members, u, prediction, acts?.on),
        Bends::Size => problem.size_sensitivity(members, u, prediction, member),
    })
}

/// Forces of a hypothesis at coordinates, N, with one of its members left out.
pub fn without_member(problem: &Problem, members: &[Member], u: &[f64], member: usize) -> DVector<f64> {
    let (mut rest, mut v) = (members.to_vec(), u.to_vec());
    rest.remove(member);
    v.drain(Layout::of(members).member(member));
    problem.predict(&rest, &v)
}

fn norm(problem: &Problem, force: &DVector<f64>) -> f64 {
    product(problem, force, force).sqrt()
}

/// Inner product of two forces in deviations of a pass.
pub(crate) fn product(problem: &Problem, a: &DVector<f64>, b: &DVector<f64>) -> f64 {
    a.iter().zip(b.iter()).zip(&problem.variance).map(|((a, b), v)| a * b / v).sum()
}

/// The transpose of a matrix whose rows are divided by these variances.
pub(crate) fn weighted(matrix: &DMatrix<f64>, variance: &[f64]) -> DMatrix<f64> {
    let mut weighted = matrix.transpose();
    weighted.column_iter_mut().zip(variance).for_each(|(mut column, v)| column.scale_mut(1.0 / v));
    weighted
}

/// What recalibration cannot imitate of a force, to first order.
fn beside_recalibration(problem: &Problem, jacobian: &DMatrix<f64>, force: &DVector<f64>) -> DVector<f64> {
    let t = weighted(jacobian, &problem.variance);
    let hessian = &t * jacobian + DMatrix::identity(NUISANCES, NUISANCES);
    hessian.cholesky().map_or_else(|| force.clone(), |c| force - jacobian * c.solve(&(t * force)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Table;
    use crate::regression::{Kernels, averaged_over_form, laplace, minimise};
    use crate::tests::{Deviates, rig, table};
    use effects::{Baseline, by_name};
    use models::Condition;

    /// A table on which the amplitude falls to half of itself and comes back while the plate passes through
    /// its resonance.
    fn through_a_resonance() -> Table {
        let mut table = table(&mut Deviates(5), 0.0);
        let finger = rig().finger;
        let baseline = Baseline {
            mu0: 0.5,
            normal_stiffness_n_per_m: finger.normal_stiffness_n_per_m,
            lateral_stiffness_n_per_m: finger.lateral_stiffness_n_per_m,
        };
        let mut draw = Deviates(6);
        for (p, lateral) in table.passes.iter().zip(&mut table.lateral) {
            let share = 2.0 * (p.time_s / table.design.duration_s - 0.5);
            let moved = models::quantity::PeakToPeak::from_metres(
                p.amplitude.metres() * (0.5 + 0.5 * (-4.0 * share * share).exp()),
            );
            let there = Condition { amplitude: moved, ..*p };
            let force = effects::lateral_force(&baseline, &[], &there, &table.design);
            *lateral = force * (1.0 + 0.02 * draw.normal()) + 0.001 * draw.normal();
        }
        table
    }

    /// The library's detuning falls with time and stays down. Bent over time it follows a plate that comes
    /// back; at other conditions its departure is what it is at the table's.
    #[test]
    fn a_detuning_that_comes_back_is_a_detuning() {
        let table = through_a_resonance();
        let mut problem = Problem::new(&table, &rig(), &Default::default());
        crate::scatter::noise::settle(&table, &rig(), &mut problem, &crate::scatter::Belief::ByResidual);
        let effect = (0..effects::library().len())
            .find(|&e| effects::library()[e].name == by_name("resonance_detuning").map_or("", |e| e.name))
            .unwrap();
        let kernels = Kernels::on(&problem, &table, &[effect]);
        let basis = kernels.at(&problem.passes);
        let members = [Member { effect, law: 5 }];
        let start = [0.0, 0.0, 0.0, 0.3, 0.0, 0.5, 0.0, 0.0, 0.0];
        let fit = minimise(&problem, &members, &start, &problem.variance, 15);
        let large = Freedom::share(problem.constants.form_shares[2]);
        let alone = laplace(&problem, &members, &fit.u, &basis, large, 6);
        let share = Freedom::share(problem.constants.form_shares[1]);
        let bent = Freedom { bend: problem.constants.bend_share, ..share };
        let bent = laplace(&problem, &members, &fit.u, &basis, bent, 6);
        let gained = bent.log_evidence - alone.log_evidence;
        assert!(gained > 3.0, "{gained:.1} nats");
        let shift = Recalibration::of(&problem, &bent.u, &bent.prediction).shift;
        let again = bent.change.at(&problem, &members, &bent.u, &bent.prediction, &shift);
        let [here, there] = [&bent.change, &again].map(|c| c.columns(&basis, bent.freedom.share));
        assert!((&here - &there).amax() < 1e-9 * here.amax());
        // The late passes say nothing against it, the fast ones do.
        use models::covariate::{SPEED, TIME};
        assert!(bent.change.bends_over(&TIME) && !bent.change.bends_over(&SPEED));
        assert!(!alone.change.bends_over(&TIME));
        let (_, best) = averaged_over_form(&problem, &fit.u, &members, &basis);
        assert!(best.freedom.bend > 0.0 && best.by_law().freedom.bend == 0.0);
        // The verdict says that the law is not this.
        let report = crate::report::diagnose(&table, &rig(), &Default::default(), String::new()).report;
        assert!(report.hypotheses[0].effects == ["resonance_detuning"], "{}", report.text);
        let says = report
            .remarks
            .iter()
            .any(|r| r.contains("resonance detuning as a function of time of a free form"));
        assert!(says, "{:?}", report.remarks);
    }
}
