//! The resolved contact, averaged over cycles and remembered.
//!
//! A control loop at 1 kHz sees some thirty cycles of the plate a step; solving them at every step costs more
//! time than the step has. The mean friction is therefore computed once for each cell of the contact's
//! operating space, with its slopes in amplitude, speed, load and friction, and read from there. A cell is
//! computed on its second request in a row; what is passed through (a plate ringing up, a stiffness that
//! drifts) is solved directly. Cells are stored in a table of fixed size: nothing is allocated while the
//! world runs, and what a cell holds does not depend on what was read before. [`CELL`] sets the error;
//! `averaging_error` in the tests measures it.

use super::resolved::{self, MarchSettings};
use super::{Contact, Steady};

/// Width of a cell in the logarithm of each variable.
pub const CELL: f64 = 0.02;
const CELLS: usize = 1024;
/// Variables with a slope.
const SLOPES: usize = 4;

#[derive(Clone, Copy)]
struct Cell {
    key: [i64; SLOPES],
    rest: Contact,
    /// Mean lateral force over `mu0 F_n` at the centre, and the contact share.
    centre: [f64; 2],
    slope: [f64; SLOPES],
}

/// A memory of cycle averages.
pub struct Averager {
    cells: Vec<Option<Cell>>,
    last: Option<([i64; SLOPES], Contact)>,
}

impl Default for Averager {
    fn default() -> Self {
        Self { cells: vec![None; CELLS], last: None }
    }
}

fn variables(contact: &Contact) -> [f64; SLOPES] {
    [
        contact.sine_amplitude_m.max(1e-10).ln(),
        contact.speed_m_s.max(1e-6).ln(),
        contact.normal_force_n.max(1e-4).ln(),
        contact.friction.max(1e-6).ln(),
    ]
}

fn with(contact: &Contact, ln: [f64; SLOPES]) -> Contact {
    let [sine_amplitude_m, speed_m_s, normal_force_n, friction] = ln.map(f64::exp);
    Contact { sine_amplitude_m, speed_m_s, normal_force_n, friction, ..*contact }
}

fn share(contact: &Contact) -> [f64; 2] {
    let steady = contact.steady();
    [steady.lateral_force_n / (contact.friction * contact.normal_force_n), steady.contact_fraction]
}

impl Averager {
    /// The cycle-averaged contact.
    pub fn steady(&mut self, contact: &Contact) -> Steady {
        if contact.sine_amplitude_m < 1e-9 || contact.normal_force_n < 1e-3 {
            return contact.steady();
        }
        let ln = variables(contact);
        let key = ln.map(|x| (x / CELL).round() as i64);
        let rest = with(contact, [0.0; SLOPES]);
        let mixed = key
            .iter()
            .fold(0_u64, |h, k| (h ^ (*k as u64)).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29));
        let slot = (mixed.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 54) as usize % CELLS;
        let again = self.last.replace((key, rest)) == Some((key, rest));
        let cell = match self.cells[slot] {
            Some(cell) if cell.key == key && cell.rest == rest => cell,
            _ if again => {
                let cell = Self::compute(contact, key, rest);
                self.cells[slot] = Some(cell);
                cell
            }
            // An instant that is passed through: a ridge with mass is marched for fewer cycles.
            _ if contact.has_inertia() && contact.motion.modulation == 0.0 => {
                let settings = MarchSettings { settle: 18, average: 6, ..MarchSettings::default() };
                return resolved::steady(contact, settings).steady;
            }
            _ => return contact.steady(),
        };
        let mut ratio = cell.centre[0];
        for i in 0..SLOPES {
            ratio += cell.slope[i] * (ln[i] - key[i] as f64 * CELL);
        }
        Steady {
            lateral_force_n: ratio.max(0.0) * contact.friction * contact.normal_force_n,
            contact_fraction: cell.centre[1],
        }
    }

    fn compute(contact: &Contact, key: [i64; SLOPES], rest: Contact) -> Cell {
        let ln = key.map(|k| k as f64 * CELL);
        let centre = share(&with(contact, ln));
        let mut slope = [0.0; SLOPES];
        for i in 0..SLOPES {
            let (mut up, mut down) = (ln, ln);
            up[i] += 0.5 * CELL;
            down[i] -= 0.5 * CELL;
            slope[i] = (share(&with(contact, up))[0] - share(&with(contact, down))[0]) / CELL;
        }
        Cell { key, rest, centre, slope }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rms and worst error over the operating space of a sweep, relative to the friction limit mu0 F_n.
    fn error(n: usize, change: impl Fn(&mut Contact)) -> (f64, f64) {
        let mut averager = Averager::default();
        let (mut worst, mut square) = (0.0_f64, 0.0);
        for i in 0..n {
            let t = i as f64 / n as f64;
            let a = 0.2e-6 * 12.0_f64.powf((t * 7.0).fract());
            let mut contact =
                Contact::ideal(3.9e6, 1.5e6, 0.5, 0.15 + 0.6 * (t * 3.0).fract(), a, 27_500.0, 0.0);
            contact.speed_m_s = 0.01 * 20.0_f64.powf((t * 11.0).fract());
            change(&mut contact);
            let exact = contact.steady().lateral_force_n;
            let key = variables(&contact).map(|x| (x / CELL).round() as i64);
            let holds = |averager: &Averager| averager.cells.iter().flatten().any(|cell| cell.key == key);
            averager.steady(&contact);
            assert!(!holds(&averager), "{i}: a cell is computed on its second request in a row");
            let averaged = averager.steady(&contact).lateral_force_n;
            assert!(holds(&averager), "{i}: a cell is remembered");
            let error = (averaged - exact) / (contact.friction * contact.normal_force_n);
            worst = worst.max(error.abs());
            square += error * error;
        }
        let rms = f64::sqrt(square / n as f64);
        println!("averaged against solved: rms {rms:.2e}, worst {worst:.2e} of mu0 Fn, n {n}");
        (rms, worst)
    }

    #[test]
    fn averaging_error() {
        let (rms, worst) = error(400, |_| {});
        assert!(rms < 2e-4 && worst < 2e-3, "massless: rms {rms}, worst {worst}");
        let (rms, worst) = error(80, |contact| {
            contact.ridge.mass_kg = 1e-6;
            contact.ridge.damping_n_s_per_m = 0.6 * (3.9e6_f64 * 1e-6).sqrt();
        });
        assert!(rms < 4e-3 && worst < 2e-2, "with mass: rms {rms}, worst {worst}");
    }
}
