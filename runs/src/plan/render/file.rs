//! A target from a file: a table, or a row of an image.

use super::{MOST, RenderPlan};
use crate::input::{BadInput, text_of};
use crate::plan::{Plan, Series};
use crate::run_dir::sha256_of;
use models::Target;
use std::path::{Path, PathBuf};

/// Bytes of an image at most.
const MOST_BYTES: usize = 64 << 20;

impl Plan {
    /// What identifies the plan: its text, and its target's file. One that cannot be read is another one.
    pub fn sha256(&self) -> String {
        let render = self.file.render.as_ref().filter(|render| render.file.is_some());
        let file = render.map(|render| std::fs::read(render.path(self)).unwrap_or_default());
        sha256_of(&self.text, file.as_deref().into_iter())
    }
}

/// A problem of a file, and the remedy.
type Refused = (String, &'static str);

impl RenderPlan {
    /// The file, beside the plan.
    fn path(&self, plan: &Plan) -> PathBuf {
        let name = self.file.as_deref().unwrap_or_default();
        Path::new(&plan.origin).parent().unwrap_or(Path::new("")).join(name)
    }

    /// A target from its file, on an even grid as fine as the file's smallest step.
    pub(super) fn table(&self, plan: &Plan, mu0: f64) -> miette::Result<Target> {
        let path = self.path(plan);
        let text = text_of(&path)?;
        let shown = path.display().to_string();
        let base = plan.file.base.normal_force_n;
        let of = |s: &Series| if s.normal_force_n.is_empty() { vec![base] } else { s.normal_force_n.clone() };
        let mut loads_n: Vec<f64> = plan.file.series.iter().flat_map(of).collect();
        loads_n.dedup();
        self.rows(text.trim_start_matches('\u{feff}'), mu0, &loads_n).map_err(|(problem, remedy)| {
            BadInput::new(&shown, &text, None, format!("{shown}{problem}"), remedy.to_string()).into()
        })
    }

    /// The same from the file's text, for passes at these loads in N.
    fn rows(&self, text: &str, mu0: f64, loads_n: &[f64]) -> Result<Target, Refused> {
        let mut lines = text.lines().enumerate().filter(|(_, l)| !l.trim().is_empty() && !l.starts_with('#'));
        let head = lines.next().map_or("", |(_, l)| l.trim());
        let scale = match head {
            "x_m,mu_relative" => 1.0,
            "x_m,lateral_force_n" if loads_n.len() == 1 => 1.0 / (mu0 * loads_n[0]),
            "x_m,lateral_force_n" => {
                let problem = format!(" is in N, and the passes have the loads {loads_n:?} N");
                return Err((problem, "write one plan for each load, or a target of x_m,mu_relative"));
            }
            _ => {
                let problem = format!(" begins with '{head}'");
                return Err((problem, "a target's columns are x_m,mu_relative or x_m,lateral_force_n"));
            }
        };
        let mut points: Vec<[f64; 2]> = Vec::new();
        for (i, line) in lines {
            let cells = line.split_once(',').map(|(x, v)| [x, v].map(|c| c.trim().parse::<f64>()));
            let Some([Ok(x), Ok(v)]) = cells else {
                return Err((format!(": line {}: '{line}' is not two numbers", i + 1), "write x_m,value"));
            };
            let mu = v * scale;
            if !(mu > 0.0 && mu <= 1.0) || points.last().is_some_and(|p| x <= p[0]) {
                let problem = format!(": line {}: mu' = {mu} at {x} m", i + 1);
                return Err((problem, "mu' is above 0 and at most 1, and x_m increases from line to line"));
            }
            points.push([x, mu]);
        }
        let [Some(first), Some(last)] = [points.first(), points.last()] else {
            return Err((" has no values".into(), "a target has at least two lines of values"));
        };
        let finest = points.windows(2).map(|p| p[1][0] - p[0][0]).fold(f64::INFINITY, f64::min);
        let length = last[0] - first[0];
        let count = (length / finest).ceil() + 1.0;
        if !(2.0..=MOST).contains(&count) {
            let problem = format!(": {count} values on its finest step");
            return Err((problem, "at most 200000, and at least two"));
        }
        let step_m = length / (count - 1.0);
        let at = |i: usize| {
            let x = (first[0] + step_m * i as f64).min(last[0]);
            let k = points.partition_point(|p| p[0] < x).clamp(1, points.len() - 1);
            let [a, b] = [points[k - 1], points[k]];
            a[1] + (b[1] - a[1]) * (x - a[0]) / (b[0] - a[0])
        };
        let mu_relative = (0..count as usize).map(at).collect();
        Ok(Target { start_m: first[0], step_m, mu_relative, lead_s: self.lead_s, feedback: None })
    }

    /// A target from a row of a grey PNG, whose middle lies at this position in m.
    pub(super) fn image(&self, plan: &Plan, middle_m: f64) -> miette::Result<Target> {
        let path = self.path(plan);
        self.pixels(&path, middle_m).map_err(|(problem, remedy)| {
            let problem = format!("{}: {problem}", path.display());
            plan.refused(&["render", "file"], problem, remedy.to_string()).into()
        })
    }

    fn pixels(&self, path: &Path, middle_m: f64) -> Result<Target, Refused> {
        let unread = |e: &dyn std::fmt::Display| (e.to_string(), "give a PNG image");
        let file = std::fs::File::open(path).map_err(|e| unread(&e))?;
        let mut decoder = png::Decoder::new(std::io::BufReader::new(file));
        decoder.set_transformations(png::Transformations::EXPAND);
        let mut reader = decoder.read_info().map_err(|e| unread(&e))?;
        if reader.output_color_type().0 != png::ColorType::Grayscale {
            return Err(("the image is not grey".into(), "save it as a grey image without transparency"));
        }
        let (width, height) = (reader.info().width, reader.info().height);
        let row = self.row.unwrap_or(height / 2);
        if row >= height || width < 2 || f64::from(width) > MOST {
            let problem = format!("row {row} of {width} x {height} pixels");
            return Err((problem, "rows count from 0; a row has 2 to 200000 pixels"));
        }
        // Before anything is reserved: the size is what the file states of itself.
        let Some(size) = reader.output_buffer_size().filter(|size| *size <= MOST_BYTES) else {
            return Err((format!("{width} x {height} pixels"), "crop the image to 64 MB and less"));
        };
        let mut pixels = vec![0; size];
        let frame = reader.next_frame(&mut pixels).map_err(|e| unread(&e))?;
        let line = &pixels[row as usize * frame.line_size..][..frame.line_size];
        let grey: Vec<f64> = match frame.bit_depth {
            png::BitDepth::Sixteen => line
                .chunks_exact(2)
                .map(|b| f64::from(u16::from_be_bytes([b[0], b[1]])) / f64::from(u16::MAX))
                .collect(),
            _ => line.iter().map(|v| f64::from(*v) / f64::from(u8::MAX)).collect(),
        };
        let step_m = self.pixel_m.unwrap_or_default();
        let mu_relative = grey.iter().map(|v| self.mean + self.depth * (2.0 * v - 1.0)).collect();
        let start_m = middle_m - 0.5 * step_m * (grey.len() - 1) as f64;
        Ok(Target { start_m, step_m, mu_relative, lead_s: self.lead_s, feedback: None })
    }
}
