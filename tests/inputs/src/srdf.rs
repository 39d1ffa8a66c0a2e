//! An SRDF: its postures, and a check that leaves out its pairs.

use nullsweep_collision::{Exact, Options, group_states};
use nullsweep_robot::Tool;

use crate::arm::arm;
use crate::file;

pub(crate) fn run(bytes: &[u8]) -> bool {
    file::with(bytes, |path| {
        let states = group_states(path);
        let (robot, arm) = arm();
        let options = Options { srdf: Some(path.to_path_buf()), ..Options::default() };
        let check = Exact::new(robot, arm, &Tool::default(), &[], &[], &options);
        states.is_ok() && check.is_ok()
    })
}
