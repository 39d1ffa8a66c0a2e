//! The joint vectors that meet a pose within its tolerance.

use nalgebra::{Isometry3, Matrix6, Point3, SMatrix, UnitQuaternion, Vector3, Vector6};
use nullsweep_collision::{ToolContact, World};
use nullsweep_robot::{Arm, Jacobian, JointVector, MAX_DOF, Tool, damped_step, wrap};

use super::tolerance::Tolerance;
use crate::sweep::distance_to_segment;

/// The arm, its tool and its tolerances.
#[derive(Clone, Copy)]
pub(crate) struct Space<'a> {
    pub(crate) arm: &'a Arm,
    pub(crate) world: &'a World,
    pub(crate) tolerance: &'a Tolerance,
    contact_in_tip: Isometry3<f64>,
}

/// A joint vector and where it puts the tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Point {
    pub(crate) q: JointVector,
    pub(crate) tool: Isometry3<f64>,
}

/// Largest error of a met pose beyond its tolerance. \[m\] or \[rad\]
pub(crate) const RESIDUAL: f64 = 1e-7;
/// Steps of a projection.
const STEPS: usize = 24;
/// Longest step of a joint in a projection. \[rad\]
const STRIDE: f64 = 0.4;
/// Damping near singularities.
const DAMPING: f64 = 1e-7;

/// Damping of the null space's projector.
const SINGULAR: f64 = 1e-9;

/// From here on two configurations are different postures: no edge joins them. The measures of the
/// arm-coverage planner of Wang and Gleicher (ICRA 2025).
const JOINT_JUMP: f64 = 1.0;
const TOOL_JUMP: f64 = 0.2;
const TURN_JUMP: f64 = 0.5;
const LINE_JUMP: f64 = 0.1;
/// Shorter motions stay near the tool's line whatever the arm. \[rad\]
const SHORT: f64 = 0.4;

impl<'a> Space<'a> {
    pub(crate) fn new(
        arm: &'a Arm,
        world: &'a World,
        tool: &Tool,
        tolerance: &'a Tolerance,
    ) -> Self {
        Self { arm, world, tolerance, contact_in_tip: tool.contact_in_tip() }
    }

    pub(crate) fn point(&self, q: JointVector) -> Point {
        Point { q, tool: self.arm.tip_pose(&q) * self.contact_in_tip }
    }

    /// Where the tip is when the tool is at a pose, turned about its own axis. \[rad\]
    pub(crate) fn tip_at(&self, pose: &Isometry3<f64>, turn: f64) -> Isometry3<f64> {
        let spin = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn);
        pose * spin * self.contact_in_tip.inverse()
    }

    /// How far the tool is beyond the tolerance, along and about the pose's axes.
    pub(crate) fn excess(&self, pose: &Isometry3<f64>, tool: &Isometry3<f64>) -> Vector6<f64> {
        let off = deviation(pose, tool);
        let met = self.tolerance.nearest(&off);
        Vector6::from_fn(|k, _| off[k] - met[k])
    }

    /// A joint vector near `q` that meets the pose inside the margined limits: Newton steps of
    /// least norm onto what is exceeded.
    pub(crate) fn project(&self, pose: &Isometry3<f64>, q: &JointVector) -> Option<Point> {
        let mut q = *q;
        self.clamp(&mut q);
        for _ in 0..STEPS {
            let (tip, mut jacobian) = self.arm.tip_pose_and_jacobian(&q);
            let tool = tip * self.contact_in_tip;
            let excess = self.excess(pose, &tool);
            if excess.amax() < RESIDUAL {
                return Some(Point { q, tool });
            }
            self.turn_to_pose(pose, &tip, &tool, &mut jacobian);
            self.step(&excess, jacobian, &mut q)?;
        }
        None
    }

    /// As [`Self::project`], with the tool on the pose itself: only what may turn freely about its axis
    /// still may.
    pub(crate) fn on_line(&self, pose: &Isometry3<f64>, q: &JointVector) -> Option<Point> {
        let spin = self.tolerance.0[5];
        let exact =
            Tolerance([0.0, 0.0, 0.0, 0.0, 0.0, if spin > 0.0 { f64::INFINITY } else { 0.0 }]);
        Space { tolerance: &exact, ..*self }.project(pose, q)
    }

    /// [`Self::project`] without collision of the arm with itself or with what is around it.
    pub(crate) fn project_free(&self, pose: &Isometry3<f64>, q: &JointVector) -> Option<Point> {
        self.project(pose, q).filter(|point| self.is_free(point))
    }

    /// Whether the arm collides neither with itself nor with what is around it.
    pub(crate) fn is_free(&self, point: &Point) -> bool {
        self.world.is_free(&point.q, ToolContact::Allowed)
    }

    /// The projector onto the joint motions that keep the tool where it meets a pose, as far as its
    /// tolerance does not leave it free.
    pub(crate) fn null_space(&self, pose: &Isometry3<f64>, at: &Point) -> SMatrix<f64, 8, 8> {
        let (tip, mut jacobian) = self.arm.tip_pose_and_jacobian(&at.q);
        self.turn_to_pose(pose, &tip, &at.tool, &mut jacobian);
        for (mut row, tolerance) in jacobian.row_iter_mut().zip(self.tolerance.0) {
            if tolerance > 0.0 {
                row.fill(0.0);
            }
        }
        let square = jacobian * jacobian.transpose() + Matrix6::identity() * SINGULAR;
        let identity = SMatrix::identity();
        square
            .cholesky()
            .map_or(identity, |square| identity - jacobian.transpose() * square.solve(&jacobian))
    }

    /// Turns the tip's Jacobian into that of the tool's deviation, near enough for small tilts.
    fn turn_to_pose(
        &self,
        pose: &Isometry3<f64>,
        tip: &Isometry3<f64>,
        tool: &Isometry3<f64>,
        jacobian: &mut Jacobian,
    ) {
        let lever = tool.translation.vector - tip.translation.vector;
        let to_pose = pose.rotation.inverse();
        for mut column in jacobian.column_iter_mut() {
            let angular: Vector3<f64> = column.fixed_rows::<3>(3).into();
            let linear: Vector3<f64> = column.fixed_rows::<3>(0) + angular.cross(&lever);
            column.fixed_rows_mut::<3>(0).copy_from(&(to_pose * linear));
            column.fixed_rows_mut::<3>(3).copy_from(&(to_pose * angular));
        }
    }

    /// A step of least norm that takes the excess away; joints at a limit stay there, and the
    /// others step again without them.
    fn step(
        &self,
        excess: &Vector6<f64>,
        mut jacobian: Jacobian,
        q: &mut JointVector,
    ) -> Option<()> {
        for (k, mut row) in jacobian.row_iter_mut().enumerate() {
            if excess[k] == 0.0 {
                row.fill(0.0);
            }
        }
        let start = *q;
        let limits = self.arm.margined_limits();
        for _ in 0..3 {
            let step = damped_step(&jacobian, &-excess, DAMPING)?;
            let largest = step.iter().fold(0.0, |most: f64, s| most.max(s.abs()));
            let scale = (STRIDE / largest).min(1.0);
            let mut stopped = false;
            for (i, &(lower, upper)) in limits.iter().enumerate() {
                let to = start[i] + scale * step[i];
                q[i] = to.clamp(lower, upper);
                if to != q[i] {
                    stopped = true;
                    jacobian.column_mut(i).fill(0.0);
                }
            }
            if !stopped {
                break;
            }
        }
        Some(())
    }

    fn clamp(&self, q: &mut JointVector) {
        for (q, &(lower, upper)) in q.iter_mut().zip(self.arm.margined_limits()) {
            *q = q.clamp(lower, upper);
        }
    }

    /// Whether the straight joint motion from one to the other is a change of posture rather than
    /// an edge along the tool's path.
    pub(crate) fn is_reconfiguration(&self, a: &Point, b: &Point) -> bool {
        let farthest = (0..MAX_DOF).map(|j| (b.q[j] - a.q[j]).abs()).fold(0.0, f64::max);
        if farthest > JOINT_JUMP {
            return true;
        }
        let shift = b.tool.translation.vector - a.tool.translation.vector;
        if shift.norm() > TOOL_JUMP || a.tool.rotation.angle_to(&b.tool.rotation) > TURN_JUMP {
            return true;
        }
        a.q.distance(&b.q) > SHORT && self.deviation_at(a, b, 0.5) > LINE_JUMP
    }

    /// How far the tool is from the straight line between its places at both ends, `share` of the
    /// way along the straight joint motion. \[m\]
    pub(crate) fn deviation_at(&self, a: &Point, b: &Point, share: f64) -> f64 {
        let at = |point: &Point| Point3::from(point.tool.translation.vector);
        distance_to_segment(&at(&self.point(a.q.lerp(&b.q, share))), &at(a), &at(b))
    }
}

/// The tool seen from the pose: x, y, z \[m\], the tilt of its z axis about x and y and its turn
/// about z \[rad\].
fn deviation(pose: &Isometry3<f64>, tool: &Isometry3<f64>) -> [f64; 6] {
    let off = pose.inverse() * tool;
    let axis = off.rotation * Vector3::z();
    let sine = libm::hypot(axis.x, axis.y);
    let tilt = libm::atan2(sine, axis.z);
    // The tilt turns z into the axis, about z × axis; half a turn goes about any axis.
    let (share, x) = match sine > 1e-12 {
        true => (tilt / sine, -axis.y),
        false => (1.0, tilt),
    };
    let turn = 2.0 * libm::atan2(off.rotation.k, off.rotation.w);
    let turn = wrap(turn);
    let t = off.translation.vector;
    [t.x, t.y, t.z, x * share, axis.x * share, turn]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deviations_are_seen_from_the_pose() {
        let pose = Isometry3::new(Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.3, -0.4, 0.5));
        let z = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 2.0);
        let tilt = UnitQuaternion::from_scaled_axis(Vector3::new(0.1, -0.2, 0.0));
        let off = Isometry3::from_parts(Vector3::new(0.01, 0.02, -0.03).into(), tilt * z);
        let found = deviation(&pose, &(pose * off));
        for (found, wanted) in found.iter().zip([0.01, 0.02, -0.03, 0.1, -0.2, 2.0]) {
            assert!((found - wanted).abs() < 1e-12, "{found} {wanted}");
        }
    }
}
