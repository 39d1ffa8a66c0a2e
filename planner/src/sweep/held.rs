//! How well a tool speed is held on the surface, and what keeps it from that.

use nullsweep_robot::{Arm, JointVector};
use serde::{Deserialize, Serialize};

use crate::plan::{Trajectory, TrajectoryCursor};

/// Time between two looks. \[ns\]
const SAMPLE_NS: u64 = 1_000_000;
const SAMPLE: f64 = SAMPLE_NS as f64 * 1e-9;
/// What is within this share of the speed holds it.
const TOLERANCE: f64 = 0.02;
/// So many stretches are told, the longest.
const TOLD: usize = 5;

/// How well a tool speed is held.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Held {
    /// The speed that was asked for. \[m/s\]
    pub speed: f64,
    /// Share of the length on the surface where the pad's centre keeps it within 2 %.
    pub share: f64,
    /// The longest stretches where it is slower.
    pub slower: Vec<Slower>,
}

/// A stretch where the tool is slower than asked for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Slower {
    /// The pad's centre where it is slowest, root frame. \[m\]
    pub at: [f64; 3],
    /// \[s\] since the plan's start.
    pub time_s: f64,
    /// How long the stretch is. \[m\]
    pub length_m: f64,
    /// The lowest speed. \[m/s\]
    pub speed: f64,
    /// The joint that is nearest to its limit of velocity or acceleration in it.
    pub joint: String,
}

impl Held {
    /// Of a plan's motion.
    #[must_use]
    pub fn of(path: Trajectory<'_>, arm: &Arm, speed: f64) -> Self {
        let pad = path.tool.on(arm);
        let limits = arm.limits();
        let mut cursor = TrajectoryCursor::new(path);
        let end_ns = path.knots.last().map_or(0, |k| k.time_ns);
        let (mut kept, mut length) = (0.0, 0.0);
        let mut slower: Vec<Slower> = Vec::new();
        let mut open: Option<(Slower, f64)> = None;
        let mut before: Option<(JointVector, bool)> = None;
        let mut rate = JointVector::ZERO;
        for sample in 0..=end_ns / SAMPLE_NS {
            let (knot, q) = cursor.at(sample * SAMPLE_NS);
            let on_surface = path.on_surface(knot);
            if let Some((last, true)) = before.filter(|_| on_surface) {
                let step = pad.centre(&q) - pad.centre(&last);
                let velocity = JointVector::from_fn(|j| (q[j] - last[j]) / SAMPLE);
                let now = step.norm() / SAMPLE;
                length += step.norm();
                if now >= speed * (1.0 - TOLERANCE) {
                    kept += if now <= speed * (1.0 + TOLERANCE) { step.norm() } else { 0.0 };
                    slower.extend(open.take().map(|(stretch, _)| stretch));
                } else {
                    let use_of = |j: usize| {
                        let change = (velocity[j] - rate[j]).abs() / SAMPLE;
                        (velocity[j].abs() / limits[j].velocity)
                            .max(change / limits[j].acceleration)
                    };
                    let hardest = (0..arm.dof()).max_by(|a, b| use_of(*a).total_cmp(&use_of(*b)));
                    let joint = hardest.unwrap_or(0);
                    let here = |length_m| Slower {
                        at: pad.centre(&q).into(),
                        time_s: sample as f64 * SAMPLE,
                        length_m,
                        speed: now,
                        joint: arm.joint_names()[joint].clone(),
                    };
                    let (stretch, most) = open.get_or_insert_with(|| (here(0.0), 0.0));
                    stretch.length_m += step.norm();
                    if now < stretch.speed {
                        *stretch =
                            Slower { joint: stretch.joint.clone(), ..here(stretch.length_m) };
                    }
                    if use_of(joint) > *most {
                        (*most, stretch.joint) = (use_of(joint), arm.joint_names()[joint].clone());
                    }
                }
                rate = velocity;
            } else {
                slower.extend(open.take().map(|(stretch, _)| stretch));
                rate = JointVector::ZERO;
            }
            before = Some((q, on_surface));
        }
        slower.extend(open.map(|(stretch, _)| stretch));
        slower.sort_by(|a, b| b.length_m.total_cmp(&a.length_m));
        slower.truncate(TOLD);
        Self { speed, share: if length > 0.0 { kept / length } else { 0.0 }, slower }
    }
}
