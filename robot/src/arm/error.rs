//! Why an arm could not be made or changed.

use crate::MAX_DOF;

/// Why an arm could not be made or changed.
#[derive(Debug, thiserror::Error)]
pub enum ArmError {
    /// The link is not in the URDF.
    #[error("no link {link} in robot {robot}; its links are: {}", known.join(", "))]
    UnknownLink {
        /// The link.
        link: String,
        /// The robot.
        robot: String,
        /// The links that there are.
        known: Vec<String>,
    },
    /// The tip does not hang on the base.
    #[error("link {tip} does not hang on link {base}: choose a base between the root and the tip")]
    NotAChain {
        /// The base link.
        base: String,
        /// The tip link.
        tip: String,
    },
    /// Nothing moves.
    #[error("no joint moves between {base} and {tip}")]
    NoJoints {
        /// The base link.
        base: String,
        /// The tip link.
        tip: String,
    },
    /// Too much moves.
    #[error(
        "{} joints move between the links ({}), at most {MAX_DOF} are supported: choose a base nearer to the tip",
        joints.len(),
        joints.join(", ")
    )]
    TooManyJoints {
        /// The joints.
        joints: Vec<String>,
    },
    /// A joint of the arm follows another joint.
    #[error("joint {joint} of the arm mimics another joint: parallel linkages are not supported")]
    MimicInChain {
        /// The joint.
        joint: String,
    },
    /// A joint of the arm has no usable limits.
    #[error(
        "joint {joint} of the arm has no usable <limit>: a velocity above 0 and, unless it is continuous, lower < upper are needed"
    )]
    NoLimits {
        /// The joint.
        joint: String,
    },
    /// A held joint that is not there.
    #[error("{joint} is not held by this arm; {}", held(known))]
    NotHeld {
        /// The joint.
        joint: String,
        /// The held joints.
        known: Vec<String>,
    },
    /// A position for a held joint outside its limits.
    #[error("{joint} cannot be held at {position}: its range is {lower} … {upper}")]
    HeldOutside {
        /// The joint.
        joint: String,
        /// The position. [rad or m]
        position: f64,
        /// Lower hard limit.
        lower: f64,
        /// Upper hard limit.
        upper: f64,
    },
}

/// Which joints an arm holds, in words.
fn held(known: &[String]) -> String {
    match known {
        [] => "all joints of the robot are the arm's own, none is held".into(),
        known => format!("held are: {}", known.join(", ")),
    }
}
