//! Forces in virtual time in the counts of a setup's instruments, of which a force certificate speaks.

use crate::setup::SetupFile;
use instruments::{Profile, SignalId, Values};
use realtime::ports::{Channel, ForceSensor, Forces, Nanos};
use sim::wire::device::{Device, UnknownQuantity};

/// A virtual sensor whose samples have the counts of the setup's instruments.
pub struct ForceCounts {
    inner: Box<dyn ForceSensor>,
    /// What sends the lateral and the normal force, and what it knows of its scale.
    axes: [Option<(Profile, SignalId, Values)>; 2],
}

impl ForceCounts {
    /// The instruments of force of a setup, around a virtual sensor.
    ///
    /// # Errors
    /// A profile that names what the virtual world does not have.
    pub fn new(inner: Box<dyn ForceSensor>, setup: &SetupFile) -> Result<Self, UnknownQuantity> {
        let mut axes = [None, None];
        for axis in setup.axes() {
            let constants = Device::new(axis.profile.clone())?.constants;
            axes[usize::from(axis.name == "normal")] = Some((axis.profile, axis.signal, constants));
        }
        Ok(Self { inner, axes })
    }
}

impl ForceSensor for ForceCounts {
    fn read(&mut self, now: Nanos) -> Forces {
        let mut forces = self.inner.read(now);
        let channels: [&mut Channel; 2] = [&mut forces.lateral, &mut forces.normal];
        for (channel, axis) in channels.into_iter().zip(&self.axes) {
            if let (Ok(sample), Some((profile, signal, constants))) = (channel, axis) {
                sample.raw = profile.counts(*signal, sample.value, constants);
            }
        }
        forces
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use realtime::ports::{Quality, Sample};

    struct Constant(f64);

    impl ForceSensor for Constant {
        fn read(&mut self, now: Nanos) -> Forces {
            let sample = |value: f64| {
                Ok(Sample { value, raw: 77, taken_at: now, sequence: 1, quality: Quality::Good })
            };
            Forces { lateral: sample(-0.5 * self.0), normal: sample(self.0) }
        }
    }

    /// The virtual sensor has 1e-4 N a count, whatever instrument the setup names: a certificate of one with
    /// 1e-5 N read a tenth in virtual time.
    #[test]
    fn counts_are_those_of_the_setups_instrument() {
        let setup: crate::setup::Setup = crate::setup::Setup::load("virtual-ideal").unwrap();
        let mut port = ForceCounts::new(Box::new(Constant(0.25)), &setup.file).unwrap();
        let read = port.read(Nanos(1_000_000));
        let (lateral, normal) = (read.lateral.unwrap(), read.normal.unwrap());
        // drivers/profiles/docs/muprime-force2.md: 0.01 mN a count.
        assert_eq!((lateral.raw, normal.raw), (-12_500, 25_000));
        assert_eq!((lateral.value, normal.value), (-0.125, 0.25));
    }
}
