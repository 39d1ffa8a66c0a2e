//! Mock, executor and publisher as processes that really talk, each test under a root path of
//! its own. Nothing here asserts how fast anything is: these run on loaded machines too.

mod common;
mod follow;
mod kill;
mod mock;
mod program;
mod publish;
mod reject;
mod replan;
mod rig;
mod run;
mod twice;
