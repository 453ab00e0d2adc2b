//! `muprime calibrate phase`: the paper's section 2 from recorded waveforms.

use super::{Bench, CalibrationResult, Sources, columns};
use calibration::amplitude::vibrometer::{Decoder, amplitude};
use calibration::phase::{
    Acquisition, PhasePoint, RepeatedShift, Shift, Waveforms, outcome, repeated, shift, write_phases,
};
use models::PeakToPeak;
use runs::{Setup, say};
use std::path::PathBuf;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Waveforms, one file an acquisition, as CSV: plate_v, skin_v. Repeats of one amplitude are recognised
    /// by the plate's amplitude (within --same)
    #[arg(required = true)]
    waveforms: Vec<PathBuf>,
    /// Sample rate of the digitiser
    #[arg(long)]
    rate_hz: f64,
    /// Frequency of the drive
    #[arg(long, default_value_t = 27_500.0)]
    frequency_hz: f64,
    /// Setup with a [vibrometer]: range and delay of the decoder are read back from it, for plate and skin,
    /// where the four flags below do not state them
    #[arg(long)]
    setup: Option<String>,
    /// Range of the plate's decoder, as the controller says it [default: read back, or 125mm/s/V]
    #[arg(long)]
    plate_range: Option<String>,
    /// Delay of the plate's decoder, as the controller says it [default: read back, or 0 us]
    #[arg(long)]
    plate_delay: Option<String>,
    /// Range of the skin's decoder [default: read back, or 125mm/s/V]
    #[arg(long)]
    skin_range: Option<String>,
    /// Delay of the skin's decoder [default: read back, or 0 us]
    #[arg(long)]
    skin_delay: Option<String>,
    /// Standard uncertainty of the difference of the two delays in s
    #[arg(long, default_value_t = 0.0)]
    delay_sd_s: f64,
    /// Condition of the finger: moist, dry or free text
    #[arg(long)]
    condition: Option<String>,
    /// Normal force during the acquisitions
    #[arg(long)]
    normal_force_n: Option<f64>,
    /// Amplitudes are one amplitude within this share
    #[arg(long, default_value_t = 0.05)]
    same: f64,
    /// The phase table that is written
    #[arg(long, default_value = "PHASES.csv")]
    phases: PathBuf,
}

/// Calibrates.
pub fn calibrate(args: &Args, bench: &dyn Bench, sources: &mut Sources) -> miette::Result<CalibrationResult> {
    let settings = |name: &String| bench.vibrometer(&Setup::load(name)?, args.frequency_hz);
    let settings = args.setup.as_ref().map(settings).transpose()?;
    settings.iter().for_each(|settings| say!("vibrometer: {settings}"));
    let decoder = |name: &str, range: &Option<String>, delay: &Option<String>| {
        let (range_text, delay_text) =
            (range.as_deref().unwrap_or("125mm/s/V"), delay.as_deref().unwrap_or("0 us"));
        let stated = Decoder::from_settings(name, range_text, delay_text);
        let stated = stated.map_err(|e| miette::miette!("{name}: {e}"))?;
        let read = settings.as_ref().map_or_else(|| stated.clone(), |s| s.decoder());
        Ok::<_, miette::Report>(Decoder {
            name: stated.name,
            range_m_s_per_v: if range.is_some() { stated.range_m_s_per_v } else { read.range_m_s_per_v },
            delay_s: if delay.is_some() { stated.delay_s } else { read.delay_s },
        })
    };
    let plate = decoder("plate", &args.plate_range, &args.plate_delay)?;
    let skin = decoder("skin", &args.skin_range, &args.skin_delay)?;
    let mut shifts: Vec<(f64, Shift)> = Vec::new();
    let mut seen: Vec<Vec<[f64; 2]>> = Vec::new();
    for path in &args.waveforms {
        let rows = columns(sources, path, ["plate_v", "skin_v"], &[])?;
        if let Some(first) = seen.iter().position(|other| *other == rows) {
            miette::bail!(
                help = "each acquisition counts once: remove the copy, for it would narrow the uncertainty",
                "{}: its samples are those of {} again",
                path.display(),
                args.waveforms[first].display()
            );
        }
        let (plate_v, skin_v): (Vec<f64>, Vec<f64>) = rows.iter().map(|r| (r[0], r[1])).unzip();
        let (rate_hz, frequency_hz) = (args.rate_hz, args.frequency_hz);
        let (plate_v, skin_v) = (&plate_v[..], &skin_v[..]);
        let waveforms = Waveforms { plate_v, skin_v, rate_hz, frequency_hz, plate: &plate, skin: &skin };
        let shown = path.display();
        let found = shift(&waveforms).map_err(|e| miette::miette!("{shown}: {e}"))?;
        let moved =
            amplitude(plate_v, rate_hz, frequency_hz, &plate).map_err(|e| miette::miette!("{shown}: {e}"))?;
        shifts.push((moved.metres(), found));
        seen.push(rows);
    }
    shifts.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut points = Vec::new();
    let mut found: Vec<(PeakToPeak, RepeatedShift)> = Vec::new();
    for group in shifts.chunk_by(|a, b| b.0 - a.0 <= args.same * a.0) {
        let w = group.iter().map(|g| g.0).sum::<f64>() / group.len() as f64;
        let repeats: Vec<Shift> = group.iter().map(|g| g.1).collect();
        let mean = repeated(&repeats, args.frequency_hz, args.delay_sd_s)
            .map_err(|e| miette::miette!("{}: {e}", PeakToPeak::from_metres(w)))?;
        points.push(PhasePoint {
            amplitude: PeakToPeak::from_metres(w),
            phase_shift_deg: mean.phase_deg.value,
            phase_shift_sd_deg: Some(mean.repeat_sd_deg),
            repeats: Some(mean.repeats as u32),
            condition: args.condition.clone(),
            frequency_hz: Some(args.frequency_hz),
            normal_force_n: args.normal_force_n,
        });
        found.push((PeakToPeak::from_metres(w), mean));
    }
    let mut table = Vec::new();
    write_phases(&mut table, &points).map_err(|e| miette::miette!("{e}"))?;
    runs::files::write_whole(&args.phases, &table)?;
    say!("{} amplitudes: {}", points.len(), args.phases.display());
    let (&Args { frequency_hz, delay_sd_s, normal_force_n, .. }, condition) = (args, args.condition.clone());
    let acquisition = Acquisition { frequency_hz, delay_sd_s, condition, normal_force_n };
    let mut outcome = outcome(&found, &acquisition);
    outcome.remarks.push(format!(
        "decoders: plate {:e} m/s/V and {:.3} \u{b5}s, skin {:e} m/s/V and {:.3} \u{b5}s{}",
        plate.range_m_s_per_v,
        plate.delay_s * 1e6,
        skin.range_m_s_per_v,
        skin.delay_s * 1e6,
        settings.map_or(String::new(), |s| format!("; read back from the vibrometer: {s}"))
    ));
    Ok(outcome)
}
