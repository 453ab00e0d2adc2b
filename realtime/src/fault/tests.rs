//! Each fault does what its word says, in its time, to its channel, and to nothing else; and the same again from the same seed.
//!
//! The tests of the rules lean on this: a fault that does less than it says would let a rule pass that catches nothing.
#![allow(clippy::disallowed_types)]

use super::*;

mod commands;
mod lines;
mod states;

/// One cycle of the loop, and one sample of an instrument.
const T: u64 = 1_000_000;
/// The cycles in which a fault acts, where a test says nothing else.
const ACTS: std::ops::Range<u64> = 10..20;

fn at(cycle: u64) -> Nanos {
    Nanos(cycle * T)
}

fn fault(target: FaultTarget, mode: FaultMode, strength: f64) -> Fault {
    Fault { target, mode, from: at(ACTS.start), until: at(ACTS.end), strength }
}

/// A fault that acts all the time.
fn always(target: FaultTarget, mode: FaultMode, strength: f64) -> Fault {
    Fault { from: Nanos(0), until: Nanos(u64::MAX), ..fault(target, mode, strength) }
}

/// The sample of a cycle: each has its own value, count and time.
fn nth(cycle: u64) -> Sample {
    let quality = Quality::Good;
    Sample {
        value: cycle as f64 + 0.25,
        raw: 10 * cycle as i64,
        taken_at: at(cycle),
        sequence: cycle as u32,
        quality,
    }
}

/// Whether so many of so many are what a probability gives, within five standard deviations.
fn about(count: usize, of: usize, share: f64) -> bool {
    let (count, of) = (count as f64, of as f64);
    (count - share * of).abs() <= 5.0 * (of * share * (1.0 - share)).sqrt()
}

/// A port that answers as a test says.
struct Port<S, C> {
    state: S,
    command: C,
}

impl<S: FnMut(Nanos) -> Forces + Send, C: Send> ForceSensor for Port<S, C> {
    fn read(&mut self, now: Nanos) -> Forces {
        (self.state)(now)
    }
}

impl<S, C> Amplifier for Port<S, C>
where
    S: FnMut(Nanos) -> Result<AmplifierState, NoData> + Send,
    C: FnMut(DriveCommand, Nanos) + Send,
{
    fn command(&mut self, command: DriveCommand, now: Nanos) {
        (self.command)(command, now);
    }

    fn state(&mut self, now: Nanos) -> Result<AmplifierState, NoData> {
        (self.state)(now)
    }
}

impl<S, C> Stage for Port<S, C>
where
    S: FnMut(Nanos) -> Result<StageState, NoData> + Send,
    C: FnMut(StageCommand, Nanos) + Send,
{
    fn command(&mut self, command: StageCommand, now: Nanos) {
        (self.command)(command, now);
    }

    fn state(&mut self, now: Nanos) -> Result<StageState, NoData> {
        (self.state)(now)
    }
}

/// What only a reading can show.
const EXTRA: [FaultMode; 7] = [
    FaultMode::Invalid,
    FaultMode::Corrupt,
    FaultMode::Disconnected,
    FaultMode::Spikes,
    FaultMode::Saturated,
    FaultMode::Disordered,
    FaultMode::ClockJump,
];

#[test]
fn the_strengths_are_those_that_the_words_name() {
    for mode in FaultMode::PX4.into_iter().chain(EXTRA) {
        let strength = mode.default_strength();
        match mode {
            FaultMode::Wrong => assert_eq!(strength, -0.5),
            FaultMode::Slow => assert_eq!(strength, 4.0),
            FaultMode::Delayed => assert_eq!(strength, 0.02),
            FaultMode::Intermittent => assert_eq!(strength, 0.3),
            FaultMode::Spikes => assert!(strength >= 1e9, "only one: {strength}"),
            FaultMode::ClockJump => assert_eq!(strength, -1.0),
            _ => assert_eq!(strength, 0.0, "{mode:?} has none"),
        }
    }
}

/// What the authors' own program gives for this seed (`splitmix64.c`, Vigna), as every other implementation is checked.
#[test]
fn the_dice_are_the_published_ones() {
    let mut dice = Dice(1_234_567);
    let published = [
        6_457_827_717_110_365_317,
        3_203_168_211_198_807_973,
        9_817_491_932_198_370_423,
        4_593_380_528_125_082_431,
        16_408_922_859_458_223_821,
    ];
    assert_eq!(published.map(|_| dice.bits()), published);
}

#[test]
fn the_dice_are_uniform_from_zero_to_below_one() {
    let (mut dice, mut bins) = (Dice(7), [0_usize; 16]);
    for _ in 0..100_000 {
        let unit = dice.unit();
        assert!((0.0..1.0).contains(&unit), "{unit}");
        bins[(unit * 16.0) as usize] += 1;
    }
    assert!(bins.iter().all(|count| about(*count, 100_000, 1.0 / 16.0)), "{bins:?}");
}

/// Two channels of one seed are not at fault together, and every bit of a seed counts.
#[test]
fn each_channel_and_each_seed_has_its_own_dice() {
    let targets = [
        FaultTarget::Lateral,
        FaultTarget::Normal,
        FaultTarget::Force,
        FaultTarget::Amplifier,
        FaultTarget::Drive,
        FaultTarget::Stage,
    ];
    let first = |target: FaultTarget, seed: u64| Line::<Sample>::new([target, target], &[], seed).dice.bits();
    let mut seen = std::collections::HashSet::new();
    for target in targets {
        for seed in (0..64).map(|bit| 0xA5A5_5A5A_0000_0000 ^ (1 << bit)) {
            // Seeds that differ in the bits of the target alone may meet those of another target: low bits here.
            if seed ^ 0xA5A5_5A5A_0000_0000 < 1 << 56 {
                assert!(seen.insert(first(target, seed)), "{target:?} {seed:x}");
            }
        }
        let of = |bit: u32| first(target, 1 << bit);
        assert!((0..64).all(|bit| of(bit) != first(target, 0)), "{target:?} has a deaf bit");
    }
}
