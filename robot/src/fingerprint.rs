//! 64 bits that name a robot's kinematics and an arm of it.

use xxhash_rust::xxh3::Xxh3;

use crate::spec::ArmSpec;
use crate::urdf::{Joint, JointKind, Model};

/// Version of the canonical form below; part of the hash.
const FORM: u32 = 1;

/// XXH3 of everything kinematic in a canonical form, and of the arm's base and tip.
///
/// Joints go in by name, so their order in the file does not matter; numbers go in as written in
/// the URDF (xyz and rpy, not a quaternion), so no mathematics library can change a bit. Visual
/// and collision geometry, inertias and accelerations are left out.
pub(crate) fn fingerprint(model: &Model, spec: &ArmSpec) -> u64 {
    let mut hash = Xxh3::new();
    hash.update(&FORM.to_le_bytes());
    let mut joints: Vec<&Joint> = model.joints.iter().collect();
    joints.sort_by(|a, b| a.name.cmp(&b.name));
    for joint in joints {
        put_text(&mut hash, &joint.name);
        put_text(&mut hash, &model.links[joint.parent].name);
        put_text(&mut hash, &model.links[joint.child].name);
        put_numbers(&mut hash, &joint.origin_text);
        hash.update(&[match joint.kind {
            JointKind::Fixed => 0,
            JointKind::Revolute => 1,
            JointKind::Continuous => 2,
            JointKind::Prismatic => 3,
        }]);
        if joint.kind == JointKind::Fixed {
            continue;
        }
        put_numbers(&mut hash, joint.axis.as_slice());
        put_optional(&mut hash, joint.limits.map(|l| [l.lower, l.upper, l.velocity]));
        put_optional(&mut hash, joint.safety.and_then(|s| s.soft).map(|(l, u)| [l, u]));
        put_optional(&mut hash, joint.safety.and_then(|s| s.k_position).map(|k| [k]));
        put_optional(&mut hash, joint.mimic.map(|m| [m.multiplier, m.offset]));
        if let Some(mimic) = joint.mimic {
            put_text(&mut hash, &model.joints[mimic.joint].name);
        }
    }
    put_text(&mut hash, &spec.base);
    put_text(&mut hash, &spec.tip);
    hash.digest()
}

fn put_text(hash: &mut Xxh3, text: &str) {
    hash.update(&(text.len() as u64).to_le_bytes());
    hash.update(text.as_bytes());
}

fn put_numbers(hash: &mut Xxh3, numbers: &[f64]) {
    for number in numbers {
        // −0 and 0 are one number.
        hash.update(&(number + 0.0).to_bits().to_le_bytes());
    }
}

fn put_optional<const N: usize>(hash: &mut Xxh3, numbers: Option<[f64; N]>) {
    hash.update(&[u8::from(numbers.is_some())]);
    put_numbers(hash, numbers.as_ref().map_or(&[], |n| n.as_slice()));
}
