//! What every BSDF owes: draws that follow the density, weights that are the ratio, reciprocity, no
//! more light out than in, and nothing but numbers whatever the directions.

use equilux_common::scene::{Material, Surface, Texels, Texture};
use glam::Vec3;
use proptest::prelude::*;

use super::{Bsdf, mean};
use crate::chi_square::{Numbers, SphereGrid, p_value};
use crate::frame::Frame;

/// A normal without zeros.
fn normal() -> Vec3 {
    Vec3::new(0.3, -0.5, 0.7).normalize()
}

fn material(surface: Surface, opacity: f32) -> Material {
    Material { name: "test".into(), emission: [0.0; 3], surface, opacity }
}

fn bsdf(surface: Surface) -> Bsdf {
    Bsdf::new(&material(surface, 1.0), &[], [0.0; 2], normal(), normal())
}

fn plain(diffuse: f32, specular: f32, alpha: f32) -> Surface {
    let (diffuse, specular) = ([diffuse; 3], [specular; 3]);
    Surface::Plain { diffuse, diffuse_texture: None, specular, alpha }
}

fn pbr(base: f32, roughness: f32, metallic: f32) -> Surface {
    Surface::Pbr { base: [base; 3], base_texture: None, roughness, metallic }
}

/// Surfaces that scatter, each with the width of its narrowest lobe.
fn scattering() -> Vec<(Surface, f64)> {
    let mut found = vec![(plain(1.0, 0.0, 0.5), 0.3)];
    for alpha in [1e-4_f32, 0.005, 0.02, 0.1, 0.4, 1.0] {
        found.push((plain(0.0, 1.0, alpha), 0.1 * f64::from(alpha)));
        found.push((plain(0.7, 0.3, alpha), 0.1 * f64::from(alpha)));
    }
    for roughness in [0.1_f32, 0.5, 1.0] {
        for metallic in [0.0, 0.5, 1.0] {
            found.push((pbr(0.9, roughness, metallic), 0.1 * f64::from(roughness * roughness)));
        }
    }
    found
}

/// Directions at these angles from the normal (degrees), on both sides.
fn views() -> impl Iterator<Item = Vec3> {
    let angles = [0.0, 20.0, 45.0, 70.0, 85.0, 89.5, 100.0, 150.0_f64];
    angles.into_iter().map(|angle| {
        let (sin, cos) = libm::sincos(angle.to_radians());
        Frame::new(normal()).to_world(Vec3::new(0.6 * sin as f32, 0.8 * sin as f32, cos as f32))
    })
}

/// Cells around the mirror direction; none where the lobe, which shrinks with the cosine in one
/// direction only, is too slender for them (and in the end for `f32`).
fn grid_for(wo: Vec3, width: f64) -> Option<SphereGrid> {
    let cos = wo.dot(normal());
    let is_slender = f64::from(cos.abs()) < (1e-5 / width).clamp(0.05, 0.5) && width < 0.005;
    let mirrored = normal() * (2.0 * cos) - wo;
    (!is_slender).then(|| SphereGrid::new(mirrored, width * f64::from(cos.abs()).max(0.1)))
}

/// Each surface from each direction for which there is a grid.
fn for_all(mut check: impl FnMut(&str, &Bsdf, Vec3, &SphereGrid)) {
    for (surface, width) in scattering() {
        for wo in views() {
            let case = format!("{surface:?}, cos {}", wo.dot(normal()));
            if let Some(grid) = grid_for(wo, width) {
                check(&case, &bsdf(surface.clone()), wo, &grid);
            }
        }
    }
}

#[test]
fn draws_follow_the_density() {
    let mut numbers = Numbers::new(7);
    let test_count = (scattering().len() * views().count()) as f64;
    for_all(|case, bsdf, wo, grid| {
        let sample = || bsdf.sample(wo, numbers.next3()).map(|sample| sample.wi);
        let p = p_value(grid, 50_000, sample, |wi| f64::from(bsdf.pdf(wo, wi)));
        // Draws that fail are counted against what the density lacks of 1.
        // Šidák: one false alarm in a hundred runs of the whole table.
        assert!(p > 0.01 / test_count, "{case}: p = {p}");
    });
}

#[test]
fn no_surface_gives_more_than_it_gets_and_no_density_exceeds_one() {
    for_all(|case, bsdf, wo, grid| {
        let pdf: f64 = grid.integrals(|wi| f64::from(bsdf.pdf(wo, wi))).iter().sum();
        assert!(pdf < 1.003, "{case}: the density integrates to {pdf}");
        let albedo: f64 = grid.integrals(|wi| f64::from(bsdf.eval(wo, wi).x)).iter().sum();
        assert!(albedo < 1.003, "{case}: {albedo}");
    });
}

#[test]
fn straight_on_and_mirror_share_by_opacity() {
    let mirror = material(Surface::Mirror { reflectance: [0.9, 0.6, 0.3] }, 0.25);
    let bsdf = Bsdf::new(&mirror, &[], [0.0; 2], normal(), normal());
    let wo = Frame::new(normal()).to_world(Vec3::new(0.6, 0.0, 0.8));
    let (mut straight, mut mirrored) = (Vec3::ZERO, Vec3::ZERO);
    for step in 0_u16..1000 {
        let sample = bsdf.sample_specular(wo, (f32::from(step) + 0.5) / 1000.0);
        let sample = sample.expect("both parts are there");
        let sum = if sample.wi == -wo { &mut straight } else { &mut mirrored };
        *sum += sample.weight / 1000.0;
    }
    assert!((straight - Vec3::splat(0.75)).length() < 2e-3, "{straight}");
    assert!((mirrored - Vec3::new(0.225, 0.15, 0.075)).length() < 2e-3, "{mirrored}");
    assert!(!bsdf.has_scattering() && bsdf.has_specular());
}

#[test]
fn opacity_scales_what_scatters() {
    for surface in [plain(0.7, 0.3, 0.2), plain(0.5, 0.0, 1.0), pbr(0.8, 0.4, 0.3)] {
        let make = |opacity| {
            Bsdf::new(&material(surface.clone(), opacity), &[], [0.0; 2], normal(), normal())
        };
        let wo = views().nth(2).expect("there are three");
        let wi = views().nth(1).expect("there are two");
        let (full, half) = (make(1.0), make(0.5));
        assert!((full.eval(wo, wi) * 0.5 - half.eval(wo, wi)).length() < 1e-6);
        assert!((full.pdf(wo, wi) - half.pdf(wo, wi)).abs() < 1e-6);
        let through = half.sample_specular(wo, 0.99).expect("half goes through");
        assert_eq!((through.wi, through.weight), (-wo, Vec3::splat(0.5)));
        assert!(full.sample_specular(wo, 0.5).is_none() && !full.has_specular());
        let gone = make(0.0);
        assert!(!gone.has_scattering() && gone.eval(wo, wi) == Vec3::ZERO);
        let through = gone.sample_specular(wo, 0.3).expect("all goes through");
        assert_eq!(through.weight, Vec3::ONE);
    }
}

#[test]
fn diffuse_weights_are_the_albedo_to_the_bit() {
    let mut numbers = Numbers::new(9);
    let bsdf = bsdf(plain(0.7, 0.0, 1.0));
    for wo in views() {
        let sample = bsdf.sample(wo, numbers.next3()).expect("diffuse draws succeed");
        assert_eq!(sample.weight, Vec3::splat(0.7));
    }
}

#[test]
fn gloss_without_roughness_is_nearly_a_mirror() {
    let mut numbers = Numbers::new(10);
    let bsdf = bsdf(plain(0.0, 0.8, 0.0));
    for wo in views() {
        let sample = bsdf.sample(wo, numbers.next3()).expect("the lobe is above the surface");
        assert!((sample.weight - Vec3::splat(0.8)).length() < 1e-3, "{}", sample.weight);
        let mirrored = normal() * (2.0 * wo.dot(normal())) - wo;
        assert!((sample.wi - mirrored).length() < 0.05, "{} is not {mirrored}", sample.wi);
    }
}

#[test]
fn what_emits_reflects_nothing() {
    let lamp = Material { emission: [0.0, 0.0, 1.0], ..material(plain(0.7, 0.2, 0.1), 1.0) };
    let bsdf = Bsdf::new(&lamp, &[], [0.0; 2], normal(), normal());
    let wo = views().nth(1).expect("there are two");
    assert!(!bsdf.has_scattering() && !bsdf.has_specular());
    assert!(bsdf.sample(wo, [0.5; 3]).is_none() && bsdf.sample_specular(wo, 0.5).is_none());
    assert_eq!((bsdf.eval(wo, wo), bsdf.albedo()), (Vec3::ZERO, Vec3::ZERO));
}

#[test]
fn textures_multiply_the_diffuse_color() {
    let texels = Texels::Linear(vec![[0.5, 0.25, 1.0], [1.0; 3]]);
    let textures = [Texture { name: "test".into(), width: 2, height: 1, texels }];
    let (diffuse, base) = ([0.8; 3], [0.5; 3]);
    let surfaces = [
        Surface::Plain { diffuse, diffuse_texture: Some(0), specular: [0.0; 3], alpha: 1.0 },
        Surface::Pbr { base, base_texture: Some(0), roughness: 1.0, metallic: 1.0 },
    ];
    for (surface, factor) in surfaces.into_iter().zip([0.8, 0.5]) {
        let make =
            |uv| Bsdf::new(&material(surface.clone(), 1.0), &textures, uv, normal(), normal());
        assert_eq!(make([0.25, 0.5]).albedo(), Vec3::new(0.5, 0.25, 1.0) * factor);
        assert_eq!(make([0.75, 0.5]).albedo(), Vec3::splat(factor));
    }
}

/// Any surface; numbers at the ends of their ranges included.
fn any_surface() -> impl Strategy<Value = Surface> {
    let unit = || prop_oneof![Just(0.0_f32), Just(1.0), 0.0_f32..1.0];
    prop_oneof![
        (unit(), unit(), unit()).prop_map(|(d, s, alpha)| plain(d * (1.0 - s), s, alpha)),
        (unit(), unit(), unit()).prop_map(|(base, rough, metal)| pbr(base, rough, metal)),
        unit().prop_map(|r| Surface::Mirror { reflectance: [r; 3] }),
        (prop_oneof![Just(1.0_f32), Just(0.0), 0.3_f32..3.0], unit())
            .prop_map(|(ior, t)| Surface::Glass { ior, transmittance: [t; 3] }),
    ]
}

/// Any direction: along axes, in the plane of the normal +z, next to it, or off unit length by
/// an ulp.
fn any_direction() -> impl Strategy<Value = Vec3> {
    let number = || prop_oneof![Just(0.0_f32), Just(-0.0), Just(1e-20), Just(-1e-8), -1.0_f32..1.0];
    (number(), number(), number(), -1_i8..=1).prop_map(|(x, y, z, ulps)| {
        let unit = Vec3::new(x, y, z).try_normalize().unwrap_or(Vec3::X);
        unit * (1.0 + f32::from(ulps) * f32::EPSILON)
    })
}

proptest! {
    #[test]
    fn nothing_but_finite_numbers_comes_out(
        surface in any_surface(), wo in any_direction(), wi in any_direction(),
        face in any_direction(), u in prop::array::uniform3(prop_oneof![Just(0.0_f32), 0.0_f32..1.0]),
        opacity in prop_oneof![Just(0.0_f32), Just(1.0), 0.0_f32..1.0],
    ) {
        let bsdf = Bsdf::new(&material(surface, opacity), &[], [0.0; 2], face, Vec3::Z);
        let (value, pdf) = bsdf.evaluate(wo, wi);
        prop_assert!(value.is_finite() && value.min_element() >= 0.0, "value {value}");
        prop_assert!(pdf.is_finite() && pdf >= 0.0, "pdf {pdf}");
        if let Some(sample) = bsdf.sample(wo, u) {
            prop_assert!(sample.pdf.is_finite() && sample.pdf > 0.0);
            prop_assert!(sample.weight.is_finite() && sample.weight.min_element() >= 0.0);
            prop_assert!((sample.wi.length() - 1.0).abs() < 1e-5, "length {}", sample.wi.length());
        }
        if let Some(sample) = bsdf.sample_specular(wo, u[0]) {
            prop_assert!(sample.weight.is_finite() && sample.weight.min_element() >= 0.0);
            prop_assert!((sample.wi.length() - 1.0).abs() < 1e-5);
        }
    }

    #[test]
    fn weight_times_pdf_is_the_value(surface in any_surface(), wo in any_direction(), seed: u64) {
        let bsdf = bsdf(surface);
        if let Some(sample) = bsdf.sample(wo, Numbers::new(seed).next3()) {
            let (value, pdf) = bsdf.evaluate(wo, sample.wi);
            prop_assert_eq!(pdf, sample.pdf);
            let difference = (sample.weight * sample.pdf - value).abs().max_element();
            prop_assert!(difference <= 1e-6 * value.max_element(), "{} {}", sample.weight, value);
        }
    }

    #[test]
    fn light_may_be_turned_around(
        surface in any_surface(), wo in any_direction(), wi in any_direction(),
    ) {
        let bsdf = bsdf(surface);
        let (cos_o, cos_i) = (wo.dot(normal()).abs(), wi.dot(normal()).abs());
        prop_assume!(cos_o > 1e-4 && cos_i > 1e-4);
        let (there, back) = (bsdf.eval(wo, wi) / cos_i, bsdf.eval(wi, wo) / cos_o);
        prop_assert!((there - back).length() <= 1e-4 * there.length(), "{there} {back}");
    }

    #[test]
    fn both_sides_reflect_alike(surface in any_surface(), seed: u64) {
        let above = bsdf(surface.clone());
        let flipped = Bsdf::new(&material(surface, 1.0), &[], [0.0; 2], -normal(), -normal());
        let mut numbers = Numbers::new(seed);
        let mut direction = || Vec3::from(numbers.next3().map(|u| 2.0 * u - 1.0)).normalize();
        let (wo, wi) = (direction(), direction());
        prop_assert_eq!(above.eval(wo, wi), flipped.eval(wo, wi));
        prop_assert_eq!(above.pdf(wo, wi), flipped.pdf(wo, wi));
    }

    #[test]
    fn choosing_lobes_bounds_the_weights(surface in any_surface(), wo in any_direction(), seed: u64) {
        // A balance of lobes by albedo: no weight exceeds the ratio of the sums by much.
        let bsdf = bsdf(surface);
        if let Some(sample) = bsdf.sample(wo, Numbers::new(seed).next3()) {
            prop_assert!(mean(sample.weight) < 3.0, "{}", sample.weight);
        }
    }
}
