//! Binary trees collapsed to wide ones, by the least surface-area cost.
//!
//! Dynamic programming as Ylitie, Karras and Laine do it (*Efficient Incoherent Ray Traversal on
//! GPUs Through Compressed Wide BVHs*, HPG 2017, section 4.2): the cost of a binary subtree as a
//! forest of up to i wide subtrees follows from those of its two children, and the choices on the
//! way down give the wide tree.

use obvhs::bvh2::node::Bvh2Node;

use super::{Child, NODE, Node, WIDTH, bounds_of};

/// What visiting a node costs.
const NODE_COST: f32 = 1.0;

/// What visiting a leaf costs, however many things it has: they are tested at a time.
const LEAF_COST: f32 = 0.7;

/// What each thing of a leaf costs beside that.
const THING_COST: f32 = 0.03;

/// How a binary subtree becomes wide ones, by the number of these that it may become at most.
#[derive(Clone, Copy, Debug, Default)]
struct Plan {
    /// For a forest of at most i + 2 trees: how many of them the first child gets; 0 if fewer trees
    /// cost less. The last is what a node gives its children, so never 0.
    splits: [u8; WIDTH - 1],
    /// If it is one tree: how many things the leaf has that it becomes; 0 if it becomes a node.
    leaf_things: u8,
}

/// Costs of a subtree, and how much is below it.
#[derive(Clone, Copy, Debug)]
struct Costs {
    /// As a forest of at most i + 1 trees; no more than there are leaves make it cheaper.
    forests: [f32; WIDTH - 1],
    things: usize,
    /// Of the binary tree: so many trees it may become at most.
    leaves: usize,
}

/// A subtree that becomes a node, and the child of which node of ours it is.
struct Open {
    found: u32,
    parent: Option<(usize, usize)>,
}

/// Collapses trees, one after another in the same memory.
#[derive(Default)]
pub(super) struct Collapse {
    /// By node of the binary tree.
    plans: Vec<Plan>,
    /// The nodes of the last wide tree.
    pub(super) nodes: Vec<Node>,
    /// The things in the order of its leaves.
    pub(super) order: Vec<u32>,
}

impl Collapse {
    /// Forgets the last tree, but keeps its memory.
    pub(super) fn clear(&mut self) {
        self.nodes.clear();
        self.order.clear();
        self.plans.clear();
    }

    /// Collapses the tree of these nodes, the first of which is the root. `things` are those of a
    /// leaf: at least one, and at most as many as our leaves may have.
    pub(super) fn run<T: ExactSizeIterator<Item = u32>>(
        &mut self,
        found: &[Bvh2Node],
        things: impl Fn(&Bvh2Node) -> T,
    ) {
        self.clear();
        self.plans.resize(found.len(), Plan::default());
        self.plan(found, &things);
        self.lay_out(found, &things);
    }

    /// Finds the cheapest way for each subtree.
    fn plan<T: ExactSizeIterator<Item = u32>>(
        &mut self,
        found: &[Bvh2Node],
        things: &impl Fn(&Bvh2Node) -> T,
    ) {
        // Parents are met before their children and after them.
        let mut open = vec![(0u32, false)];
        let mut done: Vec<Costs> = Vec::new();
        while let Some((index, is_met)) = open.pop() {
            let node = &found[index as usize];
            if node.is_leaf() {
                let count = things(node).len();
                let cost = leaf_cost(node, count);
                self.plans[index as usize].leaf_things = as_count(count);
                done.push(Costs { forests: [cost; WIDTH - 1], things: count, leaves: 1 });
            } else if is_met {
                let right = done.pop().expect("both children are done");
                let left = done.pop().expect("both children are done");
                let (plan, costs) = plan_node(node, &left, &right);
                self.plans[index as usize] = plan;
                done.push(costs);
            } else {
                open.push((index, true));
                open.extend([(node.first_index + 1, false), (node.first_index, false)]);
            }
        }
    }

    fn lay_out<T: ExactSizeIterator<Item = u32>>(
        &mut self,
        found: &[Bvh2Node],
        things: &impl Fn(&Bvh2Node) -> T,
    ) {
        let mut open = vec![Open { found: 0, parent: None }];
        let mut forest = Vec::with_capacity(WIDTH);
        while let Some(Open { found: root, parent }) = open.pop() {
            let index = self.nodes.len();
            if let Some((node, lane)) = parent {
                let first = u32::try_from(index).expect("triangles are limited");
                self.nodes[node].firsts[lane] = first;
            }
            forest.clear();
            if self.plans[root as usize].leaf_things > 0 {
                forest.push(root);
            } else {
                self.split(found, root, WIDTH, &mut forest);
            }
            let mut node = Node::childless();
            let before = open.len();
            for (lane, &root) in forest.iter().enumerate() {
                let bounds = bounds_of(found[root as usize].aabb());
                let count = u32::from(self.plans[root as usize].leaf_things);
                let child = if count == 0 {
                    open.push(Open { found: root, parent: Some((index, lane)) });
                    Child { first: 0, count: NODE }
                } else {
                    let first = u32::try_from(self.order.len()).expect("triangles are limited");
                    self.gather(found, root, things);
                    Child { first, count }
                };
                node.set_child(lane, &bounds, child);
            }
            // The first child comes right after its parent.
            open[before..].reverse();
            self.nodes.push(node);
        }
    }

    /// The trees of the forest that a subtree becomes, of which there may be `most`.
    fn split(&self, found: &[Bvh2Node], root: u32, most: usize, forest: &mut Vec<u32>) {
        let plan = &self.plans[root as usize];
        let is_one = |most: &usize| *most == 1 || found[root as usize].is_leaf();
        let mut most = most;
        while !is_one(&most) && plan.splits[most - 2] == 0 {
            most -= 1;
        }
        if is_one(&most) {
            forest.push(root);
            return;
        }
        let first = usize::from(plan.splits[most - 2]);
        let left = found[root as usize].first_index;
        self.split(found, left, first, forest);
        self.split(found, left + 1, most - first, forest);
    }

    fn gather<T: ExactSizeIterator<Item = u32>>(
        &mut self,
        found: &[Bvh2Node],
        root: u32,
        things: &impl Fn(&Bvh2Node) -> T,
    ) {
        let node = &found[root as usize];
        if node.is_leaf() {
            self.order.extend(things(node));
        } else {
            self.gather(found, node.first_index, things);
            self.gather(found, node.first_index + 1, things);
        }
    }
}

fn plan_node(node: &Bvh2Node, left: &Costs, right: &Costs) -> (Plan, Costs) {
    let mut plan = Plan::default();
    let (things, leaves) = (left.things + right.things, left.leaves + right.leaves);
    let share = |most: usize| {
        let cost = |first: usize| left.forests[first - 1] + right.forests[most - first - 1];
        let least = most.saturating_sub(right.leaves).max(1);
        let mut best = (cost(least), least);
        for first in least + 1..=left.leaves.min(most - 1) {
            let cost = cost(first);
            if cost < best.0 {
                best = (cost, first);
            }
        }
        best
    };
    let (cost, first) = share(leaves.min(WIDTH));
    plan.splits[WIDTH - 2] = as_count(first);
    let as_node = cost + node.aabb().half_area() * NODE_COST;
    let as_leaf = leaf_cost(node, things);
    if things <= WIDTH && as_leaf <= as_node {
        plan.leaf_things = as_count(things);
    }
    let mut forests = [as_leaf.min(as_node); WIDTH - 1];
    for most in 2..WIDTH {
        forests[most - 1] = forests[most - 2];
        if most > leaves {
            continue;
        }
        let (cost, first) = share(most);
        // Where it costs the same, rather more children than deeper trees.
        if cost <= forests[most - 1] {
            forests[most - 1] = cost;
            plan.splits[most - 2] = as_count(first);
        }
    }
    (plan, Costs { forests, things, leaves })
}

/// What a leaf of so many things costs; more than anything if it cannot be.
fn leaf_cost(node: &Bvh2Node, things: usize) -> f32 {
    if things > WIDTH {
        return f32::INFINITY;
    }
    node.aabb().half_area() * (LEAF_COST + THING_COST * things as f32)
}

#[expect(clippy::cast_possible_truncation, reason = "at most the width of nodes")]
const fn as_count(count: usize) -> u8 {
    count as u8
}
