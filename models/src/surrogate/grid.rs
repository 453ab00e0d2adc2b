//! The axes of the table and the cases on them.

use crate::quantity::PeakToPeak;
use crate::ridge::study::{content_key, fnv1a};
use crate::ridge::{RidgeCase, RunSettings};

/// A logarithmic axis with equal ratios.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridAxis {
    /// Least value.
    pub low: f64,
    /// Greatest value.
    pub high: f64,
    /// Number of values, two or more.
    pub count: usize,
}

impl GridAxis {
    /// Place on the axis: 0 at the low end, 1 at the high end.
    #[inline]
    pub fn place(&self, value: f64) -> f64 {
        (value.max(1e-300) / self.low).ln() / (self.high / self.low).ln()
    }

    /// Value at a place.
    pub fn value(&self, place: f64) -> f64 {
        self.low * (self.high / self.low).powf(place)
    }

    /// The `i`th value.
    pub fn node(&self, i: usize) -> f64 {
        self.value(i as f64 / (self.count - 1) as f64)
    }
}

/// The table's axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurrogateGrid {
    /// E_sc in Pa.
    pub young_modulus_pa: GridAxis,
    /// F_n in N.
    pub normal_force_n: GridAxis,
    /// f in Hz.
    pub frequency_hz: GridAxis,
    /// U/mu_0 in m/s.
    pub speed_over_mu0_m_s: GridAxis,
    /// Amplitudes in a column.
    pub amplitudes: usize,
}

/// One case of the table.
#[derive(Clone, Debug, PartialEq)]
pub struct GridPoint {
    /// Places on the axes: modulus, force, frequency, speed, amplitude, each 0 to 1.
    pub place: [f64; 5],
    /// Whether it is a case at rest, for phase and contact.
    pub at_rest: bool,
    /// The case.
    pub case: RidgeCase,
}

impl SurrogateGrid {
    /// The axes of the shipped table.
    pub const SHIPPED: SurrogateGrid = SurrogateGrid {
        // From the paper's softest skin to a little beyond its dry finger (202.4 MPa).
        young_modulus_pa: GridAxis { low: 20e6, high: 210e6, count: 5 },
        normal_force_n: GridAxis { low: 0.1, high: 1.0, count: 3 },
        frequency_hz: GridAxis { low: 10e3, high: 100e3, count: 5 },
        speed_over_mu0_m_s: GridAxis { low: 0.0025, high: 1.0, count: 6 },
        amplitudes: 9,
    };

    /// Elements of the table's mesh.
    pub const ELEMENTS: usize = 256;
    /// mu_0 of the table's cases; the speed goes with it.
    pub const MU0: f64 = 0.5;

    /// Amplitudes (peak-to-peak, m) at which a column begins and ends. It begins below the loss of contact,
    /// which comes earlier at high frequency (inertia and damping) and later under a higher pressure.
    pub fn amplitude_range_m(&self, frequency_hz: f64, normal_force_n: f64) -> (f64, f64) {
        let first = 0.35e-6 * (27_500.0 / frequency_hz).powf(0.75) * (normal_force_n / 0.25).cbrt();
        (first.min(4e-6), 5.5e-6)
    }

    /// How the table's cases are run.
    pub fn settings() -> RunSettings {
        RunSettings { energy: false, one_step: true, added_mass: 0.0, ..RunSettings::default() }
    }

    /// The case at a place (see [`GridPoint::place`]).
    pub fn case(&self, place: [f64; 5], at_rest: bool) -> RidgeCase {
        let force = self.normal_force_n.value(place[1]);
        let frequency_hz = self.frequency_hz.value(place[2]);
        let speed = if at_rest { 0.0 } else { self.speed_over_mu0_m_s.value(place[3]) };
        let (first, last) = self.amplitude_range_m(frequency_hz, force);
        RidgeCase {
            amplitude: PeakToPeak::from_metres(first * (last / first).powf(place[4])),
            frequency_hz,
            speed_m_s: speed * Self::MU0,
            mu0: Self::MU0,
            young_modulus_pa: self.young_modulus_pa.value(place[0]),
            elements: Self::ELEMENTS,
            ..RidgeCase::paper().with_normal_force_n(force)
        }
    }

    /// The logarithmic axes by name.
    pub fn axes(&self) -> [(&'static str, GridAxis); 4] {
        [
            ("young_modulus_pa", self.young_modulus_pa),
            ("normal_force_n", self.normal_force_n),
            ("frequency_hz", self.frequency_hz),
            ("speed_over_mu0_m_s", self.speed_over_mu0_m_s),
        ]
    }

    /// Counts along the axes: modulus, force, frequency, speed, amplitude; for friction, or at rest.
    pub fn shape(&self, at_rest: bool) -> [usize; 5] {
        [
            self.young_modulus_pa.count,
            self.normal_force_n.count,
            self.frequency_hz.count,
            if at_rest { 1 } else { self.speed_over_mu0_m_s.count },
            self.amplitudes,
        ]
    }

    /// All cases: those at rest first (speed axis left out), then those sliding; the last axis fastest.
    pub fn points(&self) -> Vec<GridPoint> {
        let share = |i: usize, n: usize| if n > 1 { i as f64 / (n - 1) as f64 } else { 0.0 };
        let mut points = Vec::new();
        for at_rest in [true, false] {
            let shape = self.shape(at_rest);
            for index in 0..shape.iter().product() {
                let mut rest: usize = index;
                let mut place = [0.0; 5];
                for axis in (0..5).rev() {
                    place[axis] = share(rest % shape[axis], shape[axis]);
                    rest /= shape[axis];
                }
                points.push(GridPoint { place, at_rest, case: self.case(place, at_rest) });
            }
        }
        points
    }

    /// Cases that are not in the table, spread over it evenly (a Kronecker sequence), alternately at rest.
    pub fn held_out(&self, count: usize) -> Vec<GridPoint> {
        // Powers of the root of x^6 = x + 1 make a low-discrepancy sequence in five dimensions.
        let root = 1.134_724_138_401_519_5_f64;
        (1..=count)
            .map(|n| {
                let place: [f64; 5] =
                    std::array::from_fn(|d| (0.5 + n as f64 / root.powi(d as i32 + 1)).fract());
                let at_rest = n.is_multiple_of(4);
                GridPoint { place, at_rest, case: self.case(place, at_rest) }
            })
            .collect()
    }

    /// Hash of all that the table is computed from.
    pub fn inputs_hash(&self) -> String {
        let settings = Self::settings();
        let keys: String = self.points().iter().map(|p| content_key(&p.case, &settings)).collect();
        format!("{:016x}", fnv1a(keys.as_bytes()))
    }
}
