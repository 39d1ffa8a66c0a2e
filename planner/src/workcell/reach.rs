//! Which patches the arm reaches.

use nullsweep_surface::Patch;
use rayon::prelude::*;

use super::contact::{contact_pose, direction};
use super::sample::{Sample, Workcell, middle_out, redundancies};

/// Headings at which a patch is tried, evenly over a turn, of a symmetric tool over half of one: with a pad that turns about the
/// arm's last axis one would do, other arms and the gripper's shape want several.
const HEADINGS: usize = 8;

/// For each patch, one sample that reaches it, at the first heading that has one; `None` for an
/// unreachable patch. `tick` is called once a patch.
#[must_use]
pub fn reach(
    cell: Workcell<'_>,
    patches: &[Patch],
    ik_samples: usize,
    tick: &(dyn Fn() + Sync),
) -> Vec<Option<Sample>> {
    let values = middle_out(redundancies(cell.arm.ik().redundancy_range(), ik_samples.max(24)));
    patches
        .par_iter()
        .map(|patch| {
            let turn = cell.tool.heading_range();
            let found = (0..HEADINGS).find_map(|h| {
                let heading = turn * h as f64 / HEADINGS as f64;
                let travel = direction(&patch.normal, heading);
                let pose = contact_pose(&patch.centre, &patch.normal, &travel, cell.tool.stand_off);
                cell.first_sample(&pose, heading, &values)
            });
            tick();
            found
        })
        .collect()
}
