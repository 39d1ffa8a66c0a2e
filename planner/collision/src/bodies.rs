//! Forward kinematics of what moves: one frame for each joint that the arm's joint vector drives.

use nalgebra::{Isometry3, Matrix3, Vector3};
use nullsweep_robot::{Arm, JointKind, JointVector, Robot};

use crate::frame::Frame;

/// Most bodies: the arm's joints and the joints that mimic them.
pub(crate) const MAX_BODIES: usize = 16;

/// The links that move together with one driven joint; its frame is the joint's child link's.
#[derive(Clone, Debug)]
pub(crate) struct Body {
    /// The body that this one hangs on; none: fixed to the robot's root.
    pub(crate) parent: Option<usize>,
    /// Joint frame in the parent body's frame (or the root frame) at value 0.
    pub(crate) rest: Frame,
    /// Unit axis in the joint frame.
    pub(crate) axis: Vector3<f64>,
    /// Slides along the axis instead of turning about it.
    pub(crate) prismatic: bool,
    /// Index into the joint vector; the joint's value is multiplier · q\[joint\] + offset.
    pub(crate) joint: usize,
    pub(crate) multiplier: f64,
    offset: f64,
    /// rest · K and rest · K² for Rodrigues' formula, K the axis' cross-product matrix.
    turned: [Matrix3<f64>; 2],
}

/// The driven bodies, parents first, and where each link of the robot sits.
#[derive(Clone, Debug)]
pub(crate) struct Bodies {
    pub(crate) bodies: Vec<Body>,
    /// For each link: its body (none: fixed to the root) and its frame in there.
    pub(crate) links: Vec<(Option<usize>, Frame)>,
    /// The tip frame in the last arm joint's body.
    pub(crate) tip: Frame,
    /// The body that carries the tip.
    pub(crate) tip_body: usize,
}

impl Body {
    /// The joint's value where the joint vector's entry is `q`. \[rad\] or \[m\]
    #[inline]
    pub(crate) fn value(&self, q: f64) -> f64 {
        self.multiplier * q + self.offset
    }

    /// The body's frame in its parent's at a value of its joint.
    #[inline]
    pub(crate) fn local(&self, value: f64) -> Frame {
        if self.prismatic {
            let slide = self.rest.rotation * (self.axis * value);
            return Frame { translation: self.rest.translation + slide, ..self.rest };
        }
        let (sine, cosine) = libm::sincos(value);
        let turned = self.turned[0] * sine + self.turned[1] * (1.0 - cosine);
        Frame { rotation: self.rest.rotation + turned, ..self.rest }
    }

    /// How far the body slides from its rest place at most, its joint within ±`stroke`. \[m\]
    pub(crate) fn most_slide(&self, stroke: f64) -> f64 {
        self.multiplier.abs() * stroke + self.offset.abs()
    }
}

impl Bodies {
    /// Sorts the robot's links by the driven joint that moves them; `Err` holds the number of
    /// driven joints where it is above [`MAX_BODIES`].
    pub(crate) fn new(robot: &Robot, arm: &Arm) -> Result<Self, usize> {
        let reference = arm.home();
        let mut poses = vec![Isometry3::identity(); robot.links().len()];
        arm.link_poses(&reference, &mut poses);

        let arm_joints: Vec<usize> = arm
            .joint_names()
            .iter()
            .map(|name| {
                let found = robot.joints().iter().position(|j| j.name == *name);
                found.expect("the arm's joints are the robot's")
            })
            .collect();
        // What drives a joint: index into the joint vector, factor, offset.
        let driver = |joint: usize| {
            let direct = |j: usize| arm_joints.iter().position(|&a| a == j);
            match (direct(joint), robot.joints()[joint].mimic) {
                (Some(index), _) => Some((index, 1.0, 0.0)),
                (None, Some(m)) => direct(m.joint).map(|index| (index, m.multiplier, m.offset)),
                (None, None) => None,
            }
        };

        // Links with parents before children; each gets the body of its parent or a new one.
        let mut bodies: Vec<Body> = Vec::new();
        let mut body_links: Vec<usize> = Vec::new();
        let mut of_link: Vec<Option<Option<usize>>> = vec![None; poses.len()];
        let mut open: Vec<usize> =
            (0..poses.len()).filter(|&l| robot.links()[l].parent_joint.is_none()).collect();
        let mut next = 0;
        while next < open.len() {
            let link = open[next];
            next += 1;
            let parent_joint = robot.links()[link].parent_joint;
            let parent = parent_joint.and_then(|j| of_link[robot.joints()[j].parent].flatten());
            let driven = parent_joint.and_then(|j| Some((j, driver(j)?)));
            of_link[link] = Some(match driven {
                None => parent,
                Some((j, (index, multiplier, offset))) => {
                    let joint = &robot.joints()[j];
                    let base =
                        parent.map_or(Isometry3::identity(), |b| poses[body_links[b]].inverse());
                    let rest = Frame::from(&(base * poses[joint.parent] * joint.origin));
                    let axis = joint.axis.into_inner();
                    let cross = axis.cross_matrix();
                    bodies.push(Body {
                        parent,
                        rest,
                        axis,
                        prismatic: joint.kind == JointKind::Prismatic,
                        joint: index,
                        multiplier,
                        offset,
                        turned: [rest.rotation * cross, rest.rotation * cross * cross],
                    });
                    body_links.push(link);
                    Some(bodies.len() - 1)
                }
            });
            open.extend(robot.joints().iter().filter(|j| j.parent == link).map(|j| j.child));
        }
        if bodies.len() > MAX_BODIES {
            return Err(bodies.len());
        }

        let inside = |body: Option<usize>, pose: &Isometry3<f64>| {
            let base = body.map_or(Isometry3::identity(), |b| poses[body_links[b]].inverse());
            Frame::from(&(base * pose))
        };
        let links = (0..poses.len())
            .map(|link| {
                let body = of_link[link].flatten();
                (body, inside(body, &poses[link]))
            })
            .collect();
        let last = *arm_joints.last().expect("an arm has joints");
        let tip_body = body_links
            .iter()
            .position(|&l| l == robot.joints()[last].child)
            .expect("the last joint's link is a body");
        let tip = inside(Some(tip_body), &arm.tip_pose(&reference));
        Ok(Self { bodies, links, tip, tip_body })
    }

    /// The body that carries a link (none: the tip frame), and the link's frame in there; no body: it
    /// does not move with the arm.
    pub(crate) fn carrier(&self, link: Option<usize>) -> (Option<usize>, Frame) {
        link.map_or((Some(self.tip_body), self.tip), |link| self.links[link])
    }

    /// The body frames in the root frame, in the first `bodies.len()` entries.
    #[inline]
    pub(crate) fn poses(&self, q: &JointVector) -> [Frame; MAX_BODIES] {
        let mut out = [Frame::IDENTITY; MAX_BODIES];
        for (i, body) in self.bodies.iter().enumerate() {
            let local = body.local(body.value(q[body.joint]));
            out[i] = match body.parent {
                Some(parent) => out[parent].then(&local),
                None => local,
            };
        }
        out
    }
}
