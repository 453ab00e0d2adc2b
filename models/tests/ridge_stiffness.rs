//! Static stiffnesses of the ridge against closed forms; and what its ratio says of Psi*. Each test prints the numbers that it judges.

use muprime_models::Reading;
use muprime_models::ridge::patch::{Patch, plane_stress};
use muprime_models::ridge::short_study;
use muprime_models::ridge::static_stiffness::{HeldAt, Springs, of_case, of_mesh};
use muprime_models::ridge::{Material, Mesh, RidgeCase, RidgeGeometry, RidgeProfile, RunSettings, run};
use std::f64::consts::PI;

const SKIN: Material = Material::elastic(28.3e6, 0.33, 750.0);

fn rigid(nodes: usize, touching: impl Fn(usize) -> bool) -> Springs {
    let across: Vec<f64> = (0..nodes).map(|i| if touching(i) { f64::INFINITY } else { 0.0 }).collect();
    Springs { along: across.clone(), across }
}

/// A wide flat layer bonded at its base: M = E (1 - nu) / ((1 + nu)(1 - 2 nu)) per thickness across, G per thickness along; layers in series.
#[test]
fn a_wide_slab_is_its_layers_in_series() {
    let soft = Material::elastic(1.5e6, 0.45, 750.0);
    let (width, thickness) = (0.5e-3, [0.3e-3, 0.6e-3]);
    let level = |j: usize| if j <= 6 { 0.05e-3 * j as f64 } else { 0.3e-3 + 0.1e-3 * (j - 6) as f64 };
    let layers = [vec![SKIN; 6], vec![soft; 6]].concat();
    let mesh = Mesh::from_nodes(8, layers, true, |i, j| (width * i as f64 / 8.0, level(j))).expect("a mesh");
    let found = of_mesh(&mesh, 12, &rigid(8, |_| true), 3.5).expect("stiffness");
    let modulus = |m: &Material| m.lambda_pa() + 2.0 * m.shear_modulus_pa();
    let series =
        |of: &dyn Fn(&Material) -> f64| width / (thickness[0] / of(&SKIN) + thickness[1] / of(&soft));
    let (normal, lateral) = (series(&modulus), series(&|m| m.shear_modulus_pa()));
    println!(
        "k_n {:.6e} Pa, closed form {normal:.6e}; k_l {:.6e}, closed form {lateral:.6e}",
        found.normal_pa, found.lateral_pa
    );
    assert!((found.normal_pa / normal - 1.0).abs() < 1e-9);
    assert!((found.lateral_pa / lateral - 1.0).abs() < 1e-9);
    assert!((found.normal_secant_pa / normal - 1.0).abs() < 1e-9);
    // Uniform pressure has the second moment w^2 / 12, Hertz's w^2 / 16; eight nodes make it a little less.
    assert!((found.contact_width_m / width - (4.0 / 3.0_f64).sqrt()).abs() < 0.02);
}

/// A half plane far from its hold, graded to the middle of its surface.
fn half_plane(nx: usize, ny: usize, size: f64, first: f64, material: Material) -> Mesh {
    let ladder = |n: usize| -> Vec<f64> {
        let sum = |r: f64| first * (r.powi(n as i32) - 1.0) / (r - 1.0);
        let (mut low, mut high) = (1.0 + 1e-9, 3.0);
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if sum(middle) < size { low = middle } else { high = middle }
        }
        (0..=n).map(|k| if k == 0 { 0.0 } else { first * (low.powi(k as i32) - 1.0) / (low - 1.0) }).collect()
    };
    let (across, deep) = (ladder(nx / 2), ladder(ny));
    Mesh::from_nodes(nx, vec![material; ny], false, |i, j| {
        let x = if i < nx / 2 { -across[nx / 2 - i] } else { across[i - nx / 2] };
        (x, deep[j])
    })
    .expect("a mesh")
}

/// Flamant: a narrow contact on a half plane yields along the surface as it does across it. Twice the width,
/// and both compliances fall by 2 (1 - nu^2) ln 2 / (pi E) (Johnson 1985, 2.3, and 2.8 for a rigid punch).
#[test]
fn narrow_contacts_follow_flamant_both_ways() {
    for nu in [0.2, 0.33, 0.45] {
        let material = Material::elastic(28.3e6, nu, 750.0);
        let mesh = half_plane(64, 28, 2e-3, 0.5e-6, material);
        let at = |half: f64| {
            let touching = |i: usize| mesh.x_m[i].abs() < half;
            of_mesh(&mesh, 28, &rigid(65, touching), 1.0).expect("stiffness")
        };
        let (narrow, wide) = (at(4e-6), at(32e-6));
        let ratio = wide.contact_width_m / narrow.contact_width_m;
        let flamant = 2.0 * (1.0 - nu * nu) / (PI * 28.3e6) * ratio.ln();
        let fall = |of: fn(&muprime_models::ridge::static_stiffness::StaticStiffness) -> f64| {
            (1.0 / of(&narrow) - 1.0 / of(&wide)) / flamant
        };
        let (across, along) = (fall(|s| s.normal_frictionless_pa), fall(|s| s.lateral_pa));
        println!(
            "nu {nu}: fall of the compliance over Flamant's: across {across:.4}, along {along:.4}; k_l/k_n {:.3} and {:.3}",
            narrow.lateral_over_normal, wide.lateral_over_normal
        );
        assert!((across - 1.0).abs() < 0.03 && (along - 1.0).abs() < 0.03, "{nu}: {across} {along}");
    }
}

/// Hertz: the half-width under a load, and the tangent compliance that falls with it as the logarithm.
#[test]
fn the_ridges_tip_is_hertzian() {
    let case = RidgeCase {
        penalty_ratio: 1e3,
        elements: 2000,
        geometry: RidgeGeometry { ridge_height_m: 50e-6, ..RidgeGeometry::TABLE_1 },
        ..RidgeCase::paper()
    };
    let reduced = 28.3e6 / (1.0 - 0.33 * 0.33);
    // Of a parabola's tip.
    let radius = (0.5 * case.geometry.ridge_width_m).powi(2) / (2.0 * case.geometry.ridge_height_m);
    let found = [7.0, 28.0].map(|load| of_case(&case, load, HeldAt::Top).expect("stiffness"));
    for s in &found {
        let half = (4.0 * s.line_load_n_m * radius / (PI * reduced)).sqrt();
        println!(
            "{} N/m: width {:.2} um, Hertz {:.2} um; peak {:.0} Pa, Hertz {:.0} Pa",
            s.line_load_n_m,
            1e6 * s.contact_width_m,
            2e6 * half,
            s.peak_pressure_pa,
            2.0 * s.line_load_n_m / (PI * half)
        );
        assert!((s.contact_width_m / (2.0 * half) - 1.0).abs() < 0.06);
        assert!((s.peak_pressure_pa * PI * half / (2.0 * s.line_load_n_m) - 1.0).abs() < 0.03);
    }
    // Four times the load, twice the width: the tangent compliance falls by 2 ln 2 / (pi E*).
    let fall = 1.0 / found[0].normal_frictionless_pa - 1.0 / found[1].normal_frictionless_pa;
    let closed = 2.0 * 2.0_f64.ln() / (PI * reduced);
    println!("fall of the compliance {fall:.4e}, closed form {closed:.4e}");
    assert!((fall / closed - 1.0).abs() < 0.1);
}

/// The ratio of the paper's ridge, that of a slab, and what a layer along the plate does to it, alike on every mesh.
#[test]
fn ratio_of_the_papers_ridge() {
    let at = |case: RidgeCase| of_case(&case, case.line_load_n_m(), HeldAt::CorneumBase).expect("stiffness");
    let base = RidgeCase { elements: 800, ..RidgeCase::paper() };
    let ridge = at(base).lateral_over_normal;
    let flat = RidgeCase { geometry: RidgeGeometry { profile: RidgeProfile::Flat, ..base.geometry }, ..base };
    let slab = at(RidgeCase { penalty_ratio: 1e4, ..flat }).lateral_over_normal;
    let closed = (1.0 - 2.0 * 0.33) / (2.0 * (1.0 - 0.33));
    println!("k_l/k_n: ridge {ridge:.3}, slab {slab:.4} (closed form {closed:.4}), G/E {:.3}", 0.5 / 1.33);
    assert!((slab / closed - 1.0).abs() < 0.01);
    assert!(ridge > slab && ridge < 1.0);
    let layered = |elements: usize| {
        let case = RidgeCase { elements, tangential_stiffness_pa_m: Some(1e12), ..base };
        of_case(&case, 17.5, HeldAt::CorneumBase).expect("stiffness").lateral_over_normal
    };
    let (coarse, fine) = (layered(800), layered(2000));
    println!(
        "five times the load, 1e12 Pa/m along the plate: k_l/k_n {coarse:.3} on 800 elements, {fine:.3} on 2000"
    );
    assert!((coarse / fine - 1.0).abs() < 0.05 && fine < 0.9 * ridge);
}

/// The ratio decides the law: the massless slider with the ridge's own static springs has the ridge's Psi*,
/// with and without a layer along the plate that halves the ratio.
#[test]
fn static_springs_give_the_ridges_law() {
    let base = RidgeCase { elements: 200, ..RidgeCase::paper() };
    for layer in [None, Some(5e11)] {
        let case = RidgeCase { tangential_stiffness_pa_m: layer, ..base };
        let of = |fit: Option<muprime_models::psi_fit::PsiFit>| fit.expect("a Psi*").psi_star;
        let ridge = of(short_study::psi_star(case, Reading::PeakToPeak).expect("runs"));
        let slider = of(short_study::slider_psi_star(case, Reading::PeakToPeak).expect("solves"));
        let ratio = of_case(&case, 3.0 * case.line_load_n_m(), HeldAt::CorneumBase).expect("stiffness");
        let eq16 = ridge * 1.33 * ratio.lateral_over_normal;
        println!(
            "layer {layer:?}: Psi* of the ridge {ridge:.3}, of the slider with its springs {slider:.3}; Eq. 16's {eq16:.3}"
        );
        assert!((slider / ridge - 1.0).abs() < 0.08 && (0.8..1.1).contains(&eq16));
    }
}

/// What one ridge in plane strain leaves out is no factor of two: the ends of what ridges of two heights and of finite length can do.
#[test]
fn neither_a_patch_nor_a_short_ridge_moves_psi_star_by_a_factor() {
    let base = RidgeCase { elements: 200, ..RidgeCase::paper() };
    let settings = RunSettings { energy: false, ..RunSettings::default() };
    let psi_star = |mu: &(dyn Fn(&RidgeCase) -> f64 + Sync)| {
        let fit = short_study::psi_star_with(base, Reading::PeakToPeak, |case| Ok(mu(case)));
        fit.expect("runs").expect("a Psi*").psi_star
    };
    let one = psi_star(&|case| run(case, &settings).expect("runs").mu_relative);
    let uneven = Patch::TwoHeights { uneven: 1.0 };
    let patch = psi_star(&|case| uneven.mu_relative(case, &settings).expect("runs"));
    let short = psi_star(&|case| run(&plane_stress(*case), &settings).expect("runs").mu_relative);
    println!("Psi* of one ridge {one:.3}; half of the ridges carry all {patch:.3}; plane stress {short:.3}");
    assert!((patch / one - 1.0).abs() < 0.15 && (short / one - 1.0).abs() < 0.05);
}
