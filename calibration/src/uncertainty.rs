//! Measurement uncertainty by the GUM (JCGM 100:2008) and its Supplement 1 (JCGM 101:2008).
//!
//! [`Budget::propagate`] is the law of propagation with correlated inputs (GUM Eq. 13, 16), effective
//! degrees of freedom by Welch-Satterthwaite (Eq. G.2b), and on request the second-order terms of the note
//! to GUM 5.1.2. [`monte_carlo`] is the check that Supplement 1 asks for, with the generator passed in.
//! Worked examples H.1, H.2, H.3 and Supplement 1's 9.3 are reproduced in `tests/gum.rs`.

pub mod monte_carlo;
pub mod student;

use nalgebra::DMatrix;

/// The distribution that Supplement 1 draws an input from (its Table 1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Distribution {
    /// Gaussian.
    Normal,
    /// Scaled and shifted t with the input's degrees of freedom: the standard uncertainty is its SCALE,
    /// as in Supplement 1, 6.4.9.
    Student,
    /// Equal density within `value +- sqrt(3) u`.
    Rectangular,
    /// U-shaped, of a cyclic change, within `value +- sqrt(2) u`.
    Arcsine,
}

/// One input quantity of a measurement model.
#[derive(Clone, Debug, PartialEq)]
pub struct Input {
    /// Its name in the budget.
    pub name: String,
    /// Best estimate.
    pub value: f64,
    /// Standard uncertainty, in the unit of the value.
    pub standard_uncertainty: f64,
    /// Degrees of freedom of that uncertainty; infinite where it is taken as known.
    pub degrees_of_freedom: f64,
    /// What Supplement 1 draws from.
    pub distribution: Distribution,
}

impl Input {
    /// A Gaussian input, for example from a certificate.
    pub fn normal(name: &str, value: f64, standard_uncertainty: f64) -> Self {
        Input {
            name: name.into(),
            value,
            standard_uncertainty,
            degrees_of_freedom: f64::INFINITY,
            distribution: Distribution::Normal,
        }
    }

    /// Equal density within `value +- half_width` (GUM 4.3.7): `u = half_width / sqrt(3)`.
    pub fn rectangular(name: &str, value: f64, half_width: f64) -> Self {
        Input {
            distribution: Distribution::Rectangular,
            ..Self::normal(name, value, half_width / 3f64.sqrt())
        }
    }

    /// A cyclic change of that amplitude (GUM H.1.3.4): `u = amplitude / sqrt(2)`.
    pub fn arcsine(name: &str, value: f64, amplitude: f64) -> Self {
        Input { distribution: Distribution::Arcsine, ..Self::normal(name, value, amplitude / 2f64.sqrt()) }
    }

    /// The mean of repeated observations with its type A uncertainty (GUM 4.2).
    /// With fewer than two observations the uncertainty is infinite: nothing is known of the scatter.
    pub fn type_a(name: &str, observations: &[f64]) -> Self {
        let n = observations.len() as f64;
        let mean = observations.iter().sum::<f64>() / n;
        let variance = observations.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
        let u = if n < 2.0 { f64::INFINITY } else { (variance / n).sqrt() };
        Input {
            degrees_of_freedom: n - 1.0,
            distribution: Distribution::Student,
            ..Self::normal(name, mean, u)
        }
    }

    /// With these degrees of freedom, for instance from [`degrees_of_freedom_of_reliability`].
    pub fn with_degrees_of_freedom(self, degrees_of_freedom: f64) -> Self {
        Input { degrees_of_freedom, ..self }
    }
}

/// Degrees of freedom of an uncertainty that is itself known to a relative `reliability` (GUM Eq. G.3).
pub fn degrees_of_freedom_of_reliability(reliability: f64) -> f64 {
    0.5 / (reliability * reliability)
}

/// Inputs with their correlation.
#[derive(Clone, Debug, PartialEq)]
pub struct Budget {
    inputs: Vec<Input>,
    correlation: DMatrix<f64>,
}

/// A measurement model: the result as a function of the inputs.
pub type Model<'a> = dyn Fn(&[f64]) -> f64 + 'a;

/// One line of an uncertainty budget.
#[derive(Clone, Debug, PartialEq)]
pub struct Contribution {
    /// The input's name.
    pub name: String,
    /// Sensitivity coefficient, the partial derivative of the result by this input.
    pub sensitivity: f64,
    /// `|sensitivity| * standard uncertainty`, in the unit of the result.
    pub standard_uncertainty: f64,
}

/// A result with its uncertainty.
#[derive(Clone, Debug, PartialEq)]
pub struct Uncertain {
    /// Best estimate.
    pub value: f64,
    /// Combined standard uncertainty.
    pub standard_uncertainty: f64,
    /// Effective degrees of freedom (Welch-Satterthwaite); infinite where all inputs' are.
    pub degrees_of_freedom: f64,
    /// The budget, in the order of the inputs.
    pub contributions: Vec<Contribution>,
}

impl Uncertain {
    /// Half-width of the interval of that coverage probability: `t_p(nu) u` (GUM G.4.1).
    /// As the GUM does, the effective degrees of freedom are truncated to the next lower integer.
    pub fn expanded(&self, coverage: f64) -> f64 {
        student::coverage_factor(coverage, self.degrees_of_freedom.floor()) * self.standard_uncertainty
    }

    /// The interval `value +- expanded`.
    pub fn interval(&self, coverage: f64) -> [f64; 2] {
        let half = self.expanded(coverage);
        [self.value - half, self.value + half]
    }
}

impl Budget {
    /// Independent inputs.
    pub fn independent(inputs: Vec<Input>) -> Self {
        let n = inputs.len();
        Budget { inputs, correlation: DMatrix::identity(n, n) }
    }

    /// Inputs observed together: means, uncertainties of the means and their correlation (GUM 5.2.3).
    pub fn observed_together(names: &[&str], observations: &[&[f64]]) -> Self {
        let inputs: Vec<Input> =
            names.iter().zip(observations).map(|(name, o)| Input::type_a(name, o)).collect();
        let n = inputs.len();
        let correlation = DMatrix::from_fn(n, n, |a, b| {
            let (x, y) = (observations[a], observations[b]);
            let count = x.len().min(y.len()) as f64;
            let product: f64 =
                x.iter().zip(y).map(|(p, q)| (p - inputs[a].value) * (q - inputs[b].value)).sum();
            let mean_covariance = product / (count * (count - 1.0));
            mean_covariance / (inputs[a].standard_uncertainty * inputs[b].standard_uncertainty)
        });
        Budget { inputs, correlation }
    }

    /// Sets one correlation coefficient.
    pub fn correlate(&mut self, a: usize, b: usize, coefficient: f64) {
        self.correlation[(a, b)] = coefficient;
        self.correlation[(b, a)] = coefficient;
    }

    /// The inputs.
    pub fn inputs(&self) -> &[Input] {
        &self.inputs
    }

    /// Correlation coefficients of the inputs.
    pub fn correlation(&self) -> &DMatrix<f64> {
        &self.correlation
    }

    /// First-order propagation through `model`.
    pub fn propagate(&self, model: impl Fn(&[f64]) -> f64) -> Uncertain {
        let sensitivities = self.sensitivities(&model);
        let parts: Vec<f64> =
            sensitivities.iter().zip(&self.inputs).map(|(c, x)| c * x.standard_uncertainty).collect();
        let mut variance = 0.0;
        for a in 0..parts.len() {
            for b in 0..parts.len() {
                variance += parts[a] * parts[b] * self.correlation[(a, b)];
            }
        }
        let fourth: f64 = parts.iter().zip(&self.inputs).map(|(p, x)| p.powi(4) / x.degrees_of_freedom).sum();
        let degrees_of_freedom = if fourth > 0.0 { variance * variance / fourth } else { f64::INFINITY };
        Uncertain {
            value: model(&self.values()),
            standard_uncertainty: variance.max(0.0).sqrt(),
            degrees_of_freedom,
            contributions: (0..parts.len())
                .map(|i| Contribution {
                    name: self.inputs[i].name.clone(),
                    sensitivity: sensitivities[i],
                    standard_uncertainty: parts[i].abs(),
                })
                .collect(),
        }
    }

    /// Several results of the same inputs with their covariance matrix (GUM H.2.3).
    pub fn propagate_jointly(&self, models: &[&Model]) -> (Vec<Uncertain>, DMatrix<f64>) {
        let results: Vec<Uncertain> = models.iter().map(|m| self.propagate(m)).collect();
        let part = |i: usize, a: usize| {
            results[i].contributions[a].sensitivity * self.inputs[a].standard_uncertainty
        };
        let n = self.inputs.len();
        let covariance = DMatrix::from_fn(models.len(), models.len(), |i, j| {
            (0..n)
                .flat_map(|a| (0..n).map(move |b| (a, b)))
                .map(|(a, b)| part(i, a) * part(j, b) * self.correlation[(a, b)])
                .sum()
        });
        (results, covariance)
    }

    /// The variance that the next order of the Taylor series adds for independent Gaussian inputs
    /// (note to GUM 5.1.2). Where it is not small beside the first order, use [`monte_carlo`].
    pub fn second_order_variance(&self, model: impl Fn(&[f64]) -> f64) -> f64 {
        let n = self.inputs.len();
        let u: Vec<f64> = self.inputs.iter().map(|x| x.standard_uncertainty).collect();
        // Finite differences over a tenth of each uncertainty, so that the next order stays out of them;
        // every difference is scaled back to one whole uncertainty.
        const STEP: f64 = 0.1;
        let at = |moves: &[(usize, f64)]| {
            let mut x = self.values();
            for &(i, steps) in moves {
                x[i] += steps * STEP * u[i];
            }
            model(&x)
        };
        let first = |i: usize, around: &[(usize, f64)]| {
            let with = |s| at(&[around, &[(i, s)]].concat());
            (with(1.0) - with(-1.0)) / (2.0 * STEP)
        };
        let second = |i: usize, j: usize| {
            if i == j {
                (at(&[(i, 1.0)]) - 2.0 * at(&[]) + at(&[(i, -1.0)])) / (STEP * STEP)
            } else {
                (first(i, &[(j, 1.0)]) - first(i, &[(j, -1.0)])) / (2.0 * STEP)
            }
        };
        let third = |i: usize, j: usize| {
            if i == j {
                (at(&[(i, 2.0)]) - 2.0 * at(&[(i, 1.0)]) + 2.0 * at(&[(i, -1.0)]) - at(&[(i, -2.0)]))
                    / (2.0 * STEP.powi(3))
            } else {
                (first(i, &[(j, 1.0)]) - 2.0 * first(i, &[]) + first(i, &[(j, -1.0)])) / (STEP * STEP)
            }
        };
        (0..n)
            .flat_map(|i| (0..n).map(move |j| (i, j)))
            .map(|(i, j)| 0.5 * second(i, j).powi(2) + first(i, &[]) * third(i, j))
            .sum()
    }

    fn values(&self) -> Vec<f64> {
        self.inputs.iter().map(|x| x.value).collect()
    }

    /// Central differences over the uncertainty with one Richardson step: exact for cubics.
    fn sensitivities(&self, model: &impl Fn(&[f64]) -> f64) -> Vec<f64> {
        let mut x = self.values();
        (0..x.len())
            .map(|i| {
                let (middle, u) = (x[i], self.inputs[i].standard_uncertainty);
                let h = if u > 0.0 && u.is_finite() { u } else { 1e-6 * middle.abs().max(1e-6) };
                let mut difference = |h: f64| {
                    x[i] = middle + h;
                    let up = model(&x);
                    x[i] = middle - h;
                    let down = model(&x);
                    x[i] = middle;
                    (up - down) / (2.0 * h)
                };
                (4.0 * difference(h / 2.0) - difference(h)) / 3.0
            })
            .collect()
    }
}
