//! That lights are found as often as they claim, from wherever one looks, and send what they must.

use std::f64::consts::PI;

use equilux_common::scene::{
    Environment, Geometry, Material, NO_INDEX, Scene, Surface, Tables, Texels, Texture, Triangle,
};
use glam::Vec3;
use proptest::prelude::*;

use super::Lights;
use crate::chi_square::{Numbers, SphereGrid, pearson};
use crate::geometry::Bounds;
use crate::warp;

/// A scene of triangles with the radiance of each; black ones are no lights.
fn scene(triangles: &[([Vec3; 3], [f32; 3])], environment: Environment) -> Scene {
    let plain = Surface::Mirror { reflectance: [0.5; 3] };
    let material =
        |emission| Material { name: "test".into(), emission, surface: plain.clone(), opacity: 1.0 };
    let corners = triangles.iter().flat_map(|(corners, _)| corners.map(|corner| corner.to_array()));
    let geometry = Geometry {
        positions: corners.collect(),
        triangles: (0..u32::try_from(triangles.len()).expect("few"))
            .map(|index| Triangle {
                positions: [3 * index, 3 * index + 1, 3 * index + 2],
                normals: [NO_INDEX; 3],
                texcoords: [NO_INDEX; 3],
                material: index,
            })
            .collect(),
        ..Geometry::default()
    };
    let materials = triangles.iter().map(|&(_, emission)| material(emission)).collect();
    let tables = Tables { materials, environment, ..Tables::default() };
    Scene { geometry, tables, ..Scene::default() }
}

fn with_textures(textures: Vec<Texture>, scene: Scene) -> Scene {
    Scene { tables: Tables { textures, ..scene.tables }, ..scene }
}

/// Four triangles above the origin that face down, the second of them black, of unequal power.
fn lamps() -> Vec<([Vec3; 3], [f32; 3])> {
    let down = |x: f32, z: f32, size: f32| {
        [Vec3::new(x, 0.0, z), Vec3::new(x, size, z), Vec3::new(x + size, 0.2, z)]
    };
    vec![
        (down(-2.0, 1.0, 1.0), [1.0, 2.0, 3.0]),
        (down(-1.0, 1.5, 1.0), [0.0; 3]),
        (down(0.0, 0.5, 0.6), [9.0, 0.0, 0.0]),
        (down(0.5, 2.0, 3.0), [0.2; 3]),
    ]
}

fn lights(scene: &Scene) -> Lights {
    let bounds = Bounds { lower: Vec3::splat(-2.0), upper: Vec3::splat(2.0) };
    Lights::new(&scene.tables, &scene.luminaires(), &bounds)
}

/// Where a ray from the origin meets a triangle: its distance.
fn intersect(corners: &[Vec3; 3], direction: Vec3) -> Option<f32> {
    let [a, b, c] = corners.map(|corner| corner.as_dvec3());
    let (d, e1, e2) = (direction.as_dvec3(), b - a, c - a);
    let p = d.cross(e2);
    let det = e1.dot(p);
    let (u, q) = (-a.dot(p) / det, (-a).cross(e1));
    let (v, t) = (d.dot(q) / det, e2.dot(q) / det);
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some(t as f32)
}

#[test]
fn lights_are_chosen_by_power() {
    let scene = scene(&lamps(), Environment::Constant { radiance: [0.01, 0.02, 0.03] });
    let lights = lights(&scene);
    let luminance = |[r, g, b]: [f64; 3]| 0.2126 * r + 0.7152 * g + 0.0722 * b;
    let area = |size: f64, width: f64| 0.5 * size * width;
    let powers = [
        PI * luminance([1.0, 2.0, 3.0]) * area(1.0, 1.0),
        0.0,
        PI * luminance([9.0, 0.0, 0.0]) * area(0.6, 0.6),
        PI * luminance([0.2; 3]) * area(3.0, 3.0),
        4.0 * PI * PI * 12.0 * luminance([0.01, 0.02, 0.03]),
    ];
    let (total, count) = (powers.iter().sum::<f64>(), 100_000);
    let mut counts = [0.0; 5];
    let mut numbers = Numbers::new(3);
    for _ in 0..count {
        let sample = lights.sample(Vec3::ZERO, numbers.next3()).expect("all shine here");
        counts[sample.surface.map_or(4, |surface| surface.primitive as usize)] += 1.0;
    }
    let cells = counts.into_iter().zip(powers.map(|power| power / total * f64::from(count)));
    assert!(pearson(cells.collect()) > 0.01);
}

#[test]
fn a_hit_has_the_density_and_radiance_of_the_sample() {
    let lamps = lamps();
    let scene = scene(&lamps, Environment::Black);
    let lights = lights(&scene);
    let mut numbers = Numbers::new(4);
    for _ in 0..10_000 {
        let from = Vec3::from(numbers.next3()) * Vec3::new(4.0, 4.0, 0.4) - Vec3::splat(2.0);
        let sample = lights.sample(from, numbers.next3()).expect("all shine here");
        let surface = sample.surface.expect("no environment");
        assert_eq!(lights.pdf_of_hit(surface.primitive, sample.wi, sample.distance), sample.pdf);
        assert_eq!(lights.emission(surface.primitive, sample.wi), sample.radiance);
        assert_eq!(sample.radiance, Vec3::from(lamps[surface.primitive as usize].1));
        assert!((from + sample.wi * sample.distance - surface.point).length() < 2e-6);
        assert_eq!(surface.normal, -Vec3::Z);
        let height = lamps[surface.primitive as usize].0[0].z;
        assert!((surface.point.z - height).abs() <= surface.error.z);
    }
}

#[test]
fn densities_integrate_to_one_over_the_lights() {
    let lamps = lamps();
    let lights = lights(&scene(&lamps, Environment::Constant { radiance: [0.01; 3] }));
    let mut numbers = Numbers::new(5);
    let (mut sum, mut sum2, count) = (0.0, 0.0, 400_000);
    for _ in 0..count {
        let wi = warp::sphere([numbers.next(), numbers.next()]);
        let mut pdf = lights.pdf_of_environment(wi);
        for (primitive, (corners, _)) in lamps.iter().enumerate() {
            if let Some(distance) = intersect(corners, wi) {
                pdf += lights.pdf_of_hit(primitive as u32, wi, distance);
            }
        }
        let value = f64::from(pdf) * 4.0 * PI;
        sum += value;
        sum2 += value * value;
    }
    let mean = sum / f64::from(count);
    let deviation = ((sum2 / f64::from(count) - mean * mean) / f64::from(count)).sqrt();
    assert!((mean - 1.0).abs() < 4.0 * deviation && deviation < 0.01, "{mean} ± {deviation}");
}

#[test]
fn irradiance_under_a_triangle_is_lamberts() {
    // Lambert's formula: the sum over the edges of angle × tilt, over 2.
    let (corners, emission) = lamps().swap_remove(0);
    let lights = lights(&scene(&[(corners, emission)], Environment::Black));
    let mut exact = 0.0;
    for edge in 0..3 {
        let a = corners[edge].as_dvec3().normalize();
        let b = corners[(edge + 1) % 3].as_dvec3().normalize();
        let angle = libm::acos(a.dot(b));
        exact -= 0.5 * angle * a.cross(b).normalize().z * f64::from(emission[1]);
    }
    let side = 300_u16;
    let place = |step: u16| (f32::from(step) + 0.5) / f32::from(side);
    let mut sum = 0.0;
    for (row, column) in (0..side).flat_map(|row| (0..side).map(move |column| (row, column))) {
        let sample =
            lights.sample(Vec3::ZERO, [0.5, place(column), place(row)]).expect("it shines");
        sum += f64::from(sample.radiance.y * sample.wi.z / sample.pdf);
    }
    let found = sum / (f64::from(side) * f64::from(side));
    assert!((found / exact.abs() - 1.0).abs() < 1e-4, "{found} is not {exact}");
}

#[test]
fn the_back_of_a_light_is_dark() {
    let lights = lights(&scene(&lamps(), Environment::Black));
    assert!(lights.sample(Vec3::new(0.0, 0.0, 5.0), [0.1, 0.3, 0.3]).is_none());
    assert_eq!(lights.emission(0, -Vec3::Z), Vec3::ZERO);
    assert_eq!(lights.pdf_of_hit(0, -Vec3::Z, 1.0), 0.0);
    for no_light in [1, 4, u32::MAX] {
        assert_eq!(lights.emission(no_light, Vec3::Z), Vec3::ZERO);
        assert_eq!(lights.pdf_of_hit(no_light, Vec3::Z, 1.0), 0.0);
    }
}

#[test]
fn no_light_is_no_sample() {
    let flat = [Vec3::ZERO, Vec3::X, Vec3::X * 2.0];
    for triangles in [vec![], vec![(lamps()[1].0, [0.0; 3])], vec![(flat, [1.0; 3])]] {
        let lights = lights(&scene(&triangles, Environment::Black));
        assert!(lights.is_empty() && lights.sample(Vec3::ZERO, [0.5; 3]).is_none());
        assert_eq!(lights.environment(Vec3::Y), Vec3::ZERO);
        assert_eq!(lights.pdf_of_environment(Vec3::Y), 0.0);
    }
}

/// A scene with nothing but an image of 16 × 8 texels around it: dark, a sun, a gradient.
fn sky(rotation: f32) -> Scene {
    let texels = (0..128_u8).map(|index| match (index % 16, index / 16) {
        (5, 2) => [300.0, 200.0, 100.0],
        (_, 0..=3) => [0.1 * f32::from(index % 16); 3],
        _ => [0.0; 3],
    });
    let texels = Texels::Linear(texels.collect());
    let textures = vec![Texture { name: "sky".into(), width: 16, height: 8, texels }];
    let environment = Environment::Image { texture: 0, scale: 2.0, rotation };
    with_textures(textures, scene(&[], environment))
}

#[test]
fn an_even_image_has_the_power_of_an_even_environment() {
    let texels = Texels::Linear(vec![[0.2, 0.4, 0.6]; 64 * 32]);
    let image = Texture { name: "sky".into(), width: 64, height: 32, texels };
    let probability = |environment| {
        let scene = with_textures(vec![image.clone()], scene(&lamps(), environment));
        f64::from(lights(&scene).environment_probability)
    };
    let even = probability(Environment::Constant { radiance: [0.02, 0.04, 0.06] });
    let as_image = probability(Environment::Image { texture: 0, scale: 0.1, rotation: 10.0 });
    assert!((as_image / even - 1.0).abs() < 1e-3, "{as_image} is not {even}");
}

/// The direction whose place on an image of 16 × 8 texels is `column`, `row`.
fn direction_of(column: f64, row: f64, rotation: f64) -> Vec3 {
    let (sin, cos) = libm::sincos(column / 8.0 * PI - PI - rotation.to_radians());
    let (sin_from_top, y) = libm::sincos(row / 8.0 * PI);
    Vec3::new((sin * sin_from_top) as f32, y as f32, (-cos * sin_from_top) as f32)
}

#[test]
fn directions_follow_the_image() {
    let mut numbers = Numbers::new(6);
    let count = 50_000;
    for rotation in [0.0_f32, 90.0] {
        let lights = lights(&sky(rotation));
        let middle = |texel: usize| [(texel % 16) as f64 + 0.5, (texel / 16) as f64 + 0.5];
        let due = |texel: usize| {
            let [column, row] = middle(texel);
            let direction = direction_of(column, row, f64::from(rotation));
            // The density times the sine is constant over a texel.
            let solid_angle = 2.0 * PI * PI / 128.0 * libm::sin(row / 8.0 * PI);
            f64::from(count) * solid_angle * f64::from(lights.pdf_of_environment(direction))
        };
        let mut cells: Vec<(f64, f64)> = (0..128).map(|texel| (0.0, due(texel))).collect();
        for _ in 0..count {
            let wi = lights.sample(Vec3::ZERO, numbers.next3()).expect("it shines").wi;
            let turn = f64::from(libm::atan2f(wi.x, -wi.z)) + f64::from(rotation).to_radians();
            let column = (turn / PI * 8.0 + 8.0).rem_euclid(16.0) as usize;
            let row = (f64::from(libm::acosf(wi.y)) / PI * 8.0) as usize;
            cells[row * 16 + column].0 += 1.0;
        }
        let total: f64 = cells.iter().map(|cell| cell.1).sum();
        assert!((total / f64::from(count) - 1.0).abs() < 1e-5, "density integrates to {total}");
        let p = pearson(cells);
        assert!(p > 0.001, "rotation {rotation}: p = {p}");
    }
}

#[test]
fn samples_of_the_image_carry_its_radiance_and_density() {
    let lights = lights(&sky(30.0));
    let mut numbers = Numbers::new(7);
    let (mut sampled, count) = (0.0, 40_000);
    for _ in 0..count {
        let Some(sample) = lights.sample(Vec3::ZERO, numbers.next3()) else { continue };
        assert_eq!(sample.pdf, lights.pdf_of_environment(sample.wi));
        assert_eq!(sample.radiance, lights.environment(sample.wi));
        assert!(sample.distance == f32::INFINITY && sample.surface.is_none());
        sampled += f64::from(sample.radiance.y / sample.pdf) / f64::from(count);
    }
    let exact: f64 = SphereGrid::new(Vec3::Y, 0.5)
        .integrals(|wi| f64::from(lights.environment(wi).y))
        .iter()
        .sum();
    assert!((sampled / exact - 1.0).abs() < 0.02, "{sampled} is not {exact}");
}

#[test]
fn wherever_there_is_light_there_is_density() {
    let lights = lights(&sky(0.0));
    let mut numbers = Numbers::new(8);
    for _ in 0..20_000 {
        let wi = warp::sphere([numbers.next(), numbers.next()]);
        let (radiance, pdf) = (lights.environment(wi), lights.pdf_of_environment(wi));
        assert!(radiance == Vec3::ZERO || pdf > 0.0, "{wi}: {radiance} is never found");
    }
}

#[test]
fn the_middle_of_the_image_is_toward_minus_z_and_its_right_toward_x() {
    let texels = (0..8_u8).map(|index| [f32::from(index); 3]).collect();
    let image = Texture { name: "sky".into(), width: 4, height: 2, texels: Texels::Linear(texels) };
    let make = |rotation| {
        let environment = Environment::Image { texture: 0, scale: 1.0, rotation };
        lights(&with_textures(vec![image.clone()], scene(&[], environment)))
    };
    let value = |lights: &Lights, wi| lights.environment(wi).x;
    let near = |found: f32, expected: f32| assert!((found - expected).abs() < 1e-5, "{found}");
    // Between columns 1 and 2 of 4, rows 0 and 1 of 2, and so on around.
    let straight = make(0.0);
    near(value(&straight, -Vec3::Z), 3.5);
    near(value(&straight, Vec3::X), 4.5);
    near(value(&straight, Vec3::Z), 3.5);
    near(value(&straight, -Vec3::X), 2.5);
    near(value(&straight, Vec3::new(0.0, 0.9, -0.435_889_9)), 1.5);
    near(value(&straight, Vec3::new(0.0, -0.9, -0.435_889_9)), 5.5);
    // A quarter turn counter-clockwise seen from above takes what was at −z to −x.
    let turned = make(90.0);
    near(value(&turned, -Vec3::X), 3.5);
    near(value(&turned, -Vec3::Z), 4.5);
}

proptest! {
    #[test]
    fn any_point_and_number_give_numbers(
        from in prop::array::uniform3(prop_oneof![Just(0.0_f32), Just(1e30), -3.0_f32..3.0]),
        u in prop::array::uniform3(prop_oneof![Just(0.0_f32), Just(0.999_999_94), 0.0_f32..1.0]),
        rotation in prop_oneof![Just(0.0_f32), -1e6_f32..1e6],
    ) {
        let environment = Environment::Image { texture: 0, scale: 1.0, rotation };
        let scene = with_textures(sky(0.0).tables.textures, scene(&lamps(), environment));
        let lights = lights(&scene);
        if let Some(sample) = lights.sample(Vec3::from(from), u) {
            prop_assert!(sample.pdf > 0.0 && sample.pdf.is_finite());
            prop_assert!(sample.radiance.is_finite());
            prop_assert!((sample.wi.length() - 1.0).abs() < 1e-5);
        }
        for axis in [Vec3::Y, -Vec3::Y, Vec3::Z] {
            prop_assert!(lights.pdf_of_environment(axis).is_finite());
            prop_assert!(lights.environment(axis).is_finite());
        }
    }
}
