use super::*;
use crate::live::{Ended, Message, Progress, Run, State, TimedEvent};
use models::{Condition, Pass};
use ratatui_core::buffer::Buffer;
use ratatui_core::layout::Rect;
use realtime::compare::PassComparison;
use realtime::safety::{Trip, TripCause, Unit};
use realtime::{Nanos, Phase};
use runs::job::Extremes;
use runs::{Event, MeasuredPass, Outcome};

const PLAIN: Look = Look { colour: false, unicode: false };

fn run() -> Run {
    Run {
        folder: "/tmp/a-run".into(),
        plan: "first-sweep".into(),
        setup: "virtual".into(),
        model: "spring-slider".into(),
        operator: Some("A. \u{1b}[2JNobody".into()),
        sample: None,
        started_unix_s: 0.0,
        fast: false,
        process: 1,
        planned: 9,
        made_before: 0,
        guards: Default::default(),
    }
}

fn state(time_s: f64) -> State {
    let force = 0.05 * (time_s * 0.7).sin();
    State {
        time_s,
        armed: true,
        point: 7,
        phase: Phase::Measure,
        lateral_force_n: Some(-0.0496),
        normal_force_n: Some(0.25),
        amplitude_pp_m: Some(2.5e-6),
        frequency_hz: Some(27_500.0),
        output_on: Some(true),
        temperature_c: Some(24.14),
        position_m: Some(0.0),
        velocity_m_s: Some(0.02),
        mu_relative: Some(0.532),
        mu_relative_sd: Some(0.012),
        predicted: Some(0.52),
        predicted_sd: Some(0.03),
        residual: Some(0.012),
        z: Some(0.4),
        blocking: None,
        extremes: Extremes {
            cycles: 100,
            lateral_force_n: Some([force - 0.01, force + 0.01]),
            normal_force_n: Some([0.24, 0.26]),
            amplitude_pp_m: None,
            mu_relative: None,
            lateness_s: if time_s == 59.5 { 1.25e-3 } else { 1e-5 },
        },
        unix_ns: 0,
        deadlines: Default::default(),
        driven_s: None,
        dose_m2_s: None,
        signals: Vec::new(),
    }
}

fn pass(point: u64, amplitude_um: f64, measured: Option<f64>, predicted: f64) -> MeasuredPass {
    let mut pass = Pass::at(point, &Condition::paper(), Some(-0.05));
    pass.amplitude = models::quantity::PeakToPeak::from_metres(amplitude_um * 1e-6);
    let comparison = PassComparison {
        mu_relative: measured,
        mu_relative_sd: Some(0.01),
        predicted,
        predicted_sd: 0.03,
        z: -1.25,
        log_evidence: 0.0,
        departed: false,
        validity: models::prediction::Validity::Inside,
        judged: 1,
        rms_z: None,
        visible_departure: None,
    };
    MeasuredPass {
        pass,
        reference: false,
        comparison: Some(comparison),
        regime: None,
        psi_eq17: None,
        temperature_flags: Vec::new(),
        commanded_normal_force_n: None,
        levels: Vec::new(),
    }
}

fn trip() -> Trip {
    let at = Nanos(59_900_000_000);
    Trip {
        cause: TripCause::NormalOverforce,
        value: f64::INFINITY,
        bound: 2.0,
        unit: Unit::Newton,
        cycle: 59_900,
        at,
    }
}

/// A run in the middle.
fn living() -> View {
    let mut view = View::default();
    view.take(Message::Run(Box::new(run())));
    view.take(Message::Event(TimedEvent::of(0.3, Event::Armed)));
    for n in 0..600 {
        view.take(Message::State(Box::new(state(f64::from(n) * 0.1))));
    }
    for (point, w, measured) in
        [(1, 0.0, Some(1.0)), (2, 1.0, Some(0.8)), (3, 4.0, None), (4, 5.0, Some(0.2))]
    {
        view.take(Message::Pass(Box::new(pass(
            point,
            w,
            measured,
            if point == 4 { 0.55 } else { 1.0 - 0.2 * w },
        ))));
    }
    view.take(Message::Progress(Progress { made: 4, planned: 9, remaining_s: 125.0 }));
    view
}

fn states() -> Vec<(&'static str, View)> {
    let mut paused = living();
    paused.take(Message::Event(TimedEvent::of(60.0, Event::Paused { point: 8 })));
    let mut tripped = living();
    tripped.take(Message::Event(TimedEvent::of(59.9, Event::Tripped(trip()))));
    let mut ended = tripped.clone();
    ended.take(Message::Ended(Box::new(Ended {
        outcome: Some(Outcome::Tripped(trip())),
        remedy: Some("look".into()),
        error: None,
        off: Some("the drive is off: read back".into()),
        agreement: Some("agreement \u{7}".into()),
    })));
    let mut bare = View::default();
    bare.take(Message::State(Box::new(State {
        armed: false,
        phase: Phase::Idle,
        point: u32::MAX,
        lateral_force_n: None,
        normal_force_n: Some(f64::NAN),
        amplitude_pp_m: None,
        frequency_hz: None,
        output_on: None,
        temperature_c: None,
        mu_relative: None,
        mu_relative_sd: None,
        predicted: None,
        predicted_sd: None,
        residual: None,
        z: None,
        blocking: Some(TripCause::EmergencyStop),
        extremes: Extremes { normal_force_n: Some([f64::NAN, f64::INFINITY]), ..Extremes::default() },
        ..state(1.0)
    })));
    vec![
        ("nothing", View::default()),
        ("living", living()),
        ("paused", paused),
        ("tripped", tripped),
        ("ended", ended),
        ("bare", bare),
    ]
}

fn shown(view: &View, size: (u16, u16), look: Look) -> Buffer {
    let (source, keys) = (Source::Feed, Keys::Here);
    let page = Page {
        view,
        source: &source,
        keys: &keys,
        own: false,
        look,
        help: false,
        note: None,
        silent_s: 0.1,
        unix_s: 1_000_000_000,
    };
    let mut buffer = Buffer::empty(Rect::new(0, 0, size.0, size.1));
    draw(&page, &mut buffer);
    buffer
}

fn text(buffer: &Buffer) -> String {
    let row = |y| (0..buffer.area.width).map(|x| buffer[(x, y)].symbol()).collect::<String>();
    (0..buffer.area.height).map(row).map(|row| row.trim_end().to_string() + "\n").collect()
}

fn has(text: &str, all: &[&str]) {
    for part in all {
        assert!(text.contains(part), "{part}\n{text}");
    }
}

#[test]
fn every_size_and_state_is_drawn_without_a_panic() {
    for (_, view) in states() {
        for width in (1..=90).chain([120, 200]) {
            for height in (1..=30).chain([60]) {
                let unicode = (width + height) % 2 == 0;
                shown(&view, (width, height), Look { colour: unicode, unicode });
            }
        }
    }
}

#[test]
fn eighty_by_twenty_four_holds_all_that_matters() {
    let page = text(&shown(&living(), (80, 24), PLAIN));
    has(
        &page,
        &[
            "first-sweep on virtual",
            "operator A. \\u001b[2JNobody  sample none",
            "ARMED: measuring, point 7",
            "4 of 9 passes, 2 min 05 s left, ends about 01:48:45 UTC",
            "lateral force -0.0496 N (sensor frame)",
            "normal force  +0.2500 N (compression +)",
            "mu' measured  0.532 +- 0.012",
            "mu' predicted 0.520 +- 0.030",
            "residual      +0.012, z +0.4",
            "amplitude w   2.500 um",
            "frequency     27.500 kHz",
            "output        ON, 24.1 degC",
            "lateness      1.25 ms, worst of 1 s",
            "last pass     4: mu' 0.200",
            "its surprise  -1.2 sd",
            "lateral force, N, 60 s: -0.060..+0.060",
            "normal force, N, 60 s: +0.240..+0.260",
            "w, um peak-to-peak",
            "0.3 s  safety checks passed; drive enabled",
            "s stop  p pause  r resume  q leave",
        ],
    );
    assert_eq!(page.matches('@').count(), 1 + 2, "two passes agree, and the legend says so: {page}");
    assert!(page.is_ascii(), "{page}");
}

#[test]
fn trips_ends_and_rests_are_told_with_what_to_do() {
    for size in [(80, 24), (60, 20), (200, 50)] {
        for (name, view) in states() {
            let page = text(&shown(&view, size, PLAIN));
            match name {
                "paused" => has(&page, &["PAUSED", "still armed; r goes on", "left from when it goes on"]),
                "tripped" => {
                    has(&page, &["TRIPPED", "STOPPED for safety: the normal force", "2 N", "remedy: "])
                }
                "ended" => {
                    has(
                        &page,
                        &["ENDED: a safety rule tripped", "remedy: ", "is off: read back", "run is over"],
                    );
                    assert!(!page.contains("output"), "the last cycle's output is no state of now: {page}");
                }
                "bare" => has(
                    &page,
                    &[
                        "NOT ARMED: the emergency stop is pressed",
                        "lateral force none",
                        "none: nothing slides",
                    ],
                ),
                "nothing" => has(&page, &["WAITING for the first cycle", "none"]),
                _ => has(&page, &["ARMED: measuring"]),
            }
            assert!(!page.contains("NaN") && !page.contains("inf N"), "{page}");
        }
    }
}

#[test]
fn colours_only_repeat_what_words_say() {
    let colours = |look| {
        let coloured = |view: &View| {
            let buffer = shown(view, (80, 24), look);
            let plain = |c: &ratatui_core::buffer::Cell| {
                c.fg == ratatui_core::style::Color::Reset && c.bg == ratatui_core::style::Color::Reset
            };
            buffer.content().iter().filter(|cell| !plain(cell)).count()
        };
        states().iter().map(|(_, view)| coloured(view)).sum::<usize>()
    };
    assert!(colours(Look { colour: true, unicode: true }) > 0);
    assert_eq!(colours(PLAIN), 0);
}

#[test]
fn the_environment_says_what_can_be_shown() {
    let of = |pairs: &[(&str, &str)]| {
        Look::of(|name| pairs.iter().find(|(n, _)| *n == name).map(|(_, v)| v.to_string()))
    };
    let xterm = ("TERM", "xterm-256color");
    assert_eq!(of(&[xterm, ("LANG", "de_DE.UTF-8")]), Look { colour: true, unicode: true });
    assert_eq!(of(&[xterm, ("LC_ALL", "C"), ("LANG", "de_DE.UTF-8")]), Look { colour: true, unicode: false });
    assert_eq!(of(&[xterm, ("LC_ALL", ""), ("LC_CTYPE", "C.utf8")]), Look { colour: true, unicode: true });
    assert!(!of(&[xterm, ("NO_COLOR", "1")]).colour && of(&[xterm, ("NO_COLOR", "")]).colour);
    for term in ["dumb", "vt100"] {
        assert!(!of(&[("TERM", term)]).colour);
    }
    assert_eq!(of(&[]), PLAIN);
}

#[test]
fn silence_and_missing_feeds_are_told() {
    let view = living();
    let (source, keys) = (Source::Feed, Keys::DeadMan);
    let mut page = Page {
        view: &view,
        source: &source,
        keys: &keys,
        own: true,
        look: PLAIN,
        help: true,
        note: None,
        silent_s: 7.0,
        unix_s: 0,
    };
    let mut buffer = Buffer::empty(Rect::new(0, 0, 80, 24));
    draw(&page, &mut buffer);
    has(
        &text(&buffer),
        &["NOTHING HEARD for 7 s", "space holds; Ctrl-C stops", "safe state at once", "peak-to-peak"],
    );
    let (none, source) = (View::default(), Source::Folder(Some("refused".into())));
    page = Page { view: &none, source: &source, ..page };
    draw(&page, &mut buffer);
    has(&text(&buffer), &["RUNS: passes from its folder only, there is no feed (refused)"]);
}
