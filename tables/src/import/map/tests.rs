//! Maps that are stated, guessed and written.

use super::*;
use crate::import::guess::guess;
use crate::import::text::{Marks, read};

fn guessed(text: &str) -> String {
    let grid = read(text.as_bytes(), Marks::default()).unwrap();
    Map { columns: guess(&grid, &Map::default()), ..Map::default() }.written()
}

#[test]
fn headers_say_what_and_in_which_unit() {
    assert_eq!(
        guessed("t [s];w pp [µm];Freq (kHz);V_mm_s;dir;FN / mN;Ft N\n0;1,5;27,5;10;1;250;0,1\n"),
        "\"t [s]\"=time:s, \"w pp [µm]\"=amplitude_pp:um, \"Freq (kHz)\"=frequency:kHz, V_mm_s=speed:mm/s, \
         dir=direction, \"FN / mN\"=normal_force:mN, \"Ft N\"=lateral_force:N"
    );
    assert_eq!(
        guessed("TIME,AMP_UM,FREQ_KHZ,VEL_MM_S,LOAD_MN,FX_MN,COF\n0,1,27.5,-10,250,-100,0.4\n"),
        "TIME=time:s, AMP_UM=amplitude_pp:um, FREQ_KHZ=frequency:kHz, VEL_MM_S=velocity:mm/s, LOAD_MN=normal_force:mN, FX_MN=lateral_force:mN"
    );
    assert_eq!(guessed("fx,lateral,fn\n1,2,3\n"), "fn=normal_force:N", "two lateral forces");
}

#[test]
fn entries_may_hold_commas_and_numbers_of_columns() {
    let grid = read(b"\"F, raw\",b\n1,2\n", Marks::default()).unwrap();
    let taken = Map::stated(&grid, &["\"F, raw\"=lateral_force:-mN, #2=speed_m_s".into()]).unwrap();
    assert_eq!((taken[0].index, taken[1].index), (0, 1));
    assert_eq!(taken[0].unit.apply("5"), Some(-0.005));
    // As a terminal breaks it.
    let broken = Map::stated(&grid, &["\"F,\n        raw\"=lateral_force:mN,\n  b=speed_m_s".into()]);
    assert_eq!(broken.unwrap().iter().map(|t| t.index).collect::<Vec<_>>(), [0, 1]);
    let wrong = Map::stated(&grid, &["c=speed:mm/s, b=speed, b=pace:s, b=speed:N".into()]).unwrap_err();
    assert_eq!(wrong.len(), 4, "{wrong:?}");
}

#[test]
fn strokes_and_bare_letters() {
    for (header, expected) in [
        ("Amplitude (µm p-p)", "amplitude_pp:um"),
        ("Amplitude [um pp]", "amplitude_pp:um"),
        ("peak-to-peak amplitude (um)", "amplitude_pp:um"),
        ("Amplitude peak to peak / um", "amplitude_pp:um"),
        ("Amplitude peak-peak (um)", "amplitude_pp:um"),
        ("Amplitude (um, 0-p)", "amplitude_peak:um"),
        ("Amplitude (um rms)", "amplitude_rms:um"),
        ("Amplitude peak (um)", "amplitude_peak:um"),
        ("amp_um", "amplitude_pp:um"),
        ("f (kHz)", "frequency:kHz"),
    ] {
        let found = guessed(&format!("\"{header}\";b\n1;2\n"));
        assert!(found.ends_with(&format!("={expected}")), "{header}: {found}");
    }
    for header in ["F", "amp", "F (N)", "w", "Peak load (N)", "speed;rpm"] {
        let units = header.split_once(';').map_or(String::new(), |(_, unit)| format!("{unit};N\n"));
        let name = header.split(';').next().unwrap();
        assert_eq!(guessed(&format!("{name};Fn (N)\n{units}2;5\n")), "\"Fn (N)\"=normal_force:N", "{header}");
    }
}

#[test]
fn all_that_is_missing_is_told_at_once() {
    let mut map = Map::default();
    let lacks = |map: &Map| map.lacks(&Grid::default(), false);
    assert_eq!(lacks(&map).len(), 7);
    map.set(&["time_s=rows, direction=forward, speed=10:mm/s".into()]).unwrap();
    assert_eq!(map.constants[1].value, 0.01);
    assert_eq!(lacks(&map).len(), 4, "{:?}", lacks(&map));
}
