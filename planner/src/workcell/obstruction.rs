//! Why the pad does not come to a place: of all that is in the way, what comes nearest to letting it.

use nullsweep_collision::{Hit, ToolContact, With};
use nullsweep_robot::{JointVector, Solutions};
use nullsweep_surface::Patch;
use serde::{Deserialize, Serialize};

use super::contact::{contact_pose, direction};
use super::sample::{Workcell, redundancies};

/// What is in the way.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(tag = "cause", rename_all = "snake_case")]
pub enum Cause {
    /// The arm is too short, or cannot turn its hand so: no inverse kinematics.
    OutOfReach,
    /// A joint would have to leave its limits.
    Limit {
        /// The joint.
        joint: String,
        /// Whether it slides: its limits are in m, of others in rad.
        #[serde(default)]
        slides: bool,
    },
    /// The robot is in its own way.
    Itself {
        /// What moves with the arm.
        link: String,
        /// What it meets.
        other: String,
    },
    /// A solid thing: floor, table, wall.
    Solid {
        /// What meets it.
        link: String,
        /// Its name.
        name: String,
    },
    /// Measured points.
    Object {
        /// What meets them.
        link: String,
    },
    /// A place that the tool is to keep out of, beside it.
    KeepOut,
    /// Space that no view has seen.
    Unseen {
        /// What would be in it.
        link: String,
    },
    /// Something stands so high that it would press the pad in too deep.
    Press,
    /// The place is reached, but no motion to it was found.
    NoMotion,
    /// The place is reached, but the pad's way passes beside it, or too high or too aslant.
    Passed,
    /// Its surroundings are too uneven for the pad to lie on.
    Uneven,
    /// Nothing: the arm has postures there that are free, but the search looked at others.
    Missed,
}

impl std::fmt::Display for Cause {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::OutOfReach => f.write_str("out of the arm's reach"),
            Self::Limit { joint, .. } => write!(f, "{joint} would leave its limits"),
            Self::Itself { link, other } => write!(f, "{link} meets {other}"),
            Self::Solid { link, name } => write!(f, "{link} meets the {name}"),
            Self::Object { link } => write!(f, "{link} meets the object"),
            Self::KeepOut => f.write_str("the pad would touch what it is to keep out of"),
            Self::Unseen { link } => write!(f, "{link} would be in unseen space"),
            Self::Press => f.write_str("the pad is pressed in too deep"),
            Self::NoMotion => f.write_str("reached, but no motion to it was found"),
            Self::Passed => f.write_str("reached, but passed by"),
            Self::Uneven => f.write_str("too uneven for the pad"),
            Self::Missed => f.write_str("free, but not found by the search"),
        }
    }
}

/// What keeps the pad from a place.
#[derive(Clone, Debug, PartialEq)]
pub struct Obstruction {
    /// What is in the way.
    pub cause: Cause,
    /// By how much the posture that comes nearest to being free falls short: of a margin \[m\], of a
    /// limit \[rad\] or \[m\]; 0 where there is none.
    pub short: f64,
}

/// Headings that are looked at.
const HEADINGS: usize = 8;
/// Redundancy values at each, as many as are looked at where a place is searched.
const REDUNDANCIES: usize = 24;
/// Postures that are looked at closely: slow.
const POSTURES: usize = 24;

/// What keeps the pad from lying on a patch that is not reached.
#[must_use]
pub fn obstruction(cell: Workcell<'_>, patch: &Patch) -> Obstruction {
    let Workcell { arm, tool, world } = cell;
    let values = redundancies(arm.ik().redundancy_range(), REDUNDANCIES);
    let turn = tool.heading_range();
    let (mut inside, mut outside) = (Vec::new(), None::<Obstruction>);
    let mut solutions = Solutions::new();
    for heading in (0..HEADINGS).map(|h| turn * h as f64 / HEADINGS as f64) {
        let travel = direction(&patch.normal, heading);
        let contact = contact_pose(&patch.centre, &patch.normal, &travel, tool.stand_off);
        let tip = contact * tool.contact_in_tip().inverse();
        for &value in &values {
            solutions.clear();
            arm.ik().solve(&tip, value, &mut solutions);
            for solution in &solutions {
                let (joint, beyond) = beyond(cell, &solution.q);
                if beyond <= 0.0 {
                    inside.push(solution.q);
                } else if outside.as_ref().is_none_or(|o| beyond < o.short) {
                    let slides = !arm.is_revolute(joint);
                    let joint = arm.joint_names()[joint].clone();
                    let cause = Cause::Limit { joint, slides };
                    outside = Some(Obstruction { cause, short: beyond });
                }
            }
        }
    }
    let step = inside.len().div_ceil(POSTURES).max(1);
    let looked = inside.iter().step_by(step).map(|q| world.why_not(q, ToolContact::Allowed));
    let Some(hits) = looked.collect::<Option<Vec<Hit>>>() else {
        return Obstruction { cause: Cause::Missed, short: 0.0 };
    };
    let nearest = hits.into_iter().min_by(|a, b| short(a).total_cmp(&short(b)));
    let unreached = Obstruction { cause: Cause::OutOfReach, short: 0.0 };
    let hit = nearest.map(|hit| Obstruction { short: short(&hit), cause: cause(hit, &tool.name) });
    hit.or(outside).unwrap_or(unreached)
}

/// The joint that is farthest beyond its margined limits, and by how much; negative inside. \[rad\]
/// or \[m\]
fn beyond(cell: Workcell<'_>, q: &JointVector) -> (usize, f64) {
    let limits = cell.arm.margined_limits().iter().zip(q.iter());
    let beyond = limits.map(|((low, high), q)| (low - q).max(q - high)).enumerate();
    beyond.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, 0.0))
}

fn short(hit: &Hit) -> f64 {
    hit.margin - hit.distance
}

fn cause(hit: Hit, pad: &str) -> Cause {
    let Hit { link, with, .. } = hit;
    match with {
        With::Link(other) => Cause::Itself { link, other },
        With::Obstacle(name) => Cause::Solid { link, name },
        With::ScanPoint(_) if link == pad => Cause::Press,
        With::ScanPoint(_) => Cause::Object { link },
        With::KeepOut(_) => Cause::KeepOut,
        With::Unseen(_) => Cause::Unseen { link },
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Vector3};
    use nullsweep_collision::{Options, World};
    use nullsweep_robot::{ArmSpec, Robot, Side, Tool};

    use super::super::reach;
    use super::*;

    #[test]
    fn where_a_posture_is_free_nothing_is_in_the_way() {
        let robot = Robot::pr2();
        let arm = robot.arm(&ArmSpec::pr2(Side::Right)).unwrap();
        let tool = Tool::default();
        let world = World::new(&robot, &arm, &tool, &[], &[], &Options::default()).unwrap();
        let cell = Workcell { arm: &arm, tool: &tool, world: &world };
        let patch = |x: f64| Patch {
            centre: Point3::new(x, -0.3, 0.8),
            normal: Vector3::z_axis(),
            points: Vec::new(),
            rmse: 0.0,
        };
        assert!(reach(cell, &[patch(0.6)], 24, &|| ())[0].is_some());
        let missed = Obstruction { cause: Cause::Missed, short: 0.0 };
        assert_eq!(obstruction(cell, &patch(0.6)), missed);
        assert_eq!(obstruction(cell, &patch(3.0)).cause, Cause::OutOfReach);
    }
}
