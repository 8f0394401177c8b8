//! Trees that were tampered with: refused, or harmless.

use super::*;

/// What a word of a node may become: a position, a count, a bound, anything.
fn word() -> impl Strategy<Value = u32> {
    prop_oneof![
        0u32..12,
        Just(u32::MAX),
        coordinate().prop_map(f32::to_bits),
        any::<f32>().prop_map(f32::to_bits),
        any::<u32>(),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    #[test]
    fn what_is_not_refused_can_be_walked_through(
        corners in prop::collection::vec(prop::array::uniform3(point()), 1..100),
        changes in prop::collection::vec((any::<prop::sample::Index>(), word()), 1..4),
        lines in prop::collection::vec(ray_line(), 1..8),
    ) {
        let bounds = Bounds::around(corners.iter().flatten().copied());
        let tree = swift(&leaf_triangles(&corners));
        let mut nodes = tree.hierarchy().nodes().to_vec();
        let words: &mut [u32] = bytemuck::cast_slice_mut(&mut nodes);
        for (at, word) in changes {
            words[at.index(words.len())] = word;
        }
        let Ok(tree) = Tree::from_parts(nodes.into(), tree.triangles().clone()) else {
            return Ok(());
        };
        let tree = &tree;
        let starts: Vec<Ray> = lines.into_iter().map(|line| ray(line.0, line.1)).collect();
        for instructions in Instructions::all() {
            let stack = &mut Stack::new(instructions);
            for &start in &starts {
                let probe = &Probe::new(&start, &bounds);
                instructions.run(Ask { tree, probe, start, visits: stack.only() });
            }
            for traversal in TRAVERSALS {
                let (starts, bounds, stack) = (&starts[..], &bounds, &mut *stack);
                instructions.run(AskTogether { traversal, tree, bounds, starts, stack });
            }
        }
    }
}

#[test]
fn a_ray_that_is_no_line_does_no_harm() {
    let tree = &swift(&leaf_triangles(&[[Vec3::ZERO, Vec3::X, Vec3::Y]; 9]));
    let bounds = &Bounds::around([Vec3::ZERO, Vec3::ONE]);
    let starts = &[ray(Vec3::ZERO, Vec3::NAN), ray(Vec3::ZERO, Vec3::INFINITY)];
    for instructions in Instructions::all() {
        for traversal in TRAVERSALS {
            let stack = &mut Stack::new(instructions);
            let ask = AskTogether { traversal, tree, bounds, starts, stack };
            let found = instructions.run(ask);
            assert!(found.iter().all(|(hit, _)| hit.1 == NO_PRIMITIVE));
        }
        let stack = &mut Stack::new(instructions);
        for &start in starts {
            let (probe, visits) = (&Probe::new(&start, bounds), stack.only());
            instructions.run(Ask { tree, probe, start, visits });
        }
    }
}

#[test]
fn a_child_that_is_not_there_cannot_be_met() {
    let corners = [[Vec3::ZERO, Vec3::X, Vec3::Y]; 3];
    let tree = swift(&leaf_triangles(&corners));
    let nodes = tree.hierarchy().nodes().to_vec();
    let with = |place: usize, word: u32| {
        let mut nodes = nodes.clone();
        bytemuck::cast_slice_mut::<_, u32>(&mut nodes)[place] = word;
        Tree::from_parts(nodes.into(), tree.triangles().clone()).map(|_| ())
    };
    assert_eq!(with(0, 0f32.to_bits()), Ok(()));
    // Lane 7: a bound, then as many triangles as a leaf may not have, then a node before itself.
    for (place, word) in [(7, 0f32.to_bits()), (63, 9), (63, u32::MAX), (56, 4), (56, 9)] {
        assert_eq!(with(place, word), Err(InvalidTree(0)), "{place} {word}");
    }
}
