//! What the planner's choices are called on the command line.

use clap::ValueEnum;
use nullsweep_planner::link::publish::Join;
use nullsweep_planner::plan::export::Format;
use nullsweep_planner::plan::{CostKind, Method, Profile};
use nullsweep_robot::Tool;

/// An argument's values, and the library's choices that they stand for.
macro_rules! choices {
    ($(#[$about:meta])* $name:ident for $of:ident { $($(#[$help:meta])* $value:ident,)* }) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
        pub enum $name { $($(#[$help])* $value,)* }

        impl From<$name> for $of {
            fn from(choice: $name) -> Self {
                match choice { $($name::$value => Self::$value,)* }
            }
        }
    };
}

choices! {
    /// What is minimised.
    CostArg for CostKind {
        /// The sum of all joint displacements (Eq. 1).
        Effort,
        /// The time that the slowest joint takes (Eq. 2).
        Time,
    }
}

choices! {
    /// How fast a plan goes along its path.
    ProfileArg for Profile {
        /// Every straight segment as fast as its slowest joint allows: bang-bang velocity, as in
        /// the paper. Joints change their speed at once, so a real arm lags.
        Velocity,
        /// As fast as velocity and acceleration allow, corners blended.
        Acceleration,
        /// As fast as velocity, acceleration and jerk allow, corners blended.
        Jerk,
    }
}

choices! {
    /// How a plan joins what is going on.
    JoinArg for Join {
        /// Stop on the running plan's path, then start.
        Stop,
        /// Start after the running plan.
        After,
        /// Start in the knot that the plan was made for.
        Knot,
    }
}

choices! {
    /// How a trajectory is written.
    FormatArg for Format {
        /// As `rostopic pub -f` reads it.
        RosYaml,
        /// As `ros2 topic pub` takes it.
        Ros2Yaml,
        /// A line a knot: time, positions, velocities, patch, whether the pad is on the surface.
        Csv,
        /// The message's fields by their names.
        Json,
    }
}

/// How the order is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum MethodArg {
    /// Shortest Euclidean tour; the headings follow from it.
    Tsp,
    /// A node for each patch and incident edge; distance and turning are weighed (Eq. 4).
    Curvature,
    /// A node for each patch, incident edge and sample of the inverse kinematics; the cost of
    /// the joint motion is weighed (Eq. 1-3).
    Joint,
    /// Strips side by side, the pad across them, in place of the patches.
    Raster,
    /// Curvature, joint or raster: the plan that takes the least time of those that sweep as much.
    Best,
}

impl MethodArg {
    /// The method that is asked for, or that suits the tool.
    #[must_use]
    pub fn suiting(asked: Option<Self>, tool: &Tool) -> Option<Method> {
        let in_strips = tool.rolls() || tool.own_speed().is_some();
        let own = if in_strips { Method::Raster } else { Method::Curvature };
        asked.map_or(Some(own), Self::method)
    }

    /// The method; `None`: the best one.
    #[must_use]
    pub fn method(self) -> Option<Method> {
        match self {
            Self::Tsp => Some(Method::Tsp),
            Self::Curvature => Some(Method::Curvature),
            Self::Joint => Some(Method::Joint),
            Self::Raster => Some(Method::Raster),
            Self::Best => None,
        }
    }
}

/// Whether the pad's way on the surface is made fair.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum SmoothArg {
    /// Where corners cost time: not at bang-bang velocity.
    Auto,
    /// A fair curve.
    On,
    /// From patch to patch, in lines.
    Off,
}

impl SmoothArg {
    /// Whether a plan of some profile is to be made fair.
    #[must_use]
    pub(crate) fn with(self, profile: Profile) -> bool {
        match self {
            Self::Auto => profile != Profile::Velocity,
            Self::On => true,
            Self::Off => false,
        }
    }
}
