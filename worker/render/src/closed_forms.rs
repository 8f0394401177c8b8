//! Images of which the mean is known, against that mean.

use std::f64::consts::PI;

use equilux_common::film::from_fixed;
use equilux_common::job::Settings;
use equilux_common::scene::Surface;
use equilux_common::scene::camera::Camera;
use glam::Vec3;

use crate::geometry::tests::meshes::icosphere;
use crate::reference;
use crate::renderer::Renderer;
use crate::scene_builder::{SceneBuilder, always, camera, plain, settings};

/// The mean radiance of an image.
fn mean(renderer: &Renderer) -> f64 {
    let film = reference::render(renderer);
    assert_eq!((film.saturated, film.invalid), (0, 0));
    let sum: f64 = film.pixels.iter().map(|p| from_fixed(p.even[1] + p.odd[1])).sum();
    let samples: i64 = film.pixels.iter().map(|p| p.even_samples + p.odd_samples).sum();
    sum / samples as f64
}

/// Means over seeds, and the standard error of their mean.
fn mean_over_seeds(make: impl Fn(u64) -> Renderer) -> (f64, f64) {
    let means: Vec<f64> = (0..12).map(|seed| mean(&make(seed))).collect();
    let count = means.len() as f64;
    let average = means.iter().sum::<f64>() / count;
    let variance = means.iter().map(|m| (m - average).powi(2)).sum::<f64>() / (count - 1.0);
    (average, (variance / count).sqrt())
}

fn assert_agree(what: &str, (a, error_a): (f64, f64), (b, error_b): (f64, f64)) {
    let error = (error_a * error_a + error_b * error_b).sqrt();
    assert!((a - b).abs() < 4.0 * error + 1e-6 * b.abs(), "{what}: {a} against {b} ± {error}");
}

/// A convex body of albedo a in uniform light of radiance 1 has radiance a, in whatever way light
/// is looked for.
#[test]
fn a_convex_body_in_a_furnace_has_the_radiance_of_its_albedo() {
    for albedo in [0.0f32, 0.2, 0.5, 0.8, 1.0] {
        for (n, m) in [(1, 1), (0, 1), (1, 0), (4, 2)] {
            let mut scene = SceneBuilder::new();
            scene.environment(1.0);
            let material = scene.diffuse(albedo);
            scene.mesh(&icosphere(2, 1.0, Vec3::ZERO), |_| material);
            let settings = Settings {
                light_samples: always(n),
                indirect_samples: always(m),
                ..settings(8, 64, 3)
            };
            let renderer = scene.renderer(&camera(Vec3::Z * 5.0, Vec3::ZERO, 10.0), &settings);
            let (found, expected) = (mean(&renderer), f64::from(albedo));
            assert!((found - expected).abs() <= 0.01 * expected, "{albedo} {n} {m}: {found}");
        }
    }
}

/// In a hollow of albedo 1 every path ends in the light outside, which thus seems to be everywhere.
#[test]
fn a_white_hollow_in_a_furnace_is_invisible() {
    let mut scene = SceneBuilder::new();
    scene.environment(1.0);
    let white = scene.diffuse(1.0);
    scene.mesh(&icosphere(2, 1.0, Vec3::ZERO), |_| white);
    scene.quad(Vec3::new(-4.0, -1.0, -4.0), Vec3::Z * 8.0, Vec3::X * 8.0, white);
    scene.quad(Vec3::new(-4.0, -1.0, -2.0), Vec3::X * 8.0, Vec3::Y * 4.0, white);
    let renderer = scene.renderer(&camera(Vec3::Z * 6.0, Vec3::ZERO, 40.0), &settings(16, 16, 200));
    let found = mean(&renderer);
    assert!((found - 1.0).abs() < 0.01, "{found}");
}

/// Inside a sphere of albedo a, of which the fraction f shines with radiance L instead, every point
/// of the wall sees the light under the form factor f. With paths of at most d segments, its
/// radiance is L·f·a·Σ (a·(1−f))^i, with d − 1 terms from i = 0.
#[test]
fn light_in_an_integrating_sphere_is_a_geometric_series() {
    for albedo in [0.1f32, 0.5, 0.9] {
        for max_depth in [1u32, 2, 3, 5, 12] {
            let (renderer, fraction) = integrating_sphere(albedo, max_depth);
            let a = f64::from(albedo);
            let terms = i32::try_from(max_depth).expect("small") - 1;
            let sum: f64 = (0..terms).map(|i| (a * (1.0 - fraction)).powi(i)).sum();
            let expected = 10.0 * fraction * a * sum;
            let found = mean(&renderer);
            let tolerance = 0.012 * expected;
            assert!(
                (found - expected).abs() <= tolerance,
                "{albedo} {max_depth}: {found} {expected}"
            );
        }
    }
}

/// The camera is at the middle and looks at the wall; the light is a cap above it.
fn integrating_sphere(albedo: f32, max_depth: u32) -> (Renderer, f64) {
    let mut sphere = icosphere(4, 1.0, Vec3::ZERO);
    for triangle in &mut sphere.triangles {
        triangle.positions.swap(1, 2);
    }
    let is_lit = |corners: &[Vec3; 3]| (corners[0] + corners[1] + corners[2]).y > 3.0 * 0.8;
    let area = |corners: &[Vec3; 3]| {
        f64::from((corners[1] - corners[0]).cross(corners[2] - corners[0]).length())
    };
    let all: Vec<[Vec3; 3]> = sphere
        .triangles
        .iter()
        .map(|t| t.positions.map(|index| Vec3::from(sphere.positions[index as usize])))
        .collect();
    let lit: f64 = all.iter().filter(|corners| is_lit(corners)).map(area).sum();
    let fraction = lit / all.iter().map(area).sum::<f64>();
    let mut scene = SceneBuilder::new();
    let (wall, light) = (scene.diffuse(albedo), scene.light(10.0));
    scene.mesh(&sphere, |corners| if is_lit(corners) { light } else { wall });
    let camera = camera(Vec3::ZERO, Vec3::new(0.3, -0.5, -1.0), 40.0);
    (scene.renderer(&camera, &settings(16, 16, max_depth)), fraction)
}

/// The form factor of a rectangle of sides a and b from a point at distance c below its corner,
/// parallel to it (Howell, *A Catalog of Radiation Heat Transfer Configuration Factors*, B-4).
fn form_factor(a: f64, b: f64, c: f64) -> f64 {
    let (x, y) = (a / c, b / c);
    let part = |x: f64, y: f64| x / (1.0 + x * x).sqrt() * (y / (1.0 + x * x).sqrt()).atan();
    (part(x, y) + part(y, x)) / (2.0 * PI)
}

/// A rectangle of radiance 2 at height 1 over a floor of albedo 0.7, seen at the floor's origin.
fn under_rectangle(settings: &Settings, scale: f32) -> Renderer {
    let mut scene = SceneBuilder::new();
    let (floor, light) = (scene.diffuse(0.7), scene.light(2.0));
    scene.quad(Vec3::new(-9.0, 0.0, -9.0), Vec3::Z * 18.0, Vec3::X * 18.0, floor);
    scene.quad(Vec3::new(-0.5, 1.0, -1.0), Vec3::X * 2.0, Vec3::Z * 1.5, light);
    scene.scale(scale);
    scene.renderer(&camera(Vec3::new(-3.0, 1.0, 0.0) * scale, Vec3::ZERO, 0.05), settings)
}

#[test]
fn light_under_a_rectangle_follows_its_form_factor() {
    // The point lies below the inside of the rectangle, which the axes cut into four.
    let factor = form_factor(0.5, 1.0, 1.0)
        + form_factor(1.5, 1.0, 1.0)
        + form_factor(0.5, 0.5, 1.0)
        + form_factor(1.5, 0.5, 1.0);
    let expected = 0.7 * 2.0 * factor;
    for (n, m) in [(1, 1), (4, 1), (16, 1), (1, 4), (0, 4), (4, 0)] {
        for scale in [1e-3f32, 1.0, 1e5] {
            let found = mean_over_seeds(|seed| {
                let settings = Settings {
                    light_samples: always(n),
                    indirect_samples: always(m),
                    seed,
                    ..settings(4, 64, 2)
                };
                under_rectangle(&settings, scale)
            });
            // The camera's field of view is not quite a point.
            assert_agree(&format!("{n} {m} {scale}"), found, (expected, expected * 1e-4));
        }
    }
}

#[test]
fn a_light_in_a_mirror_has_its_radiance_times_the_reflectance() {
    let mut scene = SceneBuilder::new();
    let mirror = scene.surface(Surface::Mirror { reflectance: [0.6; 3] }, 1.0);
    let light = scene.light(3.0);
    // A mirror in the plane z = 0; the light is behind the camera and 1 to the right of the axis.
    scene.quad(Vec3::new(-5.0, -5.0, 0.0), Vec3::X * 10.0, Vec3::Y * 10.0, mirror);
    scene.quad(Vec3::new(1.0, -3.0, 4.0), Vec3::Y * 6.0, Vec3::X * 3.0, light);
    // 90 degrees: at the mirror image's distance of 2 + 4, the view is 12 wide.
    let renderer = scene.renderer(&camera(Vec3::Z * 2.0, Vec3::ZERO, 90.0), &settings(12, 4, 3));
    let film = reference::render(&renderer);
    for (index, pixel) in film.pixels.iter().enumerate() {
        let (x, y) = (index % 12, index / 12);
        let is_lit = (7..10).contains(&x) && (3..9).contains(&y);
        let radiance = from_fixed(pixel.even[0] + pixel.odd[0]) / 4.0;
        let expected = if is_lit { 0.6 * 3.0 } else { 0.0 };
        assert!((radiance - expected).abs() < 1e-5, "{x} {y}: {radiance}");
    }
}

/// A room with a glossy floor, a lamp and a block.
fn room(settings: &Settings, scale: f32) -> Renderer {
    let mut scene = SceneBuilder::new();
    let (wall, light) = (scene.diffuse(0.6), scene.light(5.0));
    let floor = scene.surface(plain(0.3, 0.4, 0.15), 1.0);
    let (x, y, z) = (Vec3::X * 2.0, Vec3::Y * 2.0, Vec3::Z * 2.0);
    scene.quad(Vec3::new(-1.0, -1.0, -1.0), z, x, floor);
    scene.quad(Vec3::new(-1.0, 1.0, -1.0), x, z, wall);
    scene.quad(Vec3::new(-1.0, -1.0, -1.0), x, y, wall);
    scene.quad(Vec3::new(-1.0, -1.0, -1.0), y, z, wall);
    scene.quad(Vec3::new(1.0, -1.0, -1.0), z, y, wall);
    scene.quad(Vec3::new(-0.3, 0.9, -0.4), Vec3::X * 0.5, Vec3::Z * 0.5, light);
    scene.mesh(&icosphere(1, 0.4, Vec3::new(0.3, -0.5, -0.2)), |_| wall);
    scene.scale(scale);
    scene.renderer(&camera(Vec3::Z * 3.5 * scale, Vec3::ZERO, 40.0), settings)
}

#[test]
fn numbers_of_samples_and_roulette_do_not_change_the_mean() {
    let find = |n, m, roulette_depth| {
        mean_over_seeds(|seed| {
            let settings = Settings {
                light_samples: always(n),
                indirect_samples: always(m),
                roulette_depth,
                seed,
                ..settings(12, 8, 4)
            };
            room(&settings, 1.0)
        })
    };
    let expected = find(1, 1, None);
    assert!(expected.1 < 0.01 * expected.0, "{expected:?}");
    for (n, m, roulette_depth) in
        [(4, 1, None), (16, 1, None), (1, 4, None), (0, 4, None), (1, 1, Some(1)), (4, 4, Some(2))]
    {
        assert_agree(&format!("{n} {m} {roulette_depth:?}"), find(n, m, roulette_depth), expected);
    }
}

#[test]
fn the_scale_of_a_scene_does_not_change_its_image() {
    let find =
        |scale| mean_over_seeds(|seed| room(&Settings { seed, ..settings(12, 8, 4) }, scale));
    let expected = find(1.0);
    for scale in [1e-3, 1e5] {
        let found = find(scale);
        assert_agree(&format!("{scale}"), found, expected);
        // The same random numbers: nearly the same paths.
        assert!((found.0 - expected.0).abs() < 1e-2 * expected.0, "{found:?} {expected:?}");
    }
}

#[test]
fn what_lies_behind_half_opaque_panes_shines_through() {
    let (n, opacity) = (3, 0.4f32);
    let mut scene = SceneBuilder::new();
    scene.environment(1.0);
    let pane = scene.surface(plain(0.0, 0.0, 1.0), opacity);
    for number in 0..n {
        let corner = Vec3::new(-50.0, -50.0, -number as f32);
        scene.quad(corner, Vec3::X * 100.0, Vec3::Y * 100.0, pane);
    }
    let view: Camera = camera(Vec3::Z * 2.0, Vec3::ZERO, 30.0);
    let found = mean(&scene.renderer(&view, &settings(4, 16, 6)));
    assert!((found - f64::from(1.0 - opacity).powi(n)).abs() < 1e-5, "{found}");
}
