//! One emulated instrument: registers out of the world, commands into it.

use super::{Command, Plant, Quantity};
use instruments::schema::Table;
use instruments::{FrameId, FrameKind, Profile, SetId, SignalId, Values};
use realtime::Nanos;

/// Where a signal's value comes from.
#[derive(Debug, Clone, Copy)]
enum Source {
    Constant(f64),
    World { quantity: Quantity, per_si: f64, offset: f64, modulo: f64 },
}

/// An emulator cannot be made from a profile.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "profile `{profile}`: [emulator] names `{quantity}`, which the virtual world does not have; there are: {known}"
)]
pub struct UnknownQuantity {
    /// Id of the profile.
    pub profile: String,
    /// The name that nothing answers to.
    pub quantity: String,
    /// Those that there are.
    pub known: String,
}

/// Why an instrument refused a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Refused {
    /// Some register of the range does not exist.
    #[error("no such register")]
    Address,
    /// A set-point lies outside what the instrument takes.
    #[error("the value is out of range")]
    Value,
}

/// One emulated instrument.
#[derive(Debug, Clone)]
pub struct Device {
    profile: Profile,
    sources: Vec<Option<Source>>,
    commands: Vec<Option<(Command, f64)>>,
    blocks: Vec<Vec<u8>>,
    /// What frames of constants say, such as a calibration: known to the instrument itself.
    pub constants: Values,
    reads: u32,
}

impl Device {
    /// An instrument by its profile.
    ///
    /// # Errors
    /// Where the profile names a quantity that the world does not have.
    pub fn new(profile: Profile) -> Result<Self, UnknownQuantity> {
        let d = &profile.description;
        let unknown = |quantity: &str, known: Vec<&str>| UnknownQuantity {
            profile: profile.id().into(),
            quantity: quantity.into(),
            known: known.join(", "),
        };
        let source = |(index, signal): (usize, &instruments::schema::Signal)| {
            let name = signal.name.as_ref();
            if let Some(raw) = d.emulator.constant.get(name) {
                return Ok(Some(Source::Constant(*raw)));
            }
            let Some(quantity) = d.emulator.measure.get(name) else { return Ok(None) };
            let known = || Quantity::ALL.iter().map(|q| q.name()).collect();
            let quantity = Quantity::from_name(quantity).ok_or_else(|| unknown(quantity, known()))?;
            // Counters and clocks run round at the width of their register.
            let turn = profile.turn(SignalId(index)).0 * signal.scale;
            let modulo = if quantity.wraps() { turn } else { f64::INFINITY };
            Ok(Some(Source::World { quantity, per_si: 1.0 / signal.si.factor, offset: 0.0, modulo }))
        };
        let sources = d.signal.iter().enumerate().map(source).collect::<Result<Vec<_>, _>>()?;
        let command = |set: &instruments::schema::Set| {
            let Some(name) = d.emulator.command.get(set.name.as_ref()) else { return Ok(None) };
            let known = || Command::ALL.iter().map(|c| c.name()).collect();
            let command = Command::from_name(name).ok_or_else(|| unknown(name, known()))?;
            Ok(Some((command, set.si.factor)))
        };
        let commands = d.set.iter().map(command).collect::<Result<Vec<_>, _>>()?;
        let blocks = d.write.iter().map(|block| vec![0; 2 * usize::from(block.count)]).collect();
        let mut constants = profile.values();
        for frame in (0..profile.frames().len()).map(FrameId) {
            // Single precision rounds: the instrument works with what it shows.
            let mut bytes = vec![0; profile.frame_bytes(frame)];
            profile.encode(frame, &mut bytes, &mut |signal| match sources[signal.0]? {
                Source::Constant(raw) => Some(raw),
                Source::World { .. } => None,
            });
            let _ = profile.decode(frame, &bytes, &mut constants);
        }
        Ok(Self { sources, commands, blocks, constants, reads: 0, profile })
    }

    /// Mounts a force sensor: `signal` shows the force of an axis by `force = gain * signal - offset_n`, all
    /// in SI units. What the profile's emulator does not show otherwise stays as it is.
    pub fn mount(&mut self, signal: &str, axis: Quantity, gain: f64, offset_n: f64) {
        let Some(signal) = self.profile.signal(signal) else { return };
        if let Some(Source::World { quantity, per_si, offset, .. }) = &mut self.sources[signal.0] {
            let unit_per_si = 1.0 / self.profile.description.signal[signal.0].si.factor;
            (*quantity, *per_si, *offset) = (axis, unit_per_si / gain, unit_per_si * offset_n / gain);
        }
    }

    /// The profile.
    pub fn profile(&self) -> &Profile {
        &self.profile
    }

    /// The bytes of one frame, all of one moment of the world.
    pub fn frame(&mut self, frame: FrameId, plant: &mut dyn Plant, now: Nanos) -> Vec<u8> {
        let mut bytes = vec![0; self.profile.frame_bytes(frame)];
        let (sources, reads) = (&self.sources, self.reads);
        let mut shown = |signal: SignalId| match sources[signal.0]? {
            Source::Constant(raw) => Some(raw),
            Source::World { quantity, per_si, offset, modulo } => {
                let value = offset
                    + per_si
                        * match quantity {
                            Quantity::DeviceTime => now.seconds(),
                            Quantity::DeviceReads => f64::from(reads),
                            _ => plant.measure(quantity),
                        };
                Some(if modulo.is_finite() { value.rem_euclid(modulo) } else { value })
            }
        };
        // What the host works out, the instrument does not send: it sends the readings that lead there.
        let gages = self.profile.inputs_for(frame, &self.constants, &mut |s| shown(s).unwrap_or(0.0));
        let gages = gages.unwrap_or_default();
        self.profile.encode(frame, &mut bytes, &mut |signal: SignalId| {
            let gage = gages.iter().find(|(input, _)| *input == signal).map(|(_, value)| *value);
            gage.or_else(|| shown(signal))
        });
        bytes
    }

    /// Takes one set-point that came as a line of text, in its unit.
    ///
    /// # Errors
    /// Where the value is none that the instrument takes.
    pub fn set(&mut self, set: SetId, value: f64, plant: &mut dyn Plant) -> Result<(), Refused> {
        self.profile.allows(set, value).map_err(|_| Refused::Value)?;
        if let Some((command, si)) = self.commands[set.0] {
            plant.command(&[(command, value * si)]);
        }
        Ok(())
    }

    /// Registers `address..address + count` of a table, all of one moment of the world.
    ///
    /// # Errors
    /// [`Refused::Address`] where a register of the range does not exist.
    pub fn read(
        &mut self,
        table: Table,
        address: u16,
        count: u16,
        plant: &mut dyn Plant,
        now: Nanos,
    ) -> Result<Vec<u16>, Refused> {
        self.reads = self.reads.wrapping_add(1);
        let (from, to) = (usize::from(address), usize::from(address) + usize::from(count));
        let mut registers = vec![None; to - from];
        let mut put = |start: u16, bytes: &[u8]| {
            for (i, pair) in bytes.chunks_exact(2).enumerate() {
                let at = usize::from(start) + i;
                if (from..to).contains(&at) {
                    registers[at - from] = Some(u16::from_be_bytes([pair[0], pair[1]]));
                }
            }
        };
        let overlaps = |start: u16, length: u16| {
            usize::from(start) < to && usize::from(start) + usize::from(length) > from
        };
        for index in 0..self.profile.frames().len() {
            let FrameKind::Poll(poll) = self.profile.frames()[index].kind else { continue };
            let spans = self.profile.frames()[index].spans.clone();
            let polled = self.profile.description.poll[poll].table == table
                && spans.iter().any(|span| overlaps(span.address, span.count));
            if polled {
                let bytes = self.frame(FrameId(index), plant, now);
                let mut rest = bytes.as_slice();
                for span in spans {
                    let (own, others) = rest.split_at(2 * usize::from(span.count));
                    put(span.address, own);
                    rest = others;
                }
            }
        }
        for (block, bytes) in self.profile.description.write.iter().zip(&self.blocks) {
            if block.table == table {
                put(block.address, bytes);
            }
        }
        registers.into_iter().collect::<Option<Vec<u16>>>().ok_or(Refused::Address)
    }

    /// Writes neighbouring registers of a table; the set-points that they touch take effect together.
    ///
    /// # Errors
    /// [`Refused`], and then nothing was changed.
    pub fn write(
        &mut self,
        table: Table,
        address: u16,
        registers: &[u16],
        plant: &mut dyn Plant,
    ) -> Result<(), Refused> {
        let writes = &self.profile.description.write;
        let inside = |block: &instruments::schema::Write| {
            block.table == table
                && address >= block.address
                && usize::from(address) + registers.len()
                    <= usize::from(block.address) + usize::from(block.count)
        };
        let Some(index) = writes.iter().position(inside) else {
            // Settings that are written at connection change nothing of the world.
            let settings = &self.profile.description.init;
            let set_up = settings.iter().any(|init| {
                let first = init.registers.as_ref().map(|(first, values)| (*first, values.len()));
                init.table == table && first == Some((address, registers.len()))
            });
            return if set_up { Ok(()) } else { Err(Refused::Address) };
        };
        let first = 2 * usize::from(address - writes[index].address);
        let mut block = self.blocks[index].clone();
        for (i, register) in registers.iter().enumerate() {
            block[first + 2 * i..first + 2 * i + 2].copy_from_slice(&register.to_be_bytes());
        }
        let sets: Vec<SetId> = self.profile.sets_of(index).collect();
        let mut taken = Vec::with_capacity(sets.len());
        for set in sets {
            let value = self.profile.decode_set(set, &block).ok_or(Refused::Value)?;
            self.profile.encode_set(set, value, &mut block.clone()).map_err(|_| Refused::Value)?;
            taken.extend(self.commands[set.0].map(|(command, si)| (command, value * si)));
        }
        self.blocks[index] = block;
        if !taken.is_empty() {
            plant.command(&taken);
        }
        Ok(())
    }
}
