//! Whether kernels find the same hits: the own modes must, the yardstick nearly does.

use anyhow::bail;
use equilux_common::ray::{NO_PRIMITIVE, Ray};
use serde::Serialize;

use super::kind::{ByKind, Kind};
use super::timing::{Kernel, Traced, pass};

/// What a ray has hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Found {
    is_hit: bool,
    primitive: u32,
    distance_bits: u32,
}

/// How the hits of a yardstick differ from ours.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(super) struct Difference {
    pub(super) kernel: &'static str,
    /// The kind of rays.
    pub(super) kind: &'static str,
    /// Rays that hit something, but not according to the yardstick.
    pub(super) missed: usize,
    /// Rays that hit nothing, but something according to the yardstick.
    pub(super) extra: usize,
}

/// What the kernels find.
#[derive(Debug)]
pub(super) struct Agreement {
    /// How many rays of each kind hit something.
    pub(super) hits: ByKind<usize>,
    /// Where a yardstick finds others.
    pub(super) differences: Vec<Difference>,
}

impl Agreement {
    /// Compares all kernels with the first one, to which the first `own` must be equal.
    pub(super) fn find(
        kernels: &mut [Box<dyn Kernel + '_>],
        own: usize,
        rays: &ByKind<Vec<Ray>>,
    ) -> anyhow::Result<Self> {
        let (mut hits, mut differences) = (ByKind([0; 5]), Vec::new());
        for (at, (kind, rays)) in rays.iter().enumerate() {
            let expected = found(&mut *kernels[0], kind, rays);
            hits.0[at] = expected.iter().filter(|it| it.is_hit).count();
            for (number, kernel) in kernels.iter_mut().enumerate().skip(1) {
                let name = kernel.name();
                let found = found(&mut **kernel, kind, rays);
                if number < own {
                    check(name, kind, &expected, &found)?;
                } else {
                    differences.extend(difference(name, kind, &expected, &found));
                }
            }
        }
        Ok(Self { hits, differences })
    }
}

/// Makes sure that a mode of the own kernel finds what it must.
fn check(name: &str, kind: Kind, expected: &[Found], found: &[Found]) -> anyhow::Result<()> {
    let Some(ray) = expected.iter().zip(found).position(|(expected, found)| expected != found)
    else {
        return Ok(());
    };
    bail!(
        "the kernel `{name}` is wrong: {} ray {ray} hits {:?}, but should {:?}; please report this",
        kind.name(),
        found[ray],
        expected[ray]
    )
}

fn difference(
    kernel: &'static str,
    kind: Kind,
    expected: &[Found],
    found: &[Found],
) -> Option<Difference> {
    let count = |is_hit: bool| {
        let both = expected.iter().zip(found);
        both.filter(|(ours, theirs)| ours.is_hit == is_hit && theirs.is_hit != is_hit).count()
    };
    let (missed, extra) = (count(true), count(false));
    (missed + extra > 0).then_some(Difference { kernel, kind: kind.name(), missed, extra })
}

fn found(kernel: &mut dyn Kernel, kind: Kind, rays: &[Ray]) -> Vec<Found> {
    let mut all = Vec::with_capacity(rays.len());
    let of_ray = |ray: &Ray| Found {
        is_hit: ray.hit_primitive != NO_PRIMITIVE,
        primitive: ray.hit_primitive,
        distance_bits: ray.distance.to_bits(),
    };
    let of_shadow = |&is_hit: &bool| Found { is_hit, primitive: NO_PRIMITIVE, distance_bits: 0 };
    pass(kernel, kind, rays, |traced, _| match traced {
        Traced::Closest(rays) => all.extend(rays.iter().map(of_ray)),
        Traced::Any(are_hit) => all.extend(are_hit.iter().map(of_shadow)),
    });
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Finds a hit for every ray, or for none.
    struct Fake {
        name: &'static str,
        is_hit: bool,
    }

    impl Kernel for Fake {
        fn name(&self) -> &'static str {
            self.name
        }

        fn closest(&mut self, rays: &mut [Ray]) {
            let hit = if self.is_hit { 0 } else { NO_PRIMITIVE };
            rays.iter_mut().for_each(|ray| ray.hit_primitive = hit);
        }

        fn any(&mut self, _rays: &[Ray], are_hit: &mut [bool]) {
            are_hit.fill(self.is_hit);
        }
    }

    /// Compares a first kernel with a second one that differs from it with every ray.
    fn find(own: usize) -> anyhow::Result<Agreement> {
        let ray = Ray { hit_primitive: NO_PRIMITIVE, ..bytemuck::Zeroable::zeroed() };
        let mut kernels: Vec<Box<dyn Kernel>> = vec![
            Box::new(Fake { name: "a", is_hit: true }),
            Box::new(Fake { name: "b", is_hit: false }),
        ];
        let rays = [3, 0, 0, 2, 0].map(|count| vec![ray; count]);
        Agreement::find(&mut kernels, own, &ByKind(rays))
    }

    #[test]
    fn an_own_mode_that_differs_is_named() {
        let error = find(2).expect_err("they differ").to_string();
        assert!(error.contains("`b`") && error.contains("primary ray 0"), "{error}");
    }

    #[test]
    fn where_a_yardstick_differs_is_counted() {
        let found = find(1).expect("no own mode differs");
        assert_eq!(found.hits.0, [3, 0, 0, 2, 0]);
        let difference = |kind, missed| Difference { kernel: "b", kind, missed, extra: 0 };
        assert_eq!(found.differences, [difference("primary", 3), difference("shadow1", 2)]);
    }
}
