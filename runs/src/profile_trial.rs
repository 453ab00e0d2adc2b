//! A profile tried before any instrument is: its vectors, then its own emulator's answers read for a second.

use drivers::user_profiles::Source;
use instruments::schema::Severity;
use instruments::traffic::LineSetup;
use instruments::{FrameId, FrameKind, Profile};
use realtime::Nanos;
use sim::wire::Plant;
use sim::wire::device::Device;
use sim::wire::world::WorldPlant;
use sim::world::{World, WorldConfig};
use std::path::Path;

/// Tries the profile in a file; an error says what is wrong with it, with the place where it is known.
pub fn of(path: &Path) -> Result<(), String> {
    let profile =
        Source::read(path).and_then(|source| source.profile()).map_err(|error| error.to_string())?;
    line(&profile)?;
    vectors(&profile)?;
    second(profile)
}

/// Whether a vector tries every force: a zero shows no byte order, equal forces no axes.
fn vectors(profile: &Profile) -> Result<(), String> {
    let d = &profile.description;
    let forces = d.signal.iter().filter(|signal| signal.si.unit == "N");
    let forces: Vec<&String> = forces.map(|signal| signal.name.as_ref()).collect();
    let tried = |name: &String| {
        d.vector.iter().map(|vector| vector.expect.as_ref()).any(|expect| {
            let own = expect.get(name).filter(|own| **own != 0.0);
            own.is_some() && forces.iter().filter(|force| expect.get(**force) == own).count() == 1
        })
    };
    forces.iter().find(|name| !tried(name)).map_or(Ok(()), |name| {
        Err(format!("no [[vector]] expects a force of `{name}` that is neither zero nor another signal's"))
    })
}

/// Whether the samples fit the line.
fn line(profile: &Profile) -> Result<(), String> {
    match profile.line_share(LineSetup::default()) {
        Some(share) if share > 1.0 => Err(format!(
            "[link]: the samples take {:.0} % of the line's capacity; lower `rate_hz`",
            share * 1e2
        )),
        _ => Ok(()),
    }
}

/// Plays a second of the emulator's frames against the profile's own reading of them.
fn second(profile: Profile) -> Result<(), String> {
    let mut device = Device::new(profile.clone()).map_err(|error| error.to_string())?;
    let world = World::new(&WorldConfig::ideal(), 1).map_err(|error| error.to_string())?;
    let mut plant = WorldPlant::new(world);
    let mut values = profile.values();
    let mut valid = vec![false; profile.description.signal.len()];
    let frames: Vec<FrameId> = (0..profile.frames().len()).map(FrameId).collect();
    let rates: Vec<Option<f64>> = frames.iter().map(|&frame| rate_hz(&profile, frame)).collect();
    for ms in 0..1000_u32 {
        let now = Nanos(u64::from(ms) * 1_000_000);
        plant.advance(now);
        for (&frame, rate) in frames.iter().zip(&rates) {
            let every = rate.map_or(u32::MAX, |rate| (1e3 / rate).round().max(1.0) as u32);
            if ms % every != 0 {
                continue;
            }
            let name = &profile.frames()[frame.0].name;
            let bytes = device.frame(frame, &mut plant, now);
            profile.decode(frame, &bytes, &mut values).map_err(|error| format!("`{name}`: {error}"))?;
            profile.signals().for_each(|(_, id)| valid[id.0] |= profile.refusal(id, &values).is_none());
            let shape = &profile.frames()[frame.0];
            // What the world does not know yet, such as a set-point that nobody has sent, is not a number of
            // a line.
            let known =
                |eight: &[u8]| eight.try_into().is_ok_and(|eight| f64::from_be_bytes(eight).is_finite());
            let line = shape.write_line(&bytes, 1.0).filter(|_| bytes.chunks_exact(8).all(known));
            if let Some(line) = line.filter(|line| shape.read_line(line).is_none()) {
                return Err(format!("`{name}`: the emulator's own line `{line}` is none of its answers"));
            }
        }
        if let Some(broken) = profile.broken_signature(&values) {
            let when = profile.description.signature[broken].when.as_ref();
            let d = &profile.description;
            let open = d.signal.iter().map(|signal| signal.name.as_ref()).filter(|name| {
                when.contains(name.as_str())
                    && !d.emulator.constant.contains_key(*name)
                    && !d.emulator.measure.contains_key(*name)
            });
            let open: Vec<String> = open.map(|name| format!("`{name} = ...`")).collect();
            let what = if open.is_empty() { "other values of its signals".into() } else { open.join(", ") };
            return Err(format!(
                "[emulator] does not satisfy the signature `{when}`: state {what} under [emulator.constant], so that \
                 the profile can be tried without the instrument"
            ));
        }
    }
    let d = &profile.description;
    if let Some(fault) = profile.fault(&values).map(|fault| &d.fault[fault])
        && fault.severity == Severity::Stop
    {
        return Err(format!(
            "[emulator] shows the fault `{}` ({}) all the time: state what its signals are in good order, under \
             [emulator.constant]",
            fault.when.as_ref(),
            fault.text
        ));
    }
    let never = |name: &&String| profile.signal(name).is_some_and(|signal| !valid[signal.0]);
    let why = |name| format!("signal `{name}` has no valid sample in the emulator's own frames");
    d.emulator.measure.keys().find(never).map_or(Ok(()), |name| Err(why(name)))
}

/// How often a frame comes; `None` for once.
fn rate_hz(profile: &Profile, frame: FrameId) -> Option<f64> {
    let d = &profile.description;
    match &profile.frames()[frame.0].kind {
        FrameKind::Poll(index) => d.poll[*index].rate_hz,
        FrameKind::Stream => d.stream.as_ref().map(|stream| stream.rate_hz),
        FrameKind::Messages(index, _) => Some(d.message[*index].rate_hz),
        FrameKind::Query(index) => Some(d.query[*index].rate_hz),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_bundled_profile_passes_its_trial() {
        for id in drivers::bundled::ids() {
            let profile = drivers::profile(id).unwrap();
            let all = line(&profile).and_then(|()| vectors(&profile)).and_then(|()| second(profile));
            all.unwrap_or_else(|problem| panic!("{id}: {problem}"));
        }
    }

    #[test]
    fn a_fault_that_the_emulator_always_shows_is_told() {
        let mut profile = drivers::profile("muprime-force2").unwrap();
        profile.description.emulator.measure.remove("fault");
        profile.description.emulator.constant.insert("fault".into(), 1.0);
        let message = second(profile).unwrap_err();
        assert!(message.contains("`fault == 1`") && message.contains("[emulator.constant]"), "{message}");
    }

    #[test]
    fn a_force_that_no_vector_tries_and_one_that_is_never_valid_are_refused() {
        let text = drivers::bundled::text("muprime-force2").unwrap();
        let refusal = |changed: &str| {
            let profile = Profile::checked(changed, &|_| None).unwrap();
            vectors(&profile).and_then(|()| second(profile)).err().unwrap_or_default()
        };
        let untried = refusal(&text.replace("lateral = -0.5, ", "").replace("lateral = 20.0, ", ""));
        assert!(untried.contains("a force of `lateral`"), "{untried}");
        let never =
            refusal(&text.replace("fault == 0\"\ntext = \"force into", "fault == 3\"\ntext = \"force into"));
        assert!(never.contains("signal `normal` has no valid sample"), "{never}");
    }

    #[test]
    fn an_open_signature_says_what_to_write() {
        let mut profile = drivers::profile("muprime-force2").unwrap();
        profile.description.emulator.constant.remove("magic");
        let message = second(profile).unwrap_err();
        assert!(message.contains("`magic = ...`"), "{message}");
    }

    #[test]
    fn a_quantity_that_the_world_does_not_have_is_reported() {
        let mut profile = drivers::profile("muprime-force2").unwrap();
        profile.description.emulator.measure.insert("normal".into(), "force.normal_kg".into());
        let message = second(profile).unwrap_err();
        assert!(message.contains("force.normal_kg") && message.contains("force.normal_n"), "{message}");
    }
}
