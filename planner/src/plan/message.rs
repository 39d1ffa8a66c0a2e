//! A plan as it goes over the wire.

use nullsweep_ipc_types::{
    Contact, Interpolation, Knot, MAX_HELD_JOINTS, MAX_JOINTS, MAX_KNOTS, PlanHeader, PlanMessage,
    checksum,
};
use nullsweep_robot::MAX_DOF;

use super::error::PlanError;
use super::file::Plan;
use super::knot::PlanKnot;
use super::settings::Profile;

impl Plan {
    /// A checksum of what the executor is asked to do: the same for the same motion.
    ///
    /// # Errors
    /// As [`Self::message_parts`].
    pub fn digest(&self) -> Result<u64, PlanError> {
        Ok(self.message_parts()?.0.checksum)
    }

    /// The plan as it goes over the wire, without id and join rule, its checksum set.
    ///
    /// # Errors
    /// [`PlanError::TooLong`] and [`PlanError::TooManyHeld`].
    pub fn message_parts(&self) -> Result<(PlanHeader, Vec<Knot>), PlanError> {
        if self.knots.len() > MAX_KNOTS {
            return Err(PlanError::TooLong { found: self.knots.len() });
        }
        if self.held.len() > MAX_HELD_JOINTS {
            return Err(PlanError::TooManyHeld { found: self.held.len() });
        }
        let knots: Vec<Knot> =
            (0..self.knots.len()).map(|k| self.knots[k].wire(self.on_surface(k))).collect();
        let pose = self.base_pose();
        let (t, r) = (pose.translation.vector, pose.rotation.coords);
        let tool = serde_json::to_vec(&self.tool).unwrap_or_default();
        let mut header = PlanHeader {
            fingerprint: self.fingerprint,
            tool: xxhash_rust::xxh3::xxh3_64(&tool),
            base_pose: [t.x, t.y, t.z, r.x, r.y, r.z, r.w],
            held_count: self.held.len() as u32,
            joint_count: self.joints.len() as u32,
            knot_count: knots.len() as u32,
            interpolation: match self.profile {
                Profile::Velocity => Interpolation::Linear.wire(),
                Profile::Acceleration | Profile::Jerk => Interpolation::Cubic.wire(),
            },
            corners: u32::from(self.profile == Profile::Velocity),
            ..PlanHeader::default()
        };
        for (slot, held) in header.held_positions.iter_mut().zip(&self.held) {
            *slot = held.position;
        }
        header.checksum = checksum(PlanMessage { header: &header, knots: &knots });
        Ok((header, knots))
    }
}

impl PlanKnot {
    fn wire(&self, on_surface: bool) -> Knot {
        let mut positions = [0.0; MAX_JOINTS];
        positions[..MAX_DOF].copy_from_slice(&self.q[..]);
        let mut velocities = [0.0; MAX_JOINTS];
        velocities[..MAX_DOF].copy_from_slice(&self.v[..]);
        let contact = if on_surface { Contact::Contact } else { Contact::Transfer };
        Knot {
            time_from_start_ns: self.time_ns,
            positions,
            velocities,
            patch: self.patch.unwrap_or(Knot::NO_PATCH),
            contact: contact.wire(),
        }
    }
}
