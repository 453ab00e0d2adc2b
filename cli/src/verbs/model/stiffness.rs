//! `muprime model stiffness`: static stiffnesses of the ridge across and along the plate, and what their ratio says of Psi*.

use super::conditions::ContactArgs;
use super::refused;
use crate::verbs::prelude::*;
use clap::Args;
use models::Reading;
use models::ridge::static_stiffness::{HeldAt, StaticStiffness, of_case};
use models::ridge::{
    FrictionRule, RidgeCase, RidgeError, RidgeGeometry, RidgeProfile, Strain, case, short_study,
};
use serde::Serialize;

/// Arguments of `muprime model stiffness`.
#[derive(Args)]
pub struct StiffnessArgs {
    /// Elements of the mesh, about (of the survey's too, whose default is 200)
    #[arg(long)]
    elements: Option<usize>,
    /// Mean pressure at 0.25 N in Pa
    #[arg(long, default_value_t = case::MEAN_PRESSURE_AT_QUARTER_NEWTON_PA)]
    mean_pressure_pa: f64,
    /// Poisson's ratio of the skin
    #[arg(long, default_value_t = 0.33)]
    poisson_ratio: f64,
    /// Young's modulus of the stratum corneum in Pa
    #[arg(long, default_value_t = 28.3e6)]
    young_modulus_pa: f64,
    #[command(flatten)]
    contact: ContactArgs,
    /// The ridges of a survey instead, each with its ratio and its Psi* (a minute or two of CPU)
    #[arg(long)]
    survey: bool,
}

impl StiffnessArgs {
    fn base(&self) -> RidgeCase {
        self.contact.of(RidgeCase {
            elements: self.elements.unwrap_or(if self.survey { 200 } else { case::ELEMENTS }),
            mean_pressure_pa: self.mean_pressure_pa,
            poisson_ratio: self.poisson_ratio,
            young_modulus_pa: self.young_modulus_pa,
            ..RidgeCase::paper()
        })
    }
}

/// Loads in multiples of the mean one: in a cycle the contact carries several times the mean.
const LOADS: [f64; 3] = [1.0, 3.0, 10.0];

/// What a line is about, and the case.
type Row = (&'static str, RidgeCase);

/// What is varied in the table: shape, moduli, thickness, Poisson's ratio, contact.
fn table(base: RidgeCase) -> Vec<Row> {
    let shaped = |geometry| RidgeCase { geometry, ..base };
    let profile = |profile| shaped(RidgeGeometry { profile, ..base.geometry });
    let corneum = |inner_corneum_m| shaped(RidgeGeometry { inner_corneum_m, ..base.geometry });
    let ridge = |ridge_height_m| shaped(RidgeGeometry { ridge_height_m, ..base.geometry });
    vec![
        ("as given", base),
        ("ellipse", profile(RidgeProfile::Ellipse)),
        ("flat slab", profile(RidgeProfile::Flat)),
        ("ridge 50 \u{b5}m high", ridge(50e-6)),
        ("inner corneum 30 \u{b5}m", corneum(30e-6)),
        ("inner corneum 300 \u{b5}m", corneum(300e-6)),
        ("modulus 20 MPa", RidgeCase { young_modulus_pa: 20e6, ..base }),
        ("modulus 200 MPa", RidgeCase { young_modulus_pa: 200e6, ..base }),
        ("Poisson's ratio 0.2", RidgeCase { poisson_ratio: 0.2, ..base }),
        ("Poisson's ratio 0.45", RidgeCase { poisson_ratio: 0.45, ..base }),
        ("pressure 3.5 kPa", RidgeCase { mean_pressure_pa: 3.5e3, ..base }),
        ("pressure 13 kPa", RidgeCase { mean_pressure_pa: 13e3, ..base }),
        ("penalty 33 E_sc", RidgeCase { penalty_ratio: 33.0, ..base }),
        ("tangential penalty 0.1 k", RidgeCase { tangential_penalty_ratio: 0.1, ..base }),
        ("tangential penalty 0.03 k", RidgeCase { tangential_penalty_ratio: 0.03, ..base }),
        ("layer 1e13 Pa/m", RidgeCase { tangential_stiffness_pa_m: Some(1e13), ..base }),
        ("layer 3e12 Pa/m", RidgeCase { tangential_stiffness_pa_m: Some(3e12), ..base }),
        ("layer 1e12 Pa/m", RidgeCase { tangential_stiffness_pa_m: Some(1e12), ..base }),
        ("layer 5e11 Pa/m", RidgeCase { tangential_stiffness_pa_m: Some(5e11), ..base }),
        ("layer 2e11 Pa/m", RidgeCase { tangential_stiffness_pa_m: Some(2e11), ..base }),
    ]
}

/// What statics do not know: the kernel's other measure of strain, the other friction rule, less damping.
fn dynamic(base: RidgeCase) -> [Row; 3] {
    [
        ("small strain", RidgeCase { strain: Strain::Small, ..base }),
        ("local friction", RidgeCase { friction: FrictionRule::Local, ..base }),
        ("damping 3.5e5 /s", RidgeCase { mass_damping_per_s: 3.5e5, ..base }),
    ]
}

#[derive(Serialize)]
struct Answer {
    what: &'static str,
    held_at: HeldAt,
    load_over_mean: f64,
    /// Newtons on the whole finger for each N/m on the ridge.
    finger_per_ridge_m: f64,
    #[serde(flatten)]
    found: StaticStiffness,
}

#[derive(Serialize)]
struct Surveyed {
    what: &'static str,
    lateral_over_normal: f64,
    lateral_over_normal_at_3_loads: f64,
    psi_star: Option<f64>,
    psi_star_sd: Option<f64>,
    rmse: Option<f64>,
    points: usize,
    /// Psi* of the massless slider with the ridge's own static springs.
    slider_psi_star: Option<f64>,
    /// Psi* in the units of Eq. 16, with the ridge's own ratio: Psi* (1 + nu) k_l/k_n.
    psi_star_eq16: Option<f64>,
}

fn answers(args: &StiffnessArgs) -> Result<Vec<Answer>, RidgeError> {
    let mut all = Vec::new();
    let mut solve = |(what, case): Row, held_at: HeldAt, load_over_mean: f64| -> Result<(), RidgeError> {
        let found = of_case(&case, load_over_mean * case.line_load_n_m(), held_at)?;
        let finger_per_ridge_m = case.finger_per_ridge_m();
        all.push(Answer { what, held_at, load_over_mean, finger_per_ridge_m, found });
        Ok(())
    };
    let rows = table(args.base());
    for held_at in HeldAt::ALL {
        for load in LOADS {
            solve(rows[0], held_at, load)?;
        }
    }
    for row in &rows[1..] {
        solve(*row, HeldAt::CorneumBase, 1.0)?;
        solve(*row, HeldAt::CorneumBase, 3.0)?;
    }
    Ok(all)
}

fn survey(args: &StiffnessArgs) -> Result<Vec<Surveyed>, RidgeError> {
    let of = |(what, case): Row| -> Result<Surveyed, RidgeError> {
        let load = case.line_load_n_m();
        let lateral_over_normal = of_case(&case, load, HeldAt::CorneumBase)?.lateral_over_normal;
        let at_3 = of_case(&case, 3.0 * load, HeldAt::CorneumBase)?.lateral_over_normal;
        let fit = short_study::psi_star(case, Reading::PeakToPeak)?;
        let slider = short_study::slider_psi_star(case, Reading::PeakToPeak)?;
        Ok(Surveyed {
            what,
            lateral_over_normal,
            lateral_over_normal_at_3_loads: at_3,
            psi_star: fit.map(|f| f.psi_star),
            psi_star_sd: fit.map(|f| f.psi_star_sd),
            rmse: fit.map(|f| f.rmse),
            points: fit.map_or(0, |f| f.points),
            slider_psi_star: slider.map(|f| f.psi_star),
            psi_star_eq16: fit.map(|f| f.psi_star * (1.0 + case.poisson_ratio) * at_3),
        })
    };
    table(args.base()).into_iter().chain(dynamic(args.base())).map(of).collect()
}

/// Runs the solve or the survey; refuses bad input.
pub fn run(args: &StiffnessArgs, json: bool) -> miette::Result<ExitCode> {
    if args.survey {
        let rows = survey(args).map_err(refused)?;
        if json {
            answer_json(&rows);
            return Ok(ExitCode::SUCCESS);
        }
        out!("                          k_l/k_n  at 3 F           Psi*  rmse slider's Eq. 16");
        for r in rows {
            let Surveyed { what, lateral_over_normal, lateral_over_normal_at_3_loads: at_3, .. } = r;
            let number = |v: Option<f64>| v.map_or("none".into(), |v| format!("{v:.2}"));
            let fitted = format!("{} +- {}", number(r.psi_star), number(r.psi_star_sd));
            let rmse = r.rmse.map_or("none".into(), |v| format!("{v:.3}"));
            let [slider, eq16] = [r.slider_psi_star, r.psi_star_eq16].map(number);
            out!(
                "{what:<25} {lateral_over_normal:>7.3} {at_3:>7.3} {fitted:>14} {rmse:>5} {slider:>8} {eq16:>6}"
            );
        }
        return Ok(ExitCode::SUCCESS);
    }
    let rows = answers(args).map_err(refused)?;
    if json {
        answer_json(&rows);
        return Ok(ExitCode::SUCCESS);
    }
    let nu = args.poisson_ratio;
    out!("Closed forms of k_l/k_n at Poisson's ratio {nu}:");
    for (of, ratio) in [
        ("wide slab bonded at its base", (1.0 - 2.0 * nu) / (2.0 * (1.0 - nu))),
        ("G/E", 0.5 / (1.0 + nu)),
        ("circle on a half space (Mindlin)", 2.0 * (1.0 - nu) / (2.0 - nu)),
        ("Eq. 17", 1.0 / (1.0 + nu)),
    ] {
        out!("  {of:<32} {ratio:.3}");
    }
    out!("\nBy finite elements; stiffnesses of the whole finger in MN/m, load in multiples of the mean:");
    out!("                          held at load width \u{b5}m     k_n  secant     k_l  k_l/k_n");
    for r in &rows {
        let finger = 1e-6 * r.finger_per_ridge_m;
        let held = match r.held_at {
            HeldAt::CorneumBase => "corneum",
            HeldAt::DermisBase => "dermis",
            HeldAt::Top => "top",
        };
        let StaticStiffness { normal_pa, normal_secant_pa, lateral_pa, lateral_over_normal, .. } = r.found;
        let [normal, secant, lateral] = [normal_pa, normal_secant_pa, lateral_pa].map(|pa| finger * pa);
        let (what, load, width) = (r.what, r.load_over_mean, 1e6 * r.found.contact_width_m);
        out!(
            "{what:<25} {held:<7} {load:>4} {width:>8.1} {normal:>7.3} {secant:>7.3} {lateral:>7.3} \
             {lateral_over_normal:>8.3}"
        );
    }
    Ok(ExitCode::SUCCESS)
}
