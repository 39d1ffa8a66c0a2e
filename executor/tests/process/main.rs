//! The program as a process, against an endpoint in a thread of the test.

mod commands;
mod endurance;
mod log;
mod other_user;
mod plans;
mod recording;
mod replaced;
mod rig;
mod stop;
mod strangers;
