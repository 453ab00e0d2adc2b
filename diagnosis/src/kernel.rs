//! Smooth functions over the operating space: standardised covariates and a low-rank kernel on them.

use crate::data::Table;
use effects::Operating;
use nalgebra::DMatrix;

/// Which covariates a kernel sees, each with its length in standard deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lengths {
    /// Amplitude, frequency, speed, load, pressure.
    pub condition: f64,
    /// Time.
    pub time: f64,
    /// Position along the plate; infinite leaves it out.
    pub position: f64,
}

/// Standardised covariates of passes.
#[derive(Debug, Clone)]
pub struct Coordinates {
    mean: [f64; COUNT],
    sd: [f64; COUNT],
}

/// Deviations of a covariate beyond which a place counts as the edge of the design.
const EDGE_SD: f64 = 4.0;
/// Deviation of the logarithm of a regulated load below which it is noise.
const REGULATED_LOAD_SD: f64 = 0.08;
/// Number of covariates.
const COUNT: usize = 8;
const TIME: usize = 5;
const POSITION: usize = 6;

fn raw(p: &Operating, largest_amplitude: f64) -> [f64; COUNT] {
    let scale = (0.2 * largest_amplitude).max(1e-9);
    [
        (1.0 + p.amplitude_pp_m / scale).ln(),
        p.frequency_hz.ln(),
        p.speed_m_s.ln(),
        p.normal_force_n.ln(),
        p.ambient_pressure_pa.map_or(0.0, |v| v / 101_325.0),
        p.time_s,
        p.position_m,
        p.temperature_c.unwrap_or(0.0),
    ]
}

impl Coordinates {
    /// Mean and deviation of each covariate over the table.
    pub fn of(table: &Table) -> Self {
        let n = table.len() as f64;
        let rows: Vec<[f64; COUNT]> =
            table.passes.iter().map(|p| raw(p, table.design.largest_amplitude_m)).collect();
        let mut mean = [0.0; COUNT];
        let mut sd = [0.0; COUNT];
        for k in 0..COUNT {
            mean[k] = rows.iter().map(|r| r[k]).sum::<f64>() / n;
            sd[k] = (rows.iter().map(|r| (r[k] - mean[k]).powi(2)).sum::<f64>() / n).sqrt();
        }
        // Load is regulated: below a few per cent it carries no information, only noise.
        if sd[3] < REGULATED_LOAD_SD {
            sd[3] = 0.0;
        }
        // Temperature stands in for time only where it was measured; as a covariate it adds nothing smooth.
        sd[7] = 0.0;
        Self { mean, sd }
    }

    /// Standardised covariates divided by the lengths.
    pub fn place(&self, p: &Operating, largest_amplitude: f64, lengths: &Lengths) -> [f64; COUNT] {
        let r = raw(p, largest_amplitude);
        std::array::from_fn(|k| {
            let length = match k {
                TIME => lengths.time,
                POSITION => lengths.position,
                _ => lengths.condition,
            };
            if self.sd[k] > 1e-12 && length.is_finite() {
                // What lies far outside the design counts as its edge.
                ((r[k] - self.mean[k]) / self.sd[k]).clamp(-EDGE_SD, EDGE_SD) / length
            } else {
                0.0
            }
        })
    }
}

/// A squared-exponential kernel, represented by pivots chosen by incomplete Cholesky.
#[derive(Debug, Clone)]
pub struct Kernel {
    pivots: Vec<[f64; COUNT]>,
    /// Lower triangle of the factor at the pivots.
    factor: DMatrix<f64>,
}

fn correlation(a: &[f64; COUNT], b: &[f64; COUNT]) -> f64 {
    let d: f64 = a.iter().zip(b).map(|(x, y)| (x - y) * (x - y)).sum();
    (-0.5 * d).exp()
}

impl Kernel {
    /// Chooses at most `rank` pivots among the places, until no place has more than `rest` variance left.
    pub fn new(places: &[[f64; COUNT]], rank: usize, rest: f64) -> Self {
        let n = places.len();
        let mut left = vec![1.0f64; n];
        let mut columns: Vec<Vec<f64>> = Vec::new();
        let mut chosen: Vec<usize> = Vec::new();
        for _ in 0..rank.min(n) {
            let (pivot, &top) = left
                .iter()
                .enumerate()
                .max_by(|a, b| a.1.total_cmp(b.1).then(b.0.cmp(&a.0)))
                .expect("a table has passes");
            if top < rest {
                break;
            }
            let root = top.sqrt();
            let column: Vec<f64> = (0..n)
                .map(|i| {
                    let k = correlation(&places[i], &places[pivot]);
                    let seen: f64 = columns.iter().map(|c| c[i] * c[pivot]).sum();
                    (k - seen) / root
                })
                .collect();
            for i in 0..n {
                left[i] = (left[i] - column[i] * column[i]).max(0.0);
            }
            left[pivot] = 0.0;
            chosen.push(pivot);
            columns.push(column);
        }
        let r = chosen.len();
        let factor = DMatrix::from_fn(r, r, |i, j| if j <= i { columns[j][chosen[i]] } else { 0.0 });
        Self { pivots: chosen.iter().map(|&i| places[i]).collect(), factor }
    }

    /// Number of smooth directions.
    pub fn rank(&self) -> usize {
        self.pivots.len()
    }

    /// Values of the basis at a place: `basis . basis'` approximates the kernel.
    pub fn basis(&self, place: &[f64; COUNT]) -> Vec<f64> {
        let r = self.rank();
        let mut row = vec![0.0; r];
        for i in 0..r {
            let mut v = correlation(place, &self.pivots[i]);
            for j in 0..i {
                v -= row[j] * self.factor[(i, j)];
            }
            row[i] = v / self.factor[(i, i)];
        }
        row
    }

    /// The basis at many places, a row each.
    pub fn matrix(&self, places: &[[f64; COUNT]]) -> DMatrix<f64> {
        let rows: Vec<Vec<f64>> = places.iter().map(|p| self.basis(p)).collect();
        DMatrix::from_fn(places.len(), self.rank(), |i, j| rows[i][j])
    }
}
