//! The joint path of a tour as a plan.

use nullsweep_robot::JointVector;
use nullsweep_surface::Patch;

use super::attempt::{Planning, Sequence, Visit};
use crate::plan::{Method, Plan, PlanKnot, SurfaceSample};
use crate::timing;

impl Planning<'_> {
    /// Joins the legs, unwraps continuous joints and sets the times.
    pub(super) fn assemble(&self, method: Method, patches: &[Patch], sequence: &Sequence) -> Plan {
        let Self { robot, job, stance, scan, .. } = *self;
        let arm = self.cell.arm;
        let mut knots: Vec<PlanKnot> = Vec::new();
        for Visit { patch, leg, .. } in &sequence.visits {
            let shift =
                knots.last().map_or(JointVector::ZERO, |last| leg.joints[0].turns_to(&last.q));
            let first = usize::from(!knots.is_empty());
            for (q, line) in leg.joints.iter().zip(&leg.line).skip(first) {
                let q = *q + shift;
                let line = line.map(|p| [p.x, p.y, p.z]);
                knots.push(PlanKnot { time_ns: 0, q, v: JointVector::ZERO, line, patch: None });
            }
            if let Some(last) = knots.last_mut() {
                last.patch = Some(*patch as u32);
            }
        }
        // A knot that repeats its predecessor would take no time.
        knots.dedup_by(|b, a| {
            let same = a.q == b.q;
            if same {
                a.patch = a.patch.or(b.patch);
                a.line = a.line.or(b.line);
            }
            same
        });
        timing::set_times(&mut knots, &self.velocity);
        Plan {
            base: stance.base,
            base_height: stance.height,
            method,
            cost: job.cost,
            seed: job.seed,
            patches: patches.iter().map(|p| p.centre.into()).collect(),
            surface: (0..scan.points.len())
                .map(|i| SurfaceSample {
                    point: scan.points[i].into(),
                    normal: scan.normals[i].into_inner().into(),
                    reachable: self.to_sweep[i],
                })
                .collect(),
            continues: self.continues.clone(),
            past: job
                .after
                .as_ref()
                .filter(|a| !a.again)
                .map_or_else(Vec::new, |a| a.plan.followed(a.knot)),
            ..Plan::of(robot, arm, &job.tool, knots)
        }
    }
}
