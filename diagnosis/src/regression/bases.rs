//! The smooth functions by which hypotheses depart, on one table: kernels, and their values at passes.
//! docs/diagnosis/model.md, section 5.

use crate::constants::Constants;
use crate::data::Table;
use crate::regression::{COUNT, Coordinates, Kernel, Lengths, Member, Problem, form_lengths};
use effects::Input;
use models::Condition;
use models::covariate::{Covariate, CovariateRole, SMOOTH, TIME};
use nalgebra::DMatrix;

/// Correlation length over the starts of runs, in standard deviations of time; each run is apart.
const RUN_LENGTH: f64 = 0.02;

/// What a cause's function replaces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bends {
    /// What the cause acts on, over the covariates of its mechanism ([`effects::Acts`]).
    Input,
    /// Its size, over the weather and, where no other effect is that, over the place: a stiffness that is
    /// another along the plate, a damping that falls as it warms.
    Size,
}

/// The kernels of all departures on one table.
#[derive(Debug, Clone)]
pub struct Kernels {
    coordinates: Coordinates,
    /// With the weather that goes with time too: sizes do not go over time.
    weather: Coordinates,
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

/// The condition at the start of its run.
fn at_start(p: &Condition, by_run: bool) -> Condition {
    let since = if by_run { p.time_in_run_s() } else { 0.0 };
    Condition { time_s: p.time_s - since, ..*p }
}

impl Kernels {
    /// The kernels on a table's passes, for these effects.
    pub fn on(problem: &Problem, table: &Table, effects: &[usize]) -> Self {
        let k = &problem.constants;
        let (coordinates, weather) = (Coordinates::of(table), Coordinates::from(table, 0.0));
        let over = |coordinates: &Coordinates, lengths: &Lengths, by_run: bool| {
            let place = |p: &Condition| coordinates.place(&at_start(p, by_run), lengths);
            let places: Vec<_> = problem.passes.iter().map(place).collect();
            Kernel::new(&places, k.form_rank, k.kernel_rest)
        };
        let kernel = |lengths: &Lengths, by_run: bool| over(&coordinates, lengths, by_run);
        let smooth = form_lengths(k);
        let smooth = (smooth, kernel(&smooth, false));
        let bends = effects.iter().filter_map(|&effect| Some((effect, effects::at(effect).acts?)));
        let bends = bends.flat_map(|(effect, acts)| {
            let over = (false, bend_lengths(k, acts.over));
            let runs =
                acts.by_run().then(|| (true, Lengths { time: RUN_LENGTH, ..bend_lengths(k, &[&TIME]) }));
            [Some(over), runs].into_iter().flatten().map(move |(by_run, lengths)| (effect, by_run, lengths))
        });
        let bends = bends.map(|(effect, by_run, lengths)| {
            let kernel = kernel(&lengths, by_run);
            Bend { effect, by_run, lengths, kernel }
        });
        let bends = bends.filter(|bend| bend.kernel.rank() > 1).collect();
        let sizes = [false, true].map(|place| {
            // Over the weather, and over the place too, as smooth as a departure from form.
            let (far, climate) = (f64::INFINITY, k.form_length);
            let position = if place { climate } else { far };
            let lengths = Lengths { condition: far, time: far, position, climate, seen: [true; COUNT] };
            Some((lengths, over(&weather, &lengths, false))).filter(|(_, kernel)| kernel.rank() > 1)
        });
        Kernels { smooth, bends, sizes, coordinates, weather }
    }

    /// Temperature and humidity, where sizes go over them.
    pub fn climate(&self) -> impl Iterator<Item = &'static Covariate> + '_ {
        self.weather.climate()
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
        let basis = |coordinates: &Coordinates, (lengths, kernel): &(Lengths, Kernel)| {
            let place = |p: &Condition| coordinates.place(p, lengths);
            kernel.matrix(&passes.iter().map(place).collect::<Vec<_>>())
        };
        let mut bends: Vec<(usize, DMatrix<f64>)> = Vec::new();
        for bend in self.bends.iter().filter(|bend| needed(bend.effect)) {
            let place = |p: &Condition| self.coordinates.place(&at_start(p, bend.by_run), &bend.lengths);
            let columns = bend.kernel.matrix(&passes.iter().map(place).collect::<Vec<_>>());
            match bends.last_mut() {
                // The functions add.
                Some((effect, all)) if *effect == bend.effect => *all = beside_each_other(all, &columns),
                _ => bends.push((bend.effect, columns)),
            }
        }
        Basis {
            smooth: basis(&self.coordinates, &self.smooth),
            bends,
            sizes: self.sizes.each_ref().map(|of| of.as_ref().map(|of| basis(&self.weather, of))),
        }
    }
}

/// The columns of one matrix, and after them those of another.
pub(crate) fn beside_each_other(first: &DMatrix<f64>, other: &DMatrix<f64>) -> DMatrix<f64> {
    let (before, more) = (first.ncols(), other.ncols());
    let mut all = first.clone().resize_horizontally(before + more, 0.0);
    all.columns_mut(before, more).copy_from(other);
    all
}

/// Whether the size of an effect may go with the place: not where another effect of the library is that.
pub(crate) fn goes_with_place(effect: usize) -> bool {
    !effects::at(effect).acts.is_some_and(|acts| matches!(acts.on, Input::Amplitude | Input::Speed))
}

fn bend_lengths(k: &Constants, over: &[&Covariate]) -> Lengths {
    let place = over.iter().any(|c| c.role == CovariateRole::Place);
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
        let sizes = self.sizes.each_ref().map(|sizes| sizes.as_ref().map(of));
        Basis { smooth: of(&self.smooth), bends, sizes }
    }

    pub(crate) fn of(&self, effect: usize, bends: Bends) -> Option<&DMatrix<f64>> {
        match bends {
            Bends::Input => self.bends.iter().find(|(e, _)| *e == effect).map(|(_, basis)| basis),
            // A linear map of the readings: what is linear in its size departs from no form.
            Bends::Size if effects::at(effect).departs_by < 1.0 => None,
            Bends::Size => self.sizes[usize::from(goes_with_place(effect))].as_ref(),
        }
    }

    /// Whether a member of a hypothesis can be bent so.
    pub fn bends(&self, members: &[Member], bends: Bends) -> bool {
        members.iter().any(|m| self.of(m.effect, bends).is_some())
    }
}
