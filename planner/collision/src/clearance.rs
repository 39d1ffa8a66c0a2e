//! How much room there is at a joint vector, as a figure: for pictures, not for any decision.

use nalgebra::Point3;
use nullsweep_robot::JointVector;
use parry3d_f64::bounding_volume::BoundingVolume;
use parry3d_f64::math::Vec3;

use crate::exact::{Exact, signed_distance};
use crate::shapes::{distance, pose, poses};

/// Least distances of what moves with the arm from points and obstacles around it. \[m\]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearance {
    /// Of the arm without its hand.
    pub arm: f64,
    /// Of what is rigid to the tip, but for the pad.
    pub hand: f64,
}

impl Exact {
    /// The clearance at a joint vector \[rad\] or \[m\]; what is farther than `reach` \[m\] counts
    /// as that, and so is what a link stands on that meets it in every posture: it is not checked either.
    #[must_use]
    pub fn clearance(&self, q: &JointVector, reach: f64) -> Clearance {
        let scene = self.scene();
        let poses = poses(&scene.parts, scene.links, self.arm(), q);
        let mut least = vec![reach; poses.len()];
        for i in (0..poses.len()).filter(|&i| scene.moves[i] && !scene.parts[i].is_pad) {
            let shape = &*scene.parts[i].shape;
            for (index, obstacle) in scene.obstacles.iter().enumerate() {
                if scene.grounded.contains(&(i, index)) {
                    continue;
                }
                let at = pose(&obstacle.pose);
                least[i] = least[i].min(distance(&poses[i], shape, &at, &*obstacle.shape));
            }
            let bounds = shape.compute_aabb(&poses[i]).loosened(least[i]);
            let corner = |v: Vec3| Point3::new(v.x, v.y, v.z);
            let nearest = &mut least[i];
            let _: Option<()> = self.tree().find(&corner(bounds.mins), &corner(bounds.maxs), |p| {
                let found = signed_distance(shape, &poses[i], &scene.points.points[p]);
                *nearest = nearest.min(found);
                None
            });
        }
        let of = |hand: bool| {
            (0..poses.len())
                .filter(|&i| scene.moves[i] && !scene.parts[i].is_pad && scene.at_tip[i] == hand)
                .map(|i| least[i])
                .fold(reach, f64::min)
        };
        Clearance { arm: of(false), hand: of(true) }
    }
}

#[cfg(test)]
mod tests {
    use nullsweep_robot::{ArmSpec, Robot, Side, Tool};

    use super::*;
    use crate::{Options, ToolContact};

    #[test]
    fn the_clearance_is_the_distance_to_the_nearest_point_on_either_side_of_the_margin() {
        let robot = Robot::pr2();
        let arm = robot.arm(&ArmSpec::pr2(Side::Right)).unwrap();
        let (tool, options) = (Tool::default(), Options::default());
        let q = arm.home();
        let exact = |points: &[Point3<f64>]| {
            Exact::new(&robot, &arm, &tool, points, &[], &options).unwrap()
        };
        let alone = exact(&[]).clearance(&q, 10.0);
        assert_eq!(alone, Clearance { arm: 10.0, hand: 10.0 });
        // A point above the elbow comes nearer until the check calls it a collision: there the
        // clearance is the margin.
        let elbow = robot.links().iter().position(|l| l.name == "r_elbow_flex_link").unwrap();
        let mut links = vec![nalgebra::Isometry3::identity(); robot.links().len()];
        arm.link_poses(&q, &mut links);
        let middle = Point3::from(links[elbow].translation.vector);
        let above = |height: f64| exact(&[middle + nalgebra::Vector3::z() * height]);
        let (mut free, mut hit) = (1.0, 0.0);
        for _ in 0..40 {
            let half = 0.5 * (free + hit);
            if above(half).is_free(&q, ToolContact::Forbidden) { free = half } else { hit = half }
        }
        let found = above(free).clearance(&q, 0.3).arm;
        let margin = options.margins.environment;
        assert!((found - margin).abs() < 1e-6, "{found} at the margin of {margin}");
        assert!((above(free + 0.01).clearance(&q, 0.3).arm - found) > 1e-3);
    }
}
