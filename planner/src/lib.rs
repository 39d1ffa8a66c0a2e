//! The offline planner of Nullsweep: a scan becomes a verified joint-space coverage plan.
//!
//! A [`Scene`] (what was scanned, and what else is there), a [`Robot`] and a [`Job`] (which arm, by
//! which cost, how fast) go into [`run`]; an [`Outcome`] with a [`Plan`] and its [`Figures`] comes
//! out. The plan may be published where `figures.verification.violations` is empty.
//!
//! ```no_run
//! use nullsweep_planner::surface::{CleanConfig, Placement, ReadOptions, place, read};
//! use nullsweep_planner::{ArmSpec, Job, Robot, Scene, Side, Silent, run};
//!
//! let raw = read("chair.pcd".as_ref(), &ReadOptions::default())?;
//! let up = -nalgebra::Vector3::y_axis();
//! let placement = Placement::UpAndHeight { up, sensor_height: 0.83, support_height: 0.0 };
//! let (scene, _) = Scene::seen(&place(&raw, &placement).0, None, &CleanConfig::default())?;
//! let job = Job::new(ArmSpec::pr2(Side::Right));
//! let outcome = run(&Robot::pr2(), &scene, &job, &Silent)?;
//! assert!(outcome.figures.verification.violations.is_empty());
//! outcome.plan.write("plan.json".as_ref())?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The modules are storeys: each imports only those above it in this list, and is a function from
//! one plain type to the next. Each can be called alone.

mod band;
pub mod cost;
pub mod cover;
pub mod progress;
pub mod regions;

pub mod workcell;

pub mod plan;

pub mod roadmap;
pub mod sweep;

pub mod coordinate;
pub mod fairing;
pub mod motion;
pub mod timing;
pub mod tour;

pub mod verify;

pub mod link;
pub mod poses;

pub mod bounds;
pub mod follow;
pub mod pipeline;
pub mod stops;
pub mod task;
pub mod transit;

pub use nullsweep_collision as collision;
pub use nullsweep_robot as robot;
pub use nullsweep_surface as surface;

pub use collision::Obstacle;
pub use link::publish::{Join, Patience, PublishError, publish};
pub use pipeline::{After, End, Figures, Job, Outcome, PipelineError, StanceChoice, run};
pub use plan::{CostKind, Method, Plan, PlanError, Profile};
pub use progress::{Progress, Silent};
pub use robot::{ArmSpec, JointVector, Robot, Side, Tool};
pub use verify::{Given, Verification, VerifyError, Violation, ViolationKind, verify};
pub use workcell::{Scene, Stance, StanceSearch};
