//! Which executor is meant.

use std::path::Path;

/// Where the executor is.
#[derive(Clone, Copy, Debug)]
pub struct Site<'a> {
    /// The robot's name in the services' names.
    pub robot: &'a str,
    /// Root path of iceoryx2, `None` for the default.
    pub root: Option<&'a Path>,
}
