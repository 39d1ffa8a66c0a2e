//! URDF text to a checked kinematic tree.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, UnitVector3, Vector3};

use crate::xml::{JointFacts, joint_facts};

/// A whole robot: one tree of links joined by joints, from a URDF.
///
/// Cheap to clone (the tree is shared).
#[derive(Clone, Debug)]
pub struct Robot {
    pub(crate) model: Arc<Model>,
}

/// The tree itself.
#[derive(Debug)]
pub(crate) struct Model {
    pub(crate) name: String,
    pub(crate) links: Vec<Link>,
    pub(crate) joints: Vec<Joint>,
    /// The one link without a parent joint.
    pub(crate) root: usize,
    /// All joints, parents before children.
    pub(crate) order: Vec<usize>,
}

/// A rigid body.
#[derive(Clone, Debug)]
pub struct Link {
    /// Unique in the robot.
    pub name: String,
    /// Collision shapes; may be none.
    pub collisions: Vec<CollisionShape>,
    /// Index of the joint that moves this link; none for the root.
    pub parent_joint: Option<usize>,
}

/// A shape that stands for a link, or a part of it, in collision checks.
#[derive(Clone, Debug, PartialEq)]
pub struct CollisionShape {
    /// Pose of the shape in the link frame.
    pub origin: Isometry3<f64>,
    /// The shape around its own origin.
    pub geometry: Geometry,
}

/// Geometry of a collision shape, centred on its origin. \[m\]
#[derive(Clone, Debug, PartialEq)]
pub enum Geometry {
    /// A cuboid.
    Box {
        /// Half of the size along x, y, z.
        half_extents: Vector3<f64>,
    },
    /// A cylinder along z.
    Cylinder {
        /// Radius.
        radius: f64,
        /// Half of the length.
        half_length: f64,
    },
    /// A ball.
    Sphere {
        /// Radius.
        radius: f64,
    },
    /// A cylinder along z with half balls at its ends.
    Capsule {
        /// Radius of cylinder and balls.
        radius: f64,
        /// Half of the length of the cylinder without the balls.
        half_length: f64,
    },
    /// A mesh file, which this crate does not open.
    Mesh {
        /// As written in the URDF, for example `package://…`.
        uri: String,
        /// Scale along x, y, z.
        scale: Vector3<f64>,
    },
}

/// A joint between two links.
#[derive(Clone, Debug)]
pub struct Joint {
    /// Unique in the robot.
    pub name: String,
    /// How it moves.
    pub kind: JointKind,
    /// Index of the parent link.
    pub parent: usize,
    /// Index of the child link.
    pub child: usize,
    /// Pose of the joint frame in the parent link's frame.
    pub origin: Isometry3<f64>,
    /// Axis in the joint frame.
    pub axis: UnitVector3<f64>,
    /// `<limit>`; none where the URDF has none.
    pub limits: Option<HardLimits>,
    /// `<safety_controller>`; none where the URDF has none.
    pub safety: Option<SafetyController>,
    /// Follows another joint.
    pub mimic: Option<Mimic>,
    /// xyz and rpy as written: bits that do not depend on any sine.
    pub(crate) origin_text: [f64; 6],
}

/// How a joint moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointKind {
    /// Not at all.
    Fixed,
    /// About its axis between limits. \[rad\]
    Revolute,
    /// About its axis without limits. \[rad\]
    Continuous,
    /// Along its axis between limits. \[m\]
    Prismatic,
}

/// `<limit>` of a joint. [rad, rad/s, rad/s²; m for prismatic joints]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HardLimits {
    /// Lower end; −∞ for continuous joints.
    pub lower: f64,
    /// Upper end; +∞ for continuous joints.
    pub upper: f64,
    /// Largest speed.
    pub velocity: f64,
    /// Largest acceleration, where the URDF has one.
    pub acceleration: Option<f64>,
}

/// `<safety_controller>` of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SafetyController {
    /// Soft limits [rad or m]; none for continuous joints and where the URDF has none.
    pub soft: Option<(f64, f64)>,
    /// How the allowed speed grows with the distance to a soft limit. [1/s]
    pub k_position: Option<f64>,
}

/// A joint that follows another: position = multiplier · other + offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mimic {
    /// Index of the joint that is followed.
    pub joint: usize,
    /// Factor.
    pub multiplier: f64,
    /// Offset. [rad or m]
    pub offset: f64,
}

/// Why a URDF was refused.
#[derive(Debug, thiserror::Error)]
pub enum UrdfError {
    /// The file could not be read.
    #[error("cannot read URDF {path}: {source}; check the path (a xacro file must be expanded)")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The text is not a URDF.
    #[error("not a valid URDF: {reason}")]
    Parse {
        /// What the parser said.
        reason: String,
    },
    /// There is no link.
    #[error("the URDF has no link")]
    Empty,
    /// A joint type without a single axis.
    #[error(
        "joint {joint} is {kind}: only fixed, revolute, continuous and prismatic are supported"
    )]
    UnsupportedJoint {
        /// The joint.
        joint: String,
        /// Its type.
        kind: String,
    },
    /// A name is used twice.
    #[error("{what} name {name} is used twice: names must be unique")]
    DuplicateName {
        /// `link` or `joint`.
        what: &'static str,
        /// The name.
        name: String,
    },
    /// A joint names a link that is not there.
    #[error("joint {joint} names link {link}, which the URDF does not have")]
    UnknownLink {
        /// The joint.
        joint: String,
        /// The missing link.
        link: String,
    },
    /// A link has two parent joints.
    #[error("link {link} is the child of both {first} and {second}: a robot must be a tree")]
    TwoParents {
        /// The link.
        link: String,
        /// A joint.
        first: String,
        /// Another joint.
        second: String,
    },
    /// More than one link has no parent.
    #[error("{} links have no parent joint ({}): a robot must have one root", roots.len(), roots.join(", "))]
    ManyRoots {
        /// The links.
        roots: Vec<String>,
    },
    /// Links that hang on each other in a circle.
    #[error("links {} form a cycle that is not connected to a root", links.join(", "))]
    Cycle {
        /// The links.
        links: Vec<String>,
    },
    /// NaN or infinity where a number must be.
    #[error("{what} of {name} is not a finite number")]
    NotFinite {
        /// Which value.
        what: &'static str,
        /// Joint or link.
        name: String,
    },
    /// The axis has no direction.
    #[error("the axis of joint {joint} is zero")]
    ZeroAxis {
        /// The joint.
        joint: String,
    },
    /// Lower above upper, or a negative limit.
    #[error("the {what} limits of joint {joint} are not in order: {lower} … {upper}")]
    BadLimits {
        /// The joint.
        joint: String,
        /// `hard`, `soft`, `velocity` or `acceleration`.
        what: &'static str,
        /// Lower end.
        lower: f64,
        /// Upper end.
        upper: f64,
    },
    /// A mimic joint that follows nothing, itself or a circle.
    #[error("joint {joint} mimics {other}, {reason}")]
    BadMimic {
        /// The joint.
        joint: String,
        /// The joint that it names.
        other: String,
        /// What is wrong.
        reason: &'static str,
    },
    /// A collision shape without size.
    #[error("a collision shape of link {link} has a size that is not positive")]
    BadGeometry {
        /// The link.
        link: String,
    },
}

impl Robot {
    /// Reads a URDF file.
    ///
    /// # Errors
    /// When the file cannot be read or is not one proper kinematic tree; see [`UrdfError`].
    pub fn from_urdf_file(path: &Path) -> Result<Self, UrdfError> {
        let text = std::fs::read_to_string(path)
            .map_err(|source| UrdfError::Read { path: path.to_owned(), source })?;
        Self::from_urdf_str(&text)
    }

    /// Reads a URDF from text.
    ///
    /// # Errors
    /// When the text is not one proper kinematic tree; see [`UrdfError`].
    pub fn from_urdf_str(xml: &str) -> Result<Self, UrdfError> {
        let facts = joint_facts(xml).map_err(|reason| UrdfError::Parse { reason })?;
        let parsed = urdf_rs::read_from_string(xml)
            .map_err(|e| UrdfError::Parse { reason: e.to_string() })?;
        Ok(Self { model: Arc::new(build(&parsed, &facts)?) })
    }

    /// Name of the robot; may be empty.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.model.name
    }

    /// All links, in the order of the URDF.
    #[must_use]
    pub fn links(&self) -> &[Link] {
        &self.model.links
    }

    /// All joints, in the order of the URDF.
    #[must_use]
    pub fn joints(&self) -> &[Joint] {
        &self.model.joints
    }

    /// Index of the root link, whose frame is the root frame.
    #[must_use]
    pub fn root(&self) -> usize {
        self.model.root
    }

    /// Index of a link by name.
    #[must_use]
    pub fn link_index(&self, name: &str) -> Option<usize> {
        self.model.links.iter().position(|l| l.name == name)
    }
}

impl Joint {
    /// Whether the joint moves by itself: neither fixed nor following another.
    #[must_use]
    pub fn is_independent(&self) -> bool {
        self.kind != JointKind::Fixed && self.mimic.is_none()
    }
}

fn build(parsed: &urdf_rs::Robot, facts: &HashMap<String, JointFacts>) -> Result<Model, UrdfError> {
    let mut links = parsed.links.iter().map(read_link).collect::<Result<Vec<_>, _>>()?;
    if links.is_empty() {
        return Err(UrdfError::Empty);
    }
    let link_index = unique("link", links.iter().map(|l| l.name.as_str()))?;
    let joint_index = unique("joint", parsed.joints.iter().map(|j| j.name.as_str()))?;
    let no_facts = JointFacts::default();
    let mut joints = Vec::with_capacity(parsed.joints.len());
    for joint in &parsed.joints {
        let facts = facts.get(&joint.name).unwrap_or(&no_facts);
        joints.push(read_joint(joint, facts, &link_index, &joint_index)?);
    }
    for (index, joint) in joints.iter().enumerate() {
        check_mimic(&joints, index)?;
        if let Some(first) = links[joint.child].parent_joint.replace(index) {
            return Err(UrdfError::TwoParents {
                link: links[joint.child].name.clone(),
                first: joints[first].name.clone(),
                second: joint.name.clone(),
            });
        }
    }
    let (root, order) = walk(&links, &joints)?;
    drop(link_index);
    Ok(Model { name: parsed.name.clone(), links, joints, root, order })
}

/// Root and joints with parents before children, in the order of the URDF among siblings.
fn walk(links: &[Link], joints: &[Joint]) -> Result<(usize, Vec<usize>), UrdfError> {
    let name = |&i: &usize| links[i].name.clone();
    let roots: Vec<usize> = (0..links.len()).filter(|&i| links[i].parent_joint.is_none()).collect();
    if roots.len() > 1 {
        return Err(UrdfError::ManyRoots { roots: roots.iter().map(name).collect() });
    }
    let mut children = vec![Vec::new(); links.len()];
    for (index, joint) in joints.iter().enumerate() {
        children[joint.parent].push(index);
    }
    let mut reached = roots.iter().copied().collect::<HashSet<_>>();
    let mut order = Vec::with_capacity(joints.len());
    let mut queue = std::collections::VecDeque::from(roots.clone());
    while let Some(link) = queue.pop_front() {
        for &joint in &children[link] {
            order.push(joint);
            reached.insert(joints[joint].child);
            queue.push_back(joints[joint].child);
        }
    }
    let lost: Vec<usize> = (0..links.len()).filter(|i| !reached.contains(i)).collect();
    match roots.first() {
        Some(&root) if lost.is_empty() => Ok((root, order)),
        _ => Err(UrdfError::Cycle { links: lost.iter().map(name).collect() }),
    }
}

fn unique<'a>(
    what: &'static str,
    names: impl Iterator<Item = &'a str>,
) -> Result<HashMap<String, usize>, UrdfError> {
    let mut index = HashMap::new();
    for (i, name) in names.enumerate() {
        if index.insert(name.to_owned(), i).is_some() {
            return Err(UrdfError::DuplicateName { what, name: name.to_owned() });
        }
    }
    Ok(index)
}

fn read_link(link: &urdf_rs::Link) -> Result<Link, UrdfError> {
    let collisions = link
        .collision
        .iter()
        .map(|c| {
            let geometry = read_geometry(&c.geometry)
                .ok_or_else(|| UrdfError::BadGeometry { link: link.name.clone() })?;
            let (origin, _) = read_pose(&c.origin, &link.name)?;
            Ok(CollisionShape { origin, geometry })
        })
        .collect::<Result<_, UrdfError>>()?;
    Ok(Link { name: link.name.clone(), collisions, parent_joint: None })
}

/// `None` when a size is not a positive number.
fn read_geometry(geometry: &urdf_rs::Geometry) -> Option<Geometry> {
    let good = |v: f64| v.is_finite() && v > 0.0;
    Some(match geometry {
        urdf_rs::Geometry::Box { size } if size.iter().all(|&s| good(s)) => {
            Geometry::Box { half_extents: Vector3::from(size.0) * 0.5 }
        }
        urdf_rs::Geometry::Cylinder { radius, length } if good(*radius) && good(*length) => {
            Geometry::Cylinder { radius: *radius, half_length: length * 0.5 }
        }
        urdf_rs::Geometry::Capsule { radius, length } if good(*radius) && good(*length) => {
            Geometry::Capsule { radius: *radius, half_length: length * 0.5 }
        }
        urdf_rs::Geometry::Sphere { radius } if good(*radius) => {
            Geometry::Sphere { radius: *radius }
        }
        urdf_rs::Geometry::Mesh { filename, scale } => {
            let scale = scale.map_or(Vector3::repeat(1.0), |s| Vector3::from(s.0));
            if !scale.iter().all(|&s| s.is_finite() && s != 0.0) {
                return None;
            }
            Geometry::Mesh { uri: filename.clone(), scale }
        }
        _ => return None,
    })
}

fn read_pose(pose: &urdf_rs::Pose, name: &str) -> Result<(Isometry3<f64>, [f64; 6]), UrdfError> {
    let [x, y, z] = pose.xyz.0;
    let [roll, pitch, yaw] = pose.rpy.0;
    let text = [x, y, z, roll, pitch, yaw];
    if !text.iter().all(|v| v.is_finite()) {
        return Err(UrdfError::NotFinite { what: "origin", name: name.to_owned() });
    }
    let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    Ok((Isometry3::from_parts(Translation3::new(x, y, z), rotation), text))
}

fn read_joint(
    joint: &urdf_rs::Joint,
    facts: &JointFacts,
    links: &HashMap<String, usize>,
    joints: &HashMap<String, usize>,
) -> Result<Joint, UrdfError> {
    let name = joint.name.clone();
    let kind = match joint.joint_type {
        urdf_rs::JointType::Fixed => JointKind::Fixed,
        urdf_rs::JointType::Revolute => JointKind::Revolute,
        urdf_rs::JointType::Continuous => JointKind::Continuous,
        urdf_rs::JointType::Prismatic => JointKind::Prismatic,
        ref other => {
            let kind = format!("{other:?}").to_lowercase();
            return Err(UrdfError::UnsupportedJoint { joint: name, kind });
        }
    };
    let link = |link: &str| {
        links
            .get(link)
            .copied()
            .ok_or_else(|| UrdfError::UnknownLink { joint: name.clone(), link: link.to_owned() })
    };
    let (origin, origin_text) = read_pose(&joint.origin, &name)?;
    let mimic = match &joint.mimic {
        None => None,
        Some(mimic) => Some(Mimic {
            joint: *joints.get(&mimic.joint).ok_or_else(|| UrdfError::BadMimic {
                joint: name.clone(),
                other: mimic.joint.clone(),
                reason: "which the URDF does not have",
            })?,
            multiplier: finite(mimic.multiplier.unwrap_or(1.0), "mimic multiplier", &name)?,
            offset: finite(mimic.offset.unwrap_or(0.0), "mimic offset", &name)?,
        }),
    };
    Ok(Joint {
        kind,
        parent: link(&joint.parent.link)?,
        child: link(&joint.child.link)?,
        origin,
        axis: read_axis(joint, kind)?,
        limits: read_limits(joint, kind, facts)?,
        safety: read_safety(joint, kind, facts)?,
        mimic: mimic.filter(|_| kind != JointKind::Fixed),
        origin_text,
        name,
    })
}

fn read_axis(joint: &urdf_rs::Joint, kind: JointKind) -> Result<UnitVector3<f64>, UrdfError> {
    let axis = Vector3::from(joint.axis.xyz.0);
    if !axis.iter().all(|v| v.is_finite()) {
        return Err(UrdfError::NotFinite { what: "axis", name: joint.name.clone() });
    }
    match UnitVector3::try_new(axis, 1e-9) {
        Some(axis) => Ok(axis),
        // Some URDFs give fixed joints a zero axis; it is never used.
        None if kind == JointKind::Fixed => Ok(Vector3::x_axis()),
        None => Err(UrdfError::ZeroAxis { joint: joint.name.clone() }),
    }
}

fn read_limits(
    joint: &urdf_rs::Joint,
    kind: JointKind,
    facts: &JointFacts,
) -> Result<Option<HardLimits>, UrdfError> {
    if kind == JointKind::Fixed || !facts.has_limit {
        return Ok(None);
    }
    let limit = &joint.limit;
    let bounded = kind != JointKind::Continuous;
    if bounded && !facts.has_range {
        return Ok(None);
    }
    let (lower, upper) =
        if bounded { (limit.lower, limit.upper) } else { (f64::NEG_INFINITY, f64::INFINITY) };
    let bad =
        |what, lower, upper| UrdfError::BadLimits { joint: joint.name.clone(), what, lower, upper };
    if lower.is_nan() || upper.is_nan() || limit.velocity.is_nan() {
        return Err(UrdfError::NotFinite { what: "limit", name: joint.name.clone() });
    }
    if lower > upper {
        return Err(bad("hard", lower, upper));
    }
    if limit.velocity < 0.0 {
        return Err(bad("velocity", -limit.velocity, limit.velocity));
    }
    if let Some(a) = facts.acceleration
        && !(a > 0.0 && a.is_finite())
    {
        return Err(bad("acceleration", -a, a));
    }
    let (velocity, acceleration) = (limit.velocity, facts.acceleration);
    Ok(Some(HardLimits { lower, upper, velocity, acceleration }))
}

fn read_safety(
    joint: &urdf_rs::Joint,
    kind: JointKind,
    facts: &JointFacts,
) -> Result<Option<SafetyController>, UrdfError> {
    let Some(safety) = &joint.safety_controller else { return Ok(None) };
    let name = &joint.name;
    let lower = finite(safety.soft_lower_limit, "soft_lower_limit", name)?;
    let upper = finite(safety.soft_upper_limit, "soft_upper_limit", name)?;
    let k = finite(safety.k_position, "k_position", name)?;
    let soft = (facts.has_soft_range && kind != JointKind::Continuous).then_some((lower, upper));
    if let Some((lower, upper)) = soft
        && lower > upper
    {
        let joint = name.clone();
        return Err(UrdfError::BadLimits { joint, what: "soft", lower, upper });
    }
    let k_position = (facts.has_k_position && k > 0.0).then_some(k);
    Ok(Some(SafetyController { soft, k_position }))
}

fn finite(value: f64, what: &'static str, name: &str) -> Result<f64, UrdfError> {
    if value.is_finite() {
        Ok(value)
    } else {
        Err(UrdfError::NotFinite { what, name: name.to_owned() })
    }
}

/// A mimic joint must follow, in the end, a joint that moves by itself.
fn check_mimic(joints: &[Joint], start: usize) -> Result<(), UrdfError> {
    let mut index = start;
    for _ in 0..=joints.len() {
        let Some(mimic) = joints[index].mimic else {
            if index != start && joints[index].kind == JointKind::Fixed {
                break;
            }
            return Ok(());
        };
        index = mimic.joint;
    }
    let reason = if joints[index].kind == JointKind::Fixed {
        "which is fixed"
    } else {
        "which leads back to itself"
    };
    let (joint, other) = (joints[start].name.clone(), joints[index].name.clone());
    Err(UrdfError::BadMimic { joint, other, reason })
}
