//! Recordings of plans, made without an executor.

use bytemuck::Zeroable as _;
use nullsweep_ipc_types::PlanId;
use nullsweep_planner::plan::Plan;
use nullsweep_recording::{self as recording, PlanRecord, Tag};
use nullsweep_robot::JointVector;

/// A plan as an executor records it.
pub(crate) fn put_plan(bytes: &mut Vec<u8>, id: PlanId, plan: &Plan) {
    let head = PlanRecord { id, ..PlanRecord::zeroed() };
    let knots: Vec<recording::PlanKnot> = plan
        .knots
        .iter()
        .map(|k| recording::PlanKnot { time: k.time_ns as f64, q: k.q, v: k.v, ramp: 1.0 })
        .collect();
    let parts: [&[u8]; 2] = [bytemuck::bytes_of(&head), bytemuck::cast_slice(&knots)];
    recording::put(bytes, Tag::Plan, &parts);
}

/// Where a plan has the arm at a time \[ns\], and the knot before it.
pub(crate) fn planned(plan: &Plan, time: u64) -> (JointVector, u32) {
    let k = plan.knots.partition_point(|k| k.time_ns <= time).clamp(1, plan.knots.len() - 1);
    let from = plan.knots[k - 1].time_ns;
    let share = (time - from) as f64 / (plan.knots[k].time_ns - from) as f64;
    (plan.curve(k).at(share.min(1.0)), (k - 1) as u32)
}
