//! From a scene to a verified plan.

mod assemble;
mod attempt;
mod choice;
mod clock;
mod completion;
mod elsewhere;
mod end;
mod error;
mod figures;
mod idle;
mod job;
mod joint_order;
mod left_out;
mod longer;
mod other;
mod pruned;
mod rastered;
mod rounds;
mod run;
mod setting;
pub mod sizes;
mod start;
mod stick;
mod swept;

pub use attempt::Visit;
pub use error::PipelineError;
pub use figures::Figures;
pub use idle::idle;
pub use job::{After, End, Job, StanceChoice};
pub use left_out::{LeftOut, missed_by};
pub use longer::Longer;
pub use other::FreeFrom;
pub use rounds::RoundFigures;
pub use run::{Outcome, patches_of, run};
pub use swept::is_swept;
