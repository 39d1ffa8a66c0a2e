//! What is to be planned.

use nullsweep_collision::Options;
use nullsweep_robot::{ArmSpec, JointVector, Tool};
use nullsweep_surface::PatchConfig;

use super::sizes;
use crate::plan::{Continues, CostKind, Method, Plan, PlanError, Profile};
use crate::roadmap::GraphConfig;
use crate::tour::formulation::FormulationConfig;
use crate::workcell::{Stance, StanceSearch};

/// What is to be planned.
#[derive(Clone, Debug)]
pub struct Job {
    /// Base and tip link of the arm.
    pub arm: ArmSpec,
    /// The tool at its tip.
    pub tool: Tool,
    /// Where the robot stands.
    pub stance: StanceChoice,
    /// Where the arm is; `None`: a posture that the SRDF names (home before others), else the middle
    /// of its ranges, or where it collides there the nearest free posture found. \[rad\] or \[m\]
    pub start: Option<JointVector>,
    /// Where the arm is left.
    pub end: End,
    /// A plan that this one goes on from.
    pub after: Option<After>,
    /// Points of the scene's surface that are none of this plan's: swept before, or another stop's.
    /// Empty: there are none.
    pub spared: Vec<bool>,
    /// How the order is found; `None`: by Curvature, Joint or Raster, whichever plan takes the least
    /// time of those that sweep about as much as Curvature's.
    pub method: Option<Method>,
    /// What is minimised.
    pub cost: CostKind,
    /// Values of the redundancy parameter at each tool pose, 1…; each gives a sample for every branch.
    /// Reach looks at no fewer than 24.
    pub ik_samples: usize,
    /// One velocity for all joints; `None`: the robot's limits. \[rad/s\]
    pub v_max: Option<f64>,
    /// How fast the plan goes along its path.
    pub profile: Profile,
    /// Jerk limits of a plan of [`Profile::Jerk`]; `None`: [`crate::timing::jerks`]. \[rad/s³\] or
    /// \[m/s³\]
    pub jerk: Option<JointVector>,
    /// The speed of the pad's centre on the surface, where the joints allow it; `None`: as fast as
    /// they do. Not at bang-bang velocity. \[m/s\]
    pub tool_speed: Option<f64>,
    /// Whether the pad's way on the surface is made fair, see [`crate::fairing`].
    pub smooth: bool,
    /// Patch extraction.
    pub patches: PatchConfig,
    /// Graph construction.
    pub graph: GraphConfig,
    /// Formulation.
    pub formulation: FormulationConfig,
    /// How often the plan is made again with patches over what it has not swept.
    pub refinements: usize,
    /// Collision margins and meshes.
    pub collision: Options,
    /// Seed of every random choice.
    pub seed: u64,
}

impl Job {
    /// The paper's setting for an arm: the default tool, the place where it reaches most, order by
    /// Curvature-GTSP, least time, 100 samples of the inverse kinematics, bang-bang velocity.
    #[must_use]
    pub fn new(arm: ArmSpec) -> Self {
        Self {
            arm,
            tool: Tool::default(),
            stance: StanceChoice::Auto,
            start: None,
            end: End::default(),
            after: None,
            spared: Vec::new(),
            method: Some(Method::Curvature),
            cost: CostKind::Time,
            ik_samples: 100,
            v_max: None,
            profile: Profile::Velocity,
            jerk: None,
            tool_speed: None,
            smooth: false,
            patches: PatchConfig::default(),
            graph: GraphConfig::default(),
            formulation: FormulationConfig::default(),
            refinements: 2,
            collision: Options::default(),
            seed: 1,
        }
    }

    /// With a tool, and the sizes and the speed that follow from it.
    #[must_use]
    pub fn with_tool(self, tool: Tool) -> Self {
        let (patches, graph) = (sizes::patches(&tool), sizes::graph(&tool));
        let tool_speed = tool.own_speed().or(self.tool_speed);
        Self { tool, patches, graph, tool_speed, ..self }
    }

    /// The speed at which the tool works as far as the joints allow it, for what is laid on by speed.
    /// \[m/s\]
    pub(super) fn working_speed(&self) -> f64 {
        self.tool_speed.or(self.tool.own_speed()).unwrap_or(1.0)
    }
}

/// Where the robot stands.
#[derive(Clone, Debug, PartialEq)]
pub enum StanceChoice {
    /// Where it reaches most, as [`StanceSearch::of`] looks for it.
    Auto,
    /// Here.
    Given(Stance),
    /// Where it reaches most of what is searched.
    Search(StanceSearch),
}

/// Where a plan leaves the arm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum End {
    /// With the tool lifted off the surface, so that the next plan, or the way home, starts free.
    #[default]
    Lifted,
    /// Where the plan began, so that it can run again.
    Start,
    /// In this posture. \[rad\] or \[m\]
    At(JointVector),
    /// On the surface, at the last stop.
    Contact,
}

/// The plan and the knot that a new plan goes on from.
#[derive(Clone, Debug, PartialEq)]
pub struct After {
    /// The other plan.
    pub plan: Plan,
    /// The new plan's start, or the last knot that was passed.
    pub knot: usize,
    /// Where the arm was stopped past that knot and is held: then the plan starts there. \[rad\] or
    /// \[m\]
    pub held: Option<JointVector>,
    /// Whether patches that the other plan, and those that led to it, have swept by then are swept
    /// again.
    pub again: bool,
}

impl After {
    /// What the new plan says of where it takes over; nothing where the arm is held.
    pub(super) fn continues(&self) -> Result<Option<Continues>, PlanError> {
        let passing = || {
            let digest = self.plan.digest()?;
            Ok(Continues { digest, knot: self.knot as u32 })
        };
        self.held.is_none().then(passing).transpose()
    }
}
