//! Paths through free space.

use std::f64::consts::PI;

use nullsweep_collision::{ToolContact, World};
use nullsweep_robot::{Arm, JointVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// How hard to look for a path. All limits are counts, so a seed gives the same path anywhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Samples drawn by RRT-Connect.
    pub samples: usize,
    /// Longest segment of a tree, Euclidean over the joints. \[rad\]
    pub step: f64,
    /// Shortcuts tried on the path found; 0 leaves it as it is.
    pub shortcuts: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self { samples: 300, step: 0.8, shortcuts: 60 }
    }
}

/// Samples after which an end that none of them leads away from is shut in.
const SHUT_IN: usize = 120;
/// Shortcuts in succession that are none, after which no more are tried.
const VAIN: usize = 15;

/// A path from `from` to `to` on which the tool too keeps its margin: the straight joint line if
/// that is free, else RRT-Connect (Kuffner and LaValle, 2000) and shortcuts.
///
/// Samples are drawn inside the margined limits; `from` and `to` must be free, and may lie outside
/// of them.
#[must_use]
pub fn rrt_connect(
    world: &World,
    arm: &Arm,
    from: &JointVector,
    to: &JointVector,
    options: &Options,
    seed: u64,
) -> Option<Vec<JointVector>> {
    let goal = arm.continuous().nearest_turn(to, from);
    let free = |a: &JointVector, b: &JointVector| world.motion_free(a, b, ToolContact::Forbidden);
    if !world.is_free(from, ToolContact::Forbidden) || !world.is_free(&goal, ToolContact::Forbidden)
    {
        return None;
    }
    if free(from, &goal) {
        return Some(vec![*from, goal]);
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let ranges: Vec<(f64, f64)> = arm
        .limits()
        .iter()
        .zip(arm.margined_limits())
        .enumerate()
        .map(|(j, (limits, margined))| {
            // A turn to either side of the ends reaches every orientation.
            let wide = (from[j].min(goal[j]) - PI, from[j].max(goal[j]) + PI);
            if limits.continuous { wide } else { *margined }
        })
        .collect();

    let mut trees = [Tree::new(*from), Tree::new(goal)];
    let mut growing = 0;
    for drawn in 0..options.samples {
        if drawn == SHUT_IN && trees.iter().any(|tree| tree.nodes.len() == 1) {
            return None;
        }
        let mut sample = JointVector::default();
        for (value, (lower, upper)) in sample.iter_mut().zip(&ranges) {
            *value = rng.random_range(*lower..=*upper);
        }
        if let Some(new) = trees[growing].extend(&sample, options.step, free) {
            let target = trees[growing].nodes[new].0;
            if let Some(met) = trees[1 - growing].connect(&target, options.step, free) {
                let mut path = trees[growing].path_to(new);
                let mut rest = trees[1 - growing].path_to(met);
                rest.reverse();
                // Both trees hold the node where they meet.
                path.extend(&rest[1..]);
                if growing == 1 {
                    path.reverse();
                }
                if options.shortcuts > 0 {
                    shortcut(&mut path, options.shortcuts, &mut rng, free);
                }
                return Some(path);
            }
        }
        growing = 1 - growing;
    }
    None
}

/// A path on which the tool keeps its margin, with stretches replaced by straight lines where that is
/// shorter and free.
#[must_use]
pub(super) fn shortened(
    world: &World,
    mut path: Vec<JointVector>,
    options: &Options,
    seed: u64,
) -> Vec<JointVector> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let free = |a: &JointVector, b: &JointVector| world.motion_free(a, b, ToolContact::Forbidden);
    shortcut(&mut path, options.shortcuts, &mut rng, free);
    path
}

/// A tree of free configurations, each with the index of its parent (its own for the root).
struct Tree {
    nodes: Vec<(JointVector, usize)>,
}

impl Tree {
    fn new(root: JointVector) -> Self {
        Self { nodes: vec![(root, 0)] }
    }

    /// Adds a node at most one step towards `target`, from the nearest one.
    fn extend(
        &mut self,
        target: &JointVector,
        step: f64,
        free: impl Fn(&JointVector, &JointVector) -> bool,
    ) -> Option<usize> {
        let mut nearest = (f64::INFINITY, 0);
        for (index, (q, _)) in self.nodes.iter().enumerate() {
            let distance = q.distance(target);
            if distance < nearest.0 {
                nearest = (distance, index);
            }
        }
        self.step_from(nearest.1, target, step, free)
    }

    /// Steps towards `target` until it is reached; its node, unless something is in the path.
    fn connect(
        &mut self,
        target: &JointVector,
        step: f64,
        free: impl Fn(&JointVector, &JointVector) -> bool,
    ) -> Option<usize> {
        let mut at = self.extend(target, step, &free)?;
        while self.nodes[at].0 != *target {
            at = self.step_from(at, target, step, &free)?;
        }
        Some(at)
    }

    fn step_from(
        &mut self,
        parent: usize,
        target: &JointVector,
        step: f64,
        free: impl Fn(&JointVector, &JointVector) -> bool,
    ) -> Option<usize> {
        let from = self.nodes[parent].0;
        let length = from.distance(target);
        let next = if length <= step { *target } else { from.lerp(target, step / length) };
        free(&from, &next).then(|| {
            self.nodes.push((next, parent));
            self.nodes.len() - 1
        })
    }

    /// From the root to a node.
    fn path_to(&self, node: usize) -> Vec<JointVector> {
        let mut path = vec![self.nodes[node].0];
        let mut at = node;
        while at != self.nodes[at].1 {
            at = self.nodes[at].1;
            path.push(self.nodes[at].0);
        }
        path.reverse();
        path
    }
}

/// Replaces stretches of the path by straight lines where that is shorter and free.
fn shortcut(
    path: &mut Vec<JointVector>,
    tries: usize,
    rng: &mut ChaCha8Rng,
    free: impl Fn(&JointVector, &JointVector) -> bool,
) {
    let mut in_vain = 0;
    for _ in 0..tries {
        if path.len() < 3 {
            return;
        }
        if in_vain == VAIN {
            break;
        }
        in_vain += 1;
        // Two places anywhere on the path, as segment and fraction.
        let mut place = || {
            let at = rng.random_range(0.0..(path.len() - 1) as f64);
            (at as usize, at.fract())
        };
        let (mut first, mut second) = (place(), place());
        if first.0 > second.0 {
            std::mem::swap(&mut first, &mut second);
        }
        if first.0 == second.0 {
            continue;
        }
        let on = |(segment, t): (usize, f64)| -> JointVector {
            let (a, b) = (&path[segment], &path[segment + 1]);
            a.lerp(b, t)
        };
        let (a, b) = (on(first), on(second));
        let mut around = vec![a];
        around.extend(&path[first.0 + 1..=second.0]);
        around.push(b);
        if a.distance(&b) < length(&around) - 1e-9 && free(&a, &b) {
            path.splice(first.0 + 1..=second.0, [a, b]);
            in_vain = 0;
        }
    }
    // Waypoints that nothing stands in the way of leaving out.
    let mut i = 1;
    while i + 1 < path.len() {
        if free(&path[i - 1], &path[i + 1]) {
            path.remove(i);
        } else {
            i += 1;
        }
    }
}

/// Sum of the Euclidean lengths of its segments. \[rad\]
pub(super) fn length(path: &[JointVector]) -> f64 {
    path.windows(2).map(|pair| pair[0].distance(&pair[1])).sum()
}
