//! From the tree to an arm: the serial chain, and how every link follows from its parent.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::chain::{Chain, Step, about};
use crate::spec::HeldJoint;
use crate::urdf::{JointKind, Model};

/// A link's pose from its parent's.
#[derive(Clone)]
pub(super) struct Placement {
    pub(super) link: usize,
    pub(super) parent: usize,
    /// Fixed part, with the motion of held joints in it.
    pub(super) local: Isometry3<f64>,
    pub(super) motion: Motion,
}

/// What moves a link against its parent.
#[derive(Clone)]
pub(super) enum Motion {
    /// Does not move with the arm: `local` is the pose in the root frame.
    Static,
    /// Fixed to a link that moves.
    Carried,
    /// Moves by factor · q[joint] + offset about or along an axis.
    Joint { axis: Vector3<f64>, prismatic: bool, source: usize, factor: f64, offset: f64 },
}

/// Which value each joint of the robot has.
pub(super) struct Values<'a> {
    pub(super) model: &'a Model,
    pub(super) active: &'a [usize],
    pub(super) held: &'a [HeldJoint],
}

/// The value of a joint: factor · q[source] + offset, or a constant.
enum Value {
    Constant(f64),
    Follows { source: usize, factor: f64, offset: f64 },
}

impl Values<'_> {
    fn of(&self, mut index: usize) -> Value {
        let (mut factor, mut offset) = (1.0, 0.0);
        while let Some(mimic) = self.model.joints[index].mimic {
            offset += factor * mimic.offset;
            factor *= mimic.multiplier;
            index = mimic.joint;
        }
        if let Some(source) = self.active.iter().position(|&a| a == index) {
            return Value::Follows { source, factor, offset };
        }
        let name = &self.model.joints[index].name;
        let position = self.held.iter().find(|h| h.name == *name).map_or(0.0, |h| h.position);
        Value::Constant(factor * position + offset)
    }
}

pub(super) fn motion_of(axis: &Vector3<f64>, prismatic: bool, value: f64) -> Isometry3<f64> {
    if prismatic {
        Isometry3::from_parts((axis * value).into(), UnitQuaternion::identity())
    } else {
        Isometry3::from_parts(Translation3::identity(), about(axis, value))
    }
}

pub(super) fn build_chain(values: &Values<'_>, tip: usize) -> Chain {
    let model = values.model;
    let mut joints = Vec::new();
    let mut link = tip;
    while let Some(index) = model.links[link].parent_joint {
        joints.push(index);
        link = model.joints[index].parent;
    }
    let mut steps = Vec::new();
    let mut fixed = Isometry3::identity();
    for &index in joints.iter().rev() {
        let joint = &model.joints[index];
        fixed *= joint.origin;
        let prismatic = joint.kind == JointKind::Prismatic;
        match values.of(index) {
            _ if joint.kind == JointKind::Fixed => {}
            Value::Constant(value) => {
                fixed *= motion_of(&joint.axis, prismatic, value);
            }
            Value::Follows { .. } => {
                steps.push(Step::new(fixed, *joint.axis, prismatic));
                fixed = Isometry3::identity();
            }
        }
    }
    Chain { steps, tip: fixed }
}

pub(super) fn build_placements(values: &Values<'_>) -> (Vec<Placement>, Vec<usize>) {
    let model = values.model;
    let mut moving = Vec::new();
    let mut root_poses = vec![Isometry3::identity(); model.links.len()];
    let root = model.root;
    let mut placements = vec![Placement {
        link: root,
        parent: root,
        local: Isometry3::identity(),
        motion: Motion::Static,
    }];
    for &index in &model.order {
        let joint = &model.joints[index];
        let (link, parent) = (joint.child, joint.parent);
        let prismatic = joint.kind == JointKind::Prismatic;
        let carried = moving.contains(&parent);
        let mut local = joint.origin;
        let mut motion = if carried { Motion::Carried } else { Motion::Static };
        if joint.kind != JointKind::Fixed {
            match values.of(index) {
                Value::Constant(value) => local *= motion_of(&joint.axis, prismatic, value),
                Value::Follows { source, factor, offset } => {
                    motion = Motion::Joint { axis: *joint.axis, prismatic, source, factor, offset };
                }
            }
        }
        match motion {
            Motion::Static => {
                local = root_poses[parent] * local;
                root_poses[link] = local;
            }
            Motion::Carried | Motion::Joint { .. } => moving.push(link),
        }
        placements.push(Placement { link, parent, local, motion });
    }
    (placements, moving)
}
