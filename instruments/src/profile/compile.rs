//! From a description to a profile: names become indices, and every refusal names its place.

use std::collections::HashMap;
use std::ops::Range;

use super::{CompiledSet, CompiledSignal, FrameId, Profile};
use crate::error::ProfileError;
use crate::expression::Expression;
use crate::field::Field;
use crate::schema::{Description, LinkKind};

/// Turns a description into a profile.
pub(super) struct Compiler<'a> {
    /// The file, for places.
    pub text: &'a str,
    /// What it says.
    pub description: &'a Description,
}

impl Compiler<'_> {
    /// Checks everything that the types cannot say, and compiles.
    pub fn compile(&self) -> Result<Profile, ProfileError> {
        let d = self.description;
        self.check_header()?;
        self.unique(d.poll.iter().map(|p| &p.name).chain(d.write.iter().map(|w| &w.name)), "poll or block")?;
        self.unique(d.signal.iter().map(|s| &s.name), "signal")?;
        self.unique(d.set.iter().map(|s| &s.name), "set-point")?;
        for poll in &d.poll {
            self.check_poll(poll)?;
        }
        for block in &d.write {
            if !(1..=123).contains(&block.count) {
                return Err(self.at(
                    block.name.span(),
                    format!(
                        "block `{}` has {} registers; one write takes 1 to 123",
                        block.name.as_ref(),
                        block.count
                    ),
                ));
            }
        }
        let by_name: HashMap<String, usize> =
            d.signal.iter().enumerate().map(|(i, s)| (s.name.as_ref().clone(), i)).collect();
        let index = |name: &str| by_name.get(name).copied();
        let signals = d.signal.iter().map(|s| self.signal(s, &index)).collect::<Result<_, _>>()?;
        let sets = d.set.iter().map(|s| self.set(s)).collect::<Result<_, _>>()?;
        let condition = |when: &toml::Spanned<String>| {
            Expression::compile(when.as_ref(), &index).map_err(|said| self.at(when.span(), said))
        };
        let signatures = d.signature.iter().map(|s| condition(&s.when)).collect::<Result<_, _>>()?;
        let faults = d.fault.iter().map(|f| condition(&f.when)).collect::<Result<_, _>>()?;
        for set in &d.set {
            if let Some(echo) = set.echo.as_ref().filter(|echo| index(echo).is_none()) {
                return Err(self.at(
                    set.name.span(),
                    format!("the echo of set-point `{}`, `{echo}`, is no signal", set.name.as_ref()),
                ));
            }
        }
        self.check_emulator(&index)?;
        Ok(Profile { description: d.clone(), signals, sets, signatures, faults, by_name })
    }

    fn at(&self, span: Range<usize>, message: impl Into<String>) -> ProfileError {
        ProfileError::at(self.text, Some(span), message)
    }

    fn check_header(&self) -> Result<(), ProfileError> {
        let link = &self.description.link;
        let place = self.text.find("[profile]").map(|at| at..at + "[profile]".len());
        let link_place = self.text.find("[link]").map(|at| at..at + "[link]".len());
        if self.description.profile.schema != 1 {
            return Err(ProfileError::at(
                self.text,
                place,
                format!("schema {} is not known", self.description.profile.schema),
            )
            .with_help("this version reads schema = 1"));
        }
        if link.kind == LinkKind::ModbusRtu && (link.baud.is_none() || link.format.is_none()) {
            return Err(ProfileError::at(self.text, link_place, "a serial link needs `baud` and `format`"));
        }
        if self.description.vector.is_empty() {
            return Err(ProfileError::at(self.text, place, "the profile has no golden vector")
                .with_help("add a [[vector]] for every frame: bytes beside the values that they stand for"));
        }
        Ok(())
    }

    fn unique<'b>(
        &self,
        names: impl Iterator<Item = &'b toml::Spanned<String>>,
        what: &str,
    ) -> Result<(), ProfileError> {
        let mut seen = std::collections::HashSet::new();
        for name in names {
            if !seen.insert(name.as_ref()) {
                return Err(self.at(name.span(), format!("a second {what} is called `{}`", name.as_ref())));
            }
        }
        Ok(())
    }

    fn check_poll(&self, poll: &crate::schema::Poll) -> Result<(), ProfileError> {
        let name = poll.name.as_ref();
        if !(1..=125).contains(&poll.count) {
            return Err(self.at(
                poll.name.span(),
                format!("poll `{name}` has {} registers; one read takes 1 to 125", poll.count),
            ));
        }
        if u32::from(poll.address) + u32::from(poll.count) > 65536 {
            return Err(self.at(poll.name.span(), format!("poll `{name}` runs past register 65535")));
        }
        match (poll.once, poll.rate_hz) {
            (true, None) => {}
            (false, Some(rate)) if rate.is_finite() && rate > 0.0 && rate <= 20_000.0 => {}
            _ => {
                return Err(self.at(
                    poll.name.span(),
                    format!(
                        "poll `{name}` needs either `once = true` or a `rate_hz` above 0 and at most 20000"
                    ),
                ));
            }
        }
        for signal in poll.sequence.iter().chain(&poll.device_time) {
            let stands = self
                .description
                .signal
                .iter()
                .any(|s| s.name.as_ref() == signal && s.frame.as_ref().is_none_or(|f| f == name));
            if !stands {
                return Err(
                    self.at(poll.name.span(), format!("`{signal}` of poll `{name}` is no signal in it"))
                );
            }
        }
        Ok(())
    }

    fn signal(
        &self,
        s: &crate::schema::Signal,
        index: &dyn Fn(&str) -> Option<usize>,
    ) -> Result<CompiledSignal, ProfileError> {
        let name = s.name.as_ref();
        let frame = match &s.frame {
            Some(frame) => {
                self.description.poll.iter().position(|p| p.name.as_ref() == frame).ok_or_else(|| {
                    self.at(s.name.span(), format!("the frame of signal `{name}`, `{frame}`, is no poll"))
                })?
            }
            None if self.description.poll.len() == 1 => 0,
            None => {
                return Err(self.at(
                    s.name.span(),
                    format!("signal `{name}` needs `frame`: the profile has several polls"),
                ));
            }
        };
        let at = match (s.register, s.byte) {
            (Some(register), None) => 2 * usize::from(register),
            (None, Some(byte)) => usize::from(byte),
            _ => {
                return Err(
                    self.at(s.name.span(), format!("signal `{name}` needs either `register` or `byte`"))
                );
            }
        };
        let field = Field { at, number: s.number, order: s.byte_order, bits: s.bits };
        self.check_field(&field, 2 * usize::from(self.description.poll[frame].count), s.name.span(), name)?;
        if s.scale == 0.0 || !s.scale.is_finite() || !s.si.factor.is_finite() || s.si.factor == 0.0 {
            return Err(self.at(s.name.span(), format!("a scale of signal `{name}` is zero or not finite")));
        }
        if s.range.is_some_and(|(low, high)| low >= high || low.is_nan() || high.is_nan()) {
            return Err(self.at(s.name.span(), format!("the range of signal `{name}` is empty")));
        }
        let compile = |text: &Option<String>| {
            text.as_ref()
                .map(|text| {
                    Expression::compile(text, index)
                        .map_err(|said| self.at(s.name.span(), format!("signal `{name}`: {said}")))
                })
                .transpose()
        };
        Ok(CompiledSignal {
            frame: FrameId(frame),
            field,
            scale: s.scale,
            scale_expression: compile(&s.scale_expr)?,
            offset: s.offset,
            si_factor: s.si.factor,
            range: s.range,
            valid_when: compile(&s.valid_when)?,
        })
    }

    fn set(&self, s: &crate::schema::Set) -> Result<CompiledSet, ProfileError> {
        let name = s.name.as_ref();
        let blocks = &self.description.write;
        let block = match &s.block {
            Some(block) => blocks.iter().position(|b| b.name.as_ref() == block).ok_or_else(|| {
                self.at(s.name.span(), format!("the block of set-point `{name}`, `{block}`, does not exist"))
            })?,
            None if blocks.len() == 1 => 0,
            None => return Err(self.at(s.name.span(), format!("set-point `{name}` needs `block`"))),
        };
        let field =
            Field { at: 2 * usize::from(s.register), number: s.number, order: s.byte_order, bits: None };
        self.check_field(&field, 2 * usize::from(blocks[block].count), s.name.span(), name)?;
        if s.scale == 0.0 || !s.scale.is_finite() {
            return Err(
                self.at(s.name.span(), format!("the scale of set-point `{name}` is zero or not finite"))
            );
        }
        if let Some((low, high)) = s.range {
            let (least, most) = (s.number.limits().0 * s.scale, s.number.limits().1 * s.scale);
            if low > high || low.is_nan() || high.is_nan() || low < least.min(most) || high > least.max(most)
            {
                return Err(self.at(
                    s.name.span(),
                    format!("the range of set-point `{name}` is empty or more than its type can hold"),
                ));
            }
            if s.safe.is_some_and(|safe| safe < low || safe > high) {
                return Err(self.at(
                    s.name.span(),
                    format!("the safe value of set-point `{name}` lies outside its range"),
                ));
            }
        }
        Ok(CompiledSet { block, field, scale: s.scale })
    }

    fn check_field(
        &self,
        field: &Field,
        frame_bytes: usize,
        span: Range<usize>,
        name: &str,
    ) -> Result<(), ProfileError> {
        if field.end() > frame_bytes {
            return Err(
                self.at(span, format!("`{name}` ends at byte {} of a frame of {frame_bytes}", field.end()))
            );
        }
        if let Some((first, width)) = field.bits {
            #[allow(clippy::cast_possible_truncation)] // a number has at most 4 bytes
            let most = 8 * field.number.bytes() as u32;
            if width == 0 || first >= most || width > most - first {
                return Err(self.at(span, format!("the bits of `{name}` lie outside its {most} bits")));
            }
        }
        Ok(())
    }

    fn check_emulator(&self, index: &dyn Fn(&str) -> Option<usize>) -> Result<(), ProfileError> {
        let emulator = &self.description.emulator;
        let place = self.text.find("[emulator").map(|at| at..at + "[emulator".len());
        for name in emulator.measure.keys().chain(emulator.constant.keys()) {
            if index(name).is_none() {
                return Err(ProfileError::at(
                    self.text,
                    place,
                    format!("[emulator] speaks of `{name}`, which is no signal"),
                ));
            }
        }
        for name in emulator.command.keys() {
            if !self.description.set.iter().any(|set| set.name.as_ref() == name) {
                return Err(ProfileError::at(
                    self.text,
                    place,
                    format!("[emulator] speaks of `{name}`, which is no set-point"),
                ));
            }
        }
        Ok(())
    }
}
