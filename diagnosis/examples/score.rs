//! dev
use diagnosis::data::{Rig, Table};
use diagnosis::hypotheses::{Options, fit_all};
use std::time::Instant;
fn num(s: &str, k: &str) -> f64 {
    let i = match s.find(k) {
        Some(i) => i,
        None => return 0.0,
    };
    s[i + k.len()..]
        .trim_start_matches(|c: char| c == ' ' || c == '=' || c == ':' || c == '"')
        .split(|c: char| !(c.is_ascii_digit() || c == '.' || c == 'e' || c == '-' || c == '+'))
        .next()
        .unwrap()
        .parse()
        .unwrap_or(0.0)
}
fn main() {
    let dir = std::env::args().nth(1).unwrap();
    let from: usize = std::env::args().nth(2).and_then(|s| s.parse().ok()).unwrap_or(0);
    let to: usize = std::env::args().nth(3).and_then(|s| s.parse().ok()).unwrap_or(1000000);
    let pairs = std::env::args().nth(4).is_some();
    let mut sets: Vec<_> = std::fs::read_dir(dir).unwrap().map(|e| e.unwrap().path()).collect();
    sets.sort();
    for (k, s) in sets.iter().enumerate() {
        if k < from || k >= to {
            continue;
        }
        let t = std::fs::read_to_string(s.join("rig.toml")).unwrap();
        let Ok(label) = std::fs::read_to_string(s.join("label.json")) else { continue };
        let mut f = models::finger::Finger::paper();
        f.normal_stiffness_n_per_m = num(&t, "normal_stiffness_n_per_m");
        f.lateral_stiffness_n_per_m = num(&t, "lateral_stiffness_n_per_m");
        f.stiffness_relative_sd = num(&t, "stiffness_relative_sd");
        let rig = Rig {
            finger: f,
            noise: diagnosis::data::Noise {
                pass_relative_sd: num(&t, "pass_relative_sd"),
                force_sd_n: num(&t, "force_sd_n"),
            },
            calibration: Default::default(),
        };
        let passes = models::record::read_passes(std::fs::File::open(s.join("table.csv")).unwrap()).unwrap();
        let table = Table::measured(&passes).unwrap();
        let t0 = Instant::now();
        let fit = fit_all(&table, &rig, &Options { pairs, ..Default::default() });
        let dt = t0.elapsed().as_secs_f64();
        let truth = &label[label.find('[').unwrap()..=label.find(']').unwrap()];
        let chi = num(&label, "chi2_gain\"");
        let gap = num(&label, "\"gap\"");
        let floor = num(&label, "\"floor\"");
        let d = diagnosis::attribute::decide(&fit);
        let list: Vec<String> = fit
            .candidates
            .iter()
            .zip(&d.probabilities)
            .take(3)
            .map(|(c, p)| {
                format!(
                    "{} {:.3}({:.0}; law{} s{} u{:.2?})",
                    c.names().join("+"),
                    p,
                    c.log_evidence - fit.none.log_evidence,
                    c.best.members[0].law,
                    c.best.share,
                    &c.best.u[3..]
                )
            })
            .collect();
        let class: Vec<String> = d.class.iter().map(|&i| fit.candidates[i].names().join("+")).collect();
        println!(
            "{k:3} n{:3} {:.2}s {truth:36} chi {chi:7.0} gap/fl {:.1} | {:?} {} | none {:.2} unk {:.2}({:.0}) pe {:?} | gate {:.2} {}/{} | {}",
            table.len(),
            dt,
            gap / floor,
            d.verdict,
            class.join(","),
            d.none,
            d.unknown,
            fit.wildcard.log_evidence - fit.none.log_evidence,
            fit.pure.variance_ratio.map(|v| (v * 100.).round() / 100.),
            d.gate.pooled,
            d.gate.closed,
            d.gate.carrying,
            list.join(" | ")
        );
        if to == from + 1 {
            dump(&fit);
        }
    }
}
#[allow(dead_code)]
fn dump(fit: &diagnosis::hypotheses::Fitted) {
    let p = &fit.problem;
    let m = &fit.none.prediction;
    println!("nominal {:?} none u {:?}", p.nominal, fit.none.u);
    let mut idx: Vec<usize> = (0..p.len()).collect();
    idx.sort_by(|a, b| {
        let z = |i: usize| ((p.lateral[i] - m[i]) / p.variance[i].sqrt()).abs();
        z(*b).total_cmp(&z(*a))
    });
    for &i in idx.iter().take(25) {
        let q = &p.passes[i];
        println!(
            "w {:.2} f {:.0} U {:.4} F {:.3} d {} | y {:.5} m {:.5} smooth {:.5} best {:.5} sd {:.5} z {:.1}",
            q.amplitude_pp_m * 1e6,
            q.frequency_hz,
            q.speed_m_s,
            q.normal_force_n,
            q.direction,
            p.lateral[i],
            m[i],
            fit.wildcard.smooth[i],
            fit.candidates[0].best.prediction[i],
            p.variance[i].sqrt(),
            (p.lateral[i] - m[i]) / p.variance[i].sqrt()
        );
    }
}
