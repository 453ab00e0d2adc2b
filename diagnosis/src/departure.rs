//! How a hypothesis may depart from its form. docs/diagnosis/model.md, section 5.
//!
//! A cause's change may bend smoothly over all covariates, in proportion to itself. And where a cause acts
//! on one input (the amplitude, say) by a size that is a function of few covariates (of time alone), that
//! function may be any smooth one: the mechanism stays, the formula goes.

use crate::constants::Constants;
use crate::fit::Problem;
use crate::kernel::{COUNT, Coordinates, Kernel, Lengths, form_lengths};
use crate::layout::{Layout, NUISANCES};
use crate::member::Member;
use crate::recalibration::Recalibration;
use effects::Input;
use models::condition::Condition;
use models::covariate::{Covariate, Role, SMOOTH, TIME};
use nalgebra::{DMatrix, DVector};

/// Correlation length over the starts of runs, in standard deviations of time.
const RUN_LENGTH: f64 = 0.02;

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

/// What a cause's function replaces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bends {
    /// What the cause acts on, over the covariates of its mechanism ([`effects::Acts`]).
    Input,
    /// Its size, over the weather and, where no other effect is that, over the place: a stiffness that is
    /// another along the plate, a damping that falls as it warms.
    Size,
}

impl Freedom {
    /// None: the library's form, or no cause.
    pub const NONE: Freedom = Freedom::share(0.0);

    /// Of the change alone.
    pub const fn share(share: f64) -> Self {
        Freedom { share, bend: 0.0, bends: Bends::Input }
    }
}

/// The kernels of all departures on one table.
#[derive(Debug, Clone)]
pub struct Kernels {
    coordinates: Coordinates,
    largest_amplitude: f64,
    smooth: (Lengths, Kernel),
    /// By effect; without those whose covariates do not change in the table.
    bends: Vec<Bend>,
    /// Over the weather, and over the place too; none where these do not change.
    sizes: [Option<(Lengths, Kernel)>; 2],
}

/// A smooth function that bends what an effect acts on.
#[derive(Debug, Clone)]
struct Bend {
    effect: usize,
    /// Whether it goes over the start of the run, each run apart, in the place of time.
    by_run: bool,
    lengths: Lengths,
    kernel: Kernel,
}

impl Bend {
    fn place(&self, coordinates: &Coordinates, p: &Condition, largest_amplitude: f64) -> [f64; COUNT] {
        coordinates.place(&at_start(p, self.by_run), largest_amplitude, &self.lengths)
    }
}

/// The condition at the start of its run.
fn at_start(p: &Condition, by_run: bool) -> Condition {
    let since = if by_run { p.time_in_run_s() } else { 0.0 };
    Condition { time_s: p.time_s - since, ..*p }
}

impl Kernels {
    /// The kernels on a table's passes, for these effects.
    pub fn on(problem: &Problem, coordinates: Coordinates, effects: &[usize]) -> Self {
        let k = &problem.constants;
        let largest = problem.design.largest_amplitude_m;
        let kernel = |lengths: &Lengths, by_run: bool| {
            let place = |p: &Condition| coordinates.place(&at_start(p, by_run), largest, lengths);
            let places: Vec<_> = problem.passes.iter().map(place).collect();
            Kernel::new(&places, k.form_rank, k.kernel_rest)
        };
        let smooth = form_lengths(k);
        let smooth = (smooth, kernel(&smooth, false));
        let bends = effects.iter().filter_map(|&effect| Some((effect, effects::at(effect).acts?)));
        let bends = bends.flat_map(|(effect, acts)| {
            let over = (false, bend_lengths(k, acts.over));
            let runs = acts.by_run().then(|| (true, run_lengths(k)));
            [Some(over), runs].into_iter().flatten().map(move |(by_run, lengths)| (effect, by_run, lengths))
        });
        let bends = bends.map(|(effect, by_run, lengths)| {
            let kernel = kernel(&lengths, by_run);
            Bend { effect, by_run, lengths, kernel }
        });
        let bends = bends.filter(|bend| bend.kernel.rank() > 1).collect();
        let sizes = [false, true].map(|place| {
            let lengths = size_lengths(k, place);
            Some((lengths, kernel(&lengths, false))).filter(|(_, kernel)| kernel.rank() > 1)
        });
        Kernels { largest_amplitude: largest, smooth, bends, sizes, coordinates }
    }

    /// Temperature and humidity, where the smooth functions go over them.
    pub fn climate(&self) -> impl Iterator<Item = &'static Covariate> + '_ {
        self.coordinates.climate()
    }

    /// Their bases at passes.
    pub fn at(&self, passes: &[Condition]) -> Basis {
        self.of(passes, |_| true)
    }

    /// The bases that one hypothesis needs.
    pub fn for_members(&self, passes: &[Condition], members: &[Member]) -> Basis {
        self.of(passes, |effect| members.iter().any(|m| m.effect == effect))
    }

    fn of(&self, passes: &[Condition], needed: impl Fn(usize) -> bool) -> Basis {
        let basis = |(lengths, kernel): &(Lengths, Kernel)| {
            let place = |p: &Condition| self.coordinates.place(p, self.largest_amplitude, lengths);
            kernel.matrix(&passes.iter().map(place).collect::<Vec<_>>())
        };
        let mut bends: Vec<(usize, DMatrix<f64>)> = Vec::new();
        for bend in self.bends.iter().filter(|bend| needed(bend.effect)) {
            let place = |p: &Condition| bend.place(&self.coordinates, p, self.largest_amplitude);
            let columns = bend.kernel.matrix(&passes.iter().map(place).collect::<Vec<_>>());
            match bends.last_mut() {
                // The functions add.
                Some((effect, all)) if *effect == bend.effect => {
                    *all = beside_each_other(std::mem::take(all), &columns);
                }
                _ => bends.push((bend.effect, columns)),
            }
        }
        Basis {
            smooth: basis(&self.smooth),
            bends,
            sizes: self.sizes.each_ref().map(|of| of.as_ref().map(basis)),
        }
    }
}

/// The columns of one function and of another: the functions add.
fn beside_each_other(first: DMatrix<f64>, other: &DMatrix<f64>) -> DMatrix<f64> {
    let (before, more) = (first.ncols(), other.ncols());
    let mut all = first.resize_horizontally(before + more, 0.0);
    all.columns_mut(before, more).copy_from(other);
    all
}

/// Over the starts of the runs, so short that each run is apart.
fn run_lengths(k: &Constants) -> Lengths {
    Lengths { time: RUN_LENGTH, ..bend_lengths(k, &[&TIME]) }
}

/// Over the weather, and over the place too, as smooth as a departure from form.
fn size_lengths(k: &Constants, place: bool) -> Lengths {
    let (far, climate) = (f64::INFINITY, k.form_length);
    let position = if place { climate } else { far };
    Lengths { condition: far, time: far, position, climate, seen: [true; COUNT] }
}

/// Whether the size of an effect may go with the place: not where another effect of the library is that.
fn goes_with_place(effect: usize) -> bool {
    !effects::at(effect).acts.is_some_and(|acts| matches!(acts.on, Input::Amplitude | Input::Speed))
}

fn bend_lengths(k: &Constants, over: &[&Covariate]) -> Lengths {
    let place = over.iter().any(|c| c.role == Role::Place);
    Lengths {
        condition: if place { k.form_length } else { k.bend_length },
        time: k.bend_length,
        position: k.bend_place_length,
        climate: f64::INFINITY,
        seen: std::array::from_fn(|i| over.iter().any(|c| c.name == SMOOTH[i].name)),
    }
}

/// Values of the smooth functions at some passes.
#[derive(Debug, Clone)]
pub struct Basis {
    /// Over all covariates: a row a pass.
    pub smooth: DMatrix<f64>,
    bends: Vec<(usize, DMatrix<f64>)>,
    /// Over the weather, and over the place too.
    sizes: [Option<DMatrix<f64>>; 2],
}

impl Basis {
    /// Of no departure.
    pub fn none(passes: usize) -> Self {
        Basis { smooth: DMatrix::zeros(passes, 0), bends: Vec::new(), sizes: [None, None] }
    }

    /// Of some of the passes.
    pub fn select(&self, rows: &[usize]) -> Self {
        let of = |m: &DMatrix<f64>| m.select_rows(rows.iter());
        let bends = self.bends.iter().map(|(e, m)| (*e, of(m))).collect();
        Basis {
            smooth: of(&self.smooth),
            bends,
            sizes: self.sizes.each_ref().map(|sizes| sizes.as_ref().map(of)),
        }
    }

    fn of(&self, effect: usize, bends: Bends) -> Option<&DMatrix<f64>> {
        match bends {
            Bends::Input => self.bends.iter().find(|(e, _)| *e == effect).map(|(_, basis)| basis),
            Bends::Size => self.sizes[usize::from(goes_with_place(effect))].as_ref(),
        }
    }

    /// Whether a member of a hypothesis can be bent so.
    pub fn bends(&self, members: &[Member], bends: Bends) -> bool {
        members.iter().any(|m| self.of(m.effect, bends).is_some())
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
            let slope = slope(problem, members, u, prediction, (i, freedom.bends));
            let (Some(slope), Some(_)) = (slope, basis.of(member.effect, freedom.bends)) else { continue };
            let own = match members.len() {
                1 => raw.clone(),
                _ => prediction - without(problem, members, u, i),
            };
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
            Bends::Input => effects::at(b.effect)
                .acts
                .is_some_and(|acts| acts.over.iter().any(|c| c.name == covariate.name)),
            Bends::Size => match covariate.role {
                Role::Place => goes_with_place(b.effect),
                role => role == Role::Climate,
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
    Some(match bends {
        Bends::Input => {
            problem.sensitivity(members, u, prediction, effects::at(members[member].effect).acts?.on)
        }
        Bends::Size => problem.size_sensitivity(members, u, prediction, member),
    })
}

fn without(problem: &Problem, members: &[Member], u: &[f64], member: usize) -> DVector<f64> {
    let (mut rest, mut v) = (members.to_vec(), u.to_vec());
    rest.remove(member);
    v.drain(Layout::of(members).member(member));
    problem.predict(&rest, &v)
}

fn norm(problem: &Problem, force: &DVector<f64>) -> f64 {
    force.iter().zip(&problem.variance).map(|(x, v)| x * x / v).sum::<f64>().sqrt()
}

/// What recalibration cannot imitate of a force, to first order.
fn beside_recalibration(problem: &Problem, jacobian: &DMatrix<f64>, force: &DVector<f64>) -> DVector<f64> {
    let mut weighted = jacobian.clone();
    for (i, v) in problem.variance.iter().enumerate() {
        weighted.row_mut(i).scale_mut(1.0 / v);
    }
    let t = weighted.transpose();
    let hessian = &t * jacobian + DMatrix::identity(NUISANCES, NUISANCES);
    hessian.cholesky().map_or_else(|| force.clone(), |c| force - jacobian * c.solve(&(t * force)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Table;
    use crate::evidence::{averaged_over_form, laplace};
    use crate::example::{Deviates, rig, table};
    use crate::least_squares::minimise;
    use effects::{Baseline, by_name};

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
        crate::noise::settle(&table, &rig(), &mut problem, &crate::scatter::Belief::Judged);
        let effect = (0..effects::library().len())
            .find(|&e| effects::library()[e].name == by_name("resonance_detuning").map_or("", |e| e.name))
            .unwrap();
        let kernels = Kernels::on(&problem, Coordinates::of(&table), &[effect]);
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
        let (_, best) = averaged_over_form(&problem, &fit, &members, &basis);
        assert!(best.freedom.bend > 0.0 && best.by_law().freedom.bend == 0.0);
        // The verdict says that the law is not this.
        let report = crate::verdict::diagnose(&table, &rig(), &Default::default(), String::new()).report;
        assert!(report.hypotheses[0].effects == ["resonance_detuning"], "{}", report.text);
        let says = report
            .remarks
            .iter()
            .any(|r| r.contains("resonance detuning as a function of time of a free form"));
        assert!(says, "{:?}", report.remarks);
    }
}
