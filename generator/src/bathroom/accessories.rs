//! What makes a bathroom one's own: towels, bottles, plants, a stool, a duckboard.

use super::palette::*;
use super::{Bay, WIDTH, basin};
use crate::frame::Frame;
use crate::random::Random;
use crate::shape::Shape;
use crate::stage::Stage;
use crate::vector::vector;

/// Strews the things of a bay about.
pub(super) fn things(stage: &mut Stage, bay: &Bay) {
    let mut random = Random::new(0xACCE, bay.index);
    on_the_vanity(stage, &bay.corner.shifted(0.0, basin::TOP, 0.0), &mut random);
    ladder(stage, &bay.corner.shifted(3.22, 0.001, 0.3));
    duckboard(stage, &bay.corner.shifted(1.75, 0.001, 1.05));
    stool(stage, &bay.corner.shifted(3.12, 0.001, 1.5));
    far_shelf(stage, &bay.corner.shifted(1.65, 0.86, WIDTH - 0.005).turned(180.0), &mut random);
    hooks(stage, &bay.corner.shifted(4.25, 1.7, WIDTH - 0.005).turned(180.0));
}

fn on_the_vanity(stage: &mut Stage, at: &Frame, random: &mut Random) {
    for (number, x) in [0.5, 0.6, 0.69].into_iter().enumerate() {
        bottle(stage, &at.shifted(x, 0.0, 0.14 + 0.03 * (number % 2) as f64), number, random);
    }
    soap_dispenser(stage, &at.shifted(1.36, 0.0, 0.2));
    tumbler(stage, &at.shifted(1.94, 0.0, 0.17));
    pearls(stage, &at.shifted(1.65, 0.0, 0.26), random);
    plant(stage, &at.shifted(1.65, 0.0, 0.11), random);
    folded(stage, &at.shifted(2.74, 0.0, 0.2), 4);
}

/// A bottle with cap and label; `number` chooses its kind.
fn bottle(stage: &mut Stage, at: &Frame, number: usize, random: &mut Random) {
    let (radius, height) = (random.between(0.025, 0.034), random.between(0.13, 0.19));
    let neck = radius * 0.42;
    let profile = [
        (0.0, 0.0),
        (radius, 0.0),
        (radius, height * 0.7),
        (radius * 0.85, height * 0.78),
        (neck, height * 0.86),
        (neck, height),
        (0.0, height),
    ];
    stage.put("bottle", &BOTTLES[number % BOTTLES.len()], at, Shape::lathe(&profile, 24));
    let cap = Shape::cylinder(neck * 1.25, 0.024, 18);
    stage.put("bottle_cap", &BLACK, &at.shifted(0.0, height + 0.001, 0.0), cap);
    let label =
        Shape::lathe(&[(radius + 0.0012, height * 0.15), (radius + 0.0012, height * 0.55)], 24);
    stage.put("bottle_label", &LABEL, at, label);
}

fn soap_dispenser(stage: &mut Stage, at: &Frame) {
    let body = [(0.0, 0.0), (0.036, 0.0), (0.036, 0.12), (0.012, 0.135), (0.0, 0.135)];
    stage.put("dispenser", &PORCELAIN, at, Shape::lathe(&body, 24));
    let pump = [
        vector(0.0, 0.136, 0.0),
        vector(0.0, 0.175, 0.0),
        vector(0.0, 0.185, 0.012),
        vector(0.0, 0.18, 0.055),
    ];
    stage.put("dispenser_pump", &CHROME, at, Shape::pipe(&pump, 0.006, 10));
}

fn tumbler(stage: &mut Stage, at: &Frame) {
    let wall = [(0.0, 0.0), (0.034, 0.0), (0.038, 0.1), (0.035, 0.1), (0.031, 0.006), (0.0, 0.006)];
    stage.put("tumbler", &METRO_TILES[3], at, Shape::lathe(&wall, 24));
    for brush in 0..3 {
        let lean =
            at.turned(120.0 * f64::from(brush) + 20.0).shifted(0.0, 0.01, -0.006).tilted(11.0);
        stage.put("toothbrush", &PEARLS[brush as usize], &lean, Shape::cylinder(0.0045, 0.17, 8));
        let head = Shape::cuboid(0.01, 0.028, 0.012);
        stage.put("bristles", &TOWELS[1], &lean.shifted(0.0, 0.145, 0.011), head);
    }
}

/// Bath pearls in a bowl, heaped in rings.
fn pearls(stage: &mut Stage, at: &Frame, random: &mut Random) {
    let bowl =
        [(0.0, 0.0), (0.05, 0.0), (0.085, 0.035), (0.08, 0.035), (0.048, 0.006), (0.0, 0.006)];
    stage.put("bowl", &PORCELAIN, at, Shape::lathe(&bowl, 28));
    for (ring, (count, out, y)) in
        [(16, 0.062, 0.033), (11, 0.042, 0.04), (6, 0.022, 0.046), (1, 0.0, 0.052)]
            .into_iter()
            .enumerate()
    {
        for pearl in 0..count {
            let turn = 360.0 * f64::from(pearl) / f64::from(count) + 13.0 * ring as f64;
            let place = at.turned(turn).shifted(out, y, 0.0);
            stage.put("pearl", random.pick(&PEARLS), &place, Shape::sphere(0.01, 8, 6));
        }
    }
}

fn plant(stage: &mut Stage, at: &Frame, random: &mut Random) {
    let pot = [(0.0, 0.0), (0.045, 0.0), (0.06, 0.1), (0.054, 0.1), (0.05, 0.085), (0.0, 0.085)];
    stage.put("plant_pot", &TERRACOTTA, at, Shape::lathe(&pot, 24));
    stage.put(
        "soil",
        &SOIL,
        &at.shifted(0.0, 0.09, 0.0),
        Shape::lathe(&[(0.05, 0.0), (0.0, 0.004)], 14),
    );
    for leaf in 0..20 {
        let place = at
            .shifted(0.0, 0.095 + 0.003 * f64::from(leaf), 0.0)
            .turned(137.5 * f64::from(leaf))
            .tilted(-18.0 - 2.6 * f64::from(leaf) + random.between(-8.0, 8.0));
        let size = random.between(0.09, 0.13);
        stage.put("leaf", random.pick(&LEAVES), &place, Shape::leaf(size, size * 0.4, size * 0.3));
    }
}

/// A pile of folded towels.
fn folded(stage: &mut Stage, at: &Frame, count: usize) {
    for towel in 0..count {
        let (height, depth) = (0.042, 0.2);
        let round = [
            (depth / 2.0, 0.004),
            (depth / 2.0 + 0.012, 0.012),
            (depth / 2.0 + 0.012, height - 0.012),
            (depth / 2.0, height - 0.003),
            (-depth / 2.0, height - 0.003),
            (-depth / 2.0, 0.004),
        ];
        let place = at.shifted(0.0, (height + 0.001) * towel as f64, 0.0);
        stage.put("folded_towel", &TOWELS[towel % 4], &place, roll_of(&round, 0.3));
    }
}

/// A closed shape over an outline in z and y, drawn out along x.
fn roll_of(outline: &[(f64, f64)], width: f64) -> Shape {
    // A prism stands along y; lay it down so that its height runs along −x.
    let standing: Vec<(f64, f64)> = outline.iter().rev().map(|&(z, y)| (y, z)).collect();
    let lying = Frame::at(width / 2.0, 0.0, 0.0).rolled(90.0);
    Shape::prism(&standing, width).placed(&lying)
}

/// A ladder that leans on the wall, with towels over its rungs.
fn ladder(stage: &mut Stage, at: &Frame) {
    let lean = at.tilted(-7.5);
    for side in [-1.0, 1.0] {
        stage.put(
            "ladder_rail",
            &TEAK,
            &lean.shifted(side * 0.23, 0.004, 0.0),
            Shape::cuboid(0.035, 1.85, 0.028),
        );
    }
    for rung in 0..5 {
        let y = 0.3 + 0.34 * f64::from(rung);
        let bar = Shape::bar(vector(-0.211, y, 0.0), vector(0.211, y, 0.0), 0.014, 12);
        stage.put("ladder_rung", &TEAK, &lean, bar);
    }
    for (rung, drop, hue) in [(1, 0.3, 3), (2, 0.26, 0), (3, 0.3, 1), (4, 0.24, 2)] {
        let y = 0.3 + 0.34 * f64::from(rung);
        stage.put("towel", &TOWELS[hue], &at.shifted(0.0, 0.0, -0.1315 * y), hung(y, drop));
    }
}

/// A towel over a rung at height `y`, both ends hanging.
fn hung(y: f64, drop: f64) -> Shape {
    let line = [
        (0.03, y - drop),
        (0.036, y - drop * 0.5),
        (0.024, y - 0.02),
        (0.013, y + 0.012),
        (0.0, y + 0.017),
        (-0.013, y + 0.012),
        (-0.018, y - 0.02),
        (-0.016, y - drop * 0.75),
    ];
    Shape::strip(&line, 0.37)
}

/// Slats of teak before the vanity.
fn duckboard(stage: &mut Stage, at: &Frame) {
    for x in [-0.4, 0.4] {
        stage.put(
            "duckboard_bearer",
            &TEAK,
            &at.shifted(x, 0.0, 0.0),
            Shape::cuboid(0.05, 0.014, 0.5),
        );
    }
    for slat in 0..11 {
        let z = 0.048 * (f64::from(slat) - 5.0);
        stage.put(
            "duckboard_slat",
            &TEAK,
            &at.shifted(0.0, 0.015, z),
            Shape::cuboid(1.1, 0.016, 0.036),
        );
    }
}

/// A stool with rolled towels.
fn stool(stage: &mut Stage, at: &Frame) {
    let seat =
        [(0.0, 0.0), (0.15, 0.0), (0.165, 0.012), (0.165, 0.026), (0.155, 0.034), (0.0, 0.034)];
    stage.put("stool_seat", &OAK, &at.shifted(0.0, 0.412, 0.0), Shape::lathe(&seat, 36));
    for leg in 0..3 {
        let turned = at.turned(120.0 * f64::from(leg) + 15.0);
        let bar = Shape::bar(vector(0.0, 0.0, 0.17), vector(0.0, 0.4105, 0.105), 0.015, 12);
        stage.put("stool_leg", &OAK, &turned, bar);
    }
    for (number, (z, y)) in [(-0.056, 0.503), (0.056, 0.503), (0.0, 0.6)].into_iter().enumerate() {
        let roll = Shape::bar(vector(-0.14, y, z), vector(0.14, y, z), 0.0545, 24);
        stage.put("rolled_towel", &TOWELS[[1, 0, 1][number]], at, roll);
    }
}

/// A shelf under the far mirror, with bottles and towels; `at` is on the wall.
fn far_shelf(stage: &mut Stage, at: &Frame, random: &mut Random) {
    stage.put("far_shelf", &OAK, &at.shifted(0.0, 0.0, 0.11), Shape::cuboid(2.5, 0.03, 0.2));
    for x in [-1.1, 0.0, 1.1] {
        let bracket = Shape::cuboid(0.03, 0.1, 0.16);
        stage.put("bracket", &BRASS, &at.shifted(x, -0.101, 0.09), bracket);
    }
    let on_top = at.shifted(0.0, 0.031, 0.11);
    for number in 0..7 {
        let x = -0.9 + 0.085 * number as f64;
        bottle(stage, &on_top.shifted(x, 0.0, 0.02 * (number % 3) as f64 - 0.02), number, random);
    }
    folded(stage, &on_top.shifted(0.85, 0.0, -0.0), 3);
    plant(stage, &on_top.shifted(0.25, 0.0, 0.0), random);
    for candle in 0..3 {
        let shape = Shape::cylinder(0.03, 0.06 + 0.025 * f64::from(candle), 20);
        stage.put(
            "candle",
            &WAX,
            &on_top.shifted(0.42 + 0.075 * f64::from(candle), 0.0, 0.02),
            shape,
        );
    }
}

/// Two hooks with a bathrobe's worth of towel.
fn hooks(stage: &mut Stage, at: &Frame) {
    for x in [-0.15, 0.15] {
        let path = [vector(x, 0.0, 0.0), vector(x, -0.01, 0.05), vector(x, 0.03, 0.07)];
        stage.put("hook", &CHROME, at, Shape::pipe(&path, 0.008, 10));
    }
    let line =
        [(0.06, -0.9), (0.075, -0.45), (0.05, 0.0), (0.03, 0.01), (0.016, -0.3), (0.02, -0.7)];
    stage.put("towel", &TOWELS[2], &at.shifted(0.0, 0.04, 0.0), Shape::strip(&line, 0.4));
}
