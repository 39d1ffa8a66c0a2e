//! From what `urdf-rs` parsed to a checked tree.

use std::collections::{HashMap, HashSet, VecDeque};

use nalgebra::{Isometry3, Translation3, UnitQuaternion, UnitVector3, Vector3};

use super::error::UrdfError;
use super::model::{
    CollisionShape, Geometry, HardLimits, Joint, JointKind, Link, Mimic, Model, SafetyController,
};
use super::xml::JointFacts;

/// Checks names, numbers and the tree.
pub(super) fn build(
    parsed: &urdf_rs::Robot,
    facts: &HashMap<String, JointFacts>,
) -> Result<Model, UrdfError> {
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
    let mut queue = VecDeque::from(roots.clone());
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
    let solid = |c: &&urdf_rs::Collision| !is_empty(&c.geometry);
    let collisions: Vec<CollisionShape> = link
        .collision
        .iter()
        .filter(solid)
        .map(|c| {
            let geometry = read_geometry(&c.geometry)
                .ok_or_else(|| UrdfError::BadGeometry { link: link.name.clone() })?;
            let (origin, _) = read_pose(&c.origin, &link.name)?;
            Ok(CollisionShape { origin, geometry })
        })
        .collect::<Result<_, UrdfError>>()?;
    let empty_shapes = link.collision.len() - collisions.len();
    Ok(Link { name: link.name.clone(), collisions, empty_shapes, parent_joint: None })
}

/// Whether all sizes of a shape are 0: some programs write that for a link without a shape.
fn is_empty(geometry: &urdf_rs::Geometry) -> bool {
    match geometry {
        urdf_rs::Geometry::Box { size } => size.iter().all(|&s| s == 0.0),
        urdf_rs::Geometry::Cylinder { radius, length }
        | urdf_rs::Geometry::Capsule { radius, length } => *radius == 0.0 && *length == 0.0,
        urdf_rs::Geometry::Sphere { radius } => *radius == 0.0,
        urdf_rs::Geometry::Mesh { .. } => false,
    }
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
    let JointFacts { acceleration, jerk, .. } = *facts;
    for (what, most) in [("acceleration", acceleration), ("jerk", jerk)] {
        if let Some(most) = most.filter(|most| !(*most > 0.0 && most.is_finite())) {
            return Err(bad(what, -most, most));
        }
    }
    Ok(Some(HardLimits { lower, upper, velocity: limit.velocity, acceleration, jerk }))
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
