//! Bonds that form while skin and plate touch, and so raise the friction limit in the course of a contact.

/// How bonds grow after touch-down.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Bonds {
    /// All are there at once: the baseline.
    #[default]
    AtOnce,
    /// A share of the limit waits, and `1 - share exp(-(t/time)^exponent)` of it is there after `t`.
    Stretched {
        /// Bonding time, s.
        time: f64,
        /// Share of the limit that waits.
        share: f64,
        /// 1: first order; below, many rates.
        exponent: f64,
    },
    /// The same of first order, where bonds form by the normal force of the instant over its mean.
    Pressed {
        /// Bonding time at the mean force, s.
        time: f64,
        /// Share of the limit that waits.
        share: f64,
    },
    /// The limit grows by the logarithm of the junctions' age, and sliding renews them (ageing law; Dieterich
    /// 1979, Ruina 1983): `1 + strength ln((age + time)/(steady + time))` of that in steady sliding, where
    /// the age is `steady (1 - exp(-t/steady))`.
    Renewed {
        /// Growth for a factor of e of the age.
        strength: f64,
        /// Age below which it grows no slower, s.
        time: f64,
        /// Age in steady sliding: slip distance over speed, s.
        steady: f64,
    },
}

impl Bonds {
    /// Share of the friction limit that is there: after so long in contact (s), and so much pressing (the
    /// integral of the normal force over its mean, s).
    pub(super) fn grown(&self, touched: f64, pressed: f64) -> f64 {
        match *self {
            Bonds::AtOnce => 1.0,
            Bonds::Stretched { time, share, exponent } => {
                let age = touched / time;
                let age = if exponent == 1.0 { age } else { age.powf(exponent) };
                1.0 - share * (-age).exp()
            }
            Bonds::Pressed { time, share } => 1.0 - share * (-pressed / time).exp(),
            Bonds::Renewed { strength, time, steady } => {
                let age = -steady * (-touched / steady).exp_m1();
                (1.0 + strength * ((age + time) / (steady + time)).ln()).max(0.0)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ruina (1983), the ageing law at constant speed: `d age/dt = 1 - age U/D` from zero, by Euler's steps.
    #[test]
    fn a_renewed_junction_follows_the_ageing_law() {
        let (strength, time, steady, step) = (0.2, 1e-6, 2e-5, 1e-9);
        let mut age = 0.0;
        for i in 0..40_000 {
            let there = Bonds::Renewed { strength, time, steady }.grown(f64::from(i) * step, 0.0);
            let by_steps = 1.0 + strength * ((age + time) / (steady + time)).ln();
            assert!((there - by_steps).abs() < 1e-4, "{there} and {by_steps} after step {i}");
            age += step * (1.0 - age / steady);
        }
        let late = Bonds::Renewed { strength, time, steady }.grown(1.0, 0.0);
        assert!((late - 1.0).abs() < 1e-12, "in steady sliding nothing changes: {late}");
    }
}
