//! Which executor a command speaks to.

use std::path::PathBuf;

use clap::Args;
use nullsweep_ipc_types::service::DEFAULT_ROBOT;
use nullsweep_planner::link::Site;

#[derive(Debug, Args)]
pub(super) struct SiteArgs {
    /// The robot's name in the service names.
    #[arg(long, value_name = "NAME", default_value = DEFAULT_ROBOT)]
    robot_name: String,
    /// iceoryx2's root path, if not the default.
    #[arg(long, value_name = "FOLDER")]
    ipc_root: Option<PathBuf>,
}

impl SiteArgs {
    pub(super) fn site(&self) -> Site<'_> {
        Site { robot: &self.robot_name, root: self.ipc_root.as_deref() }
    }
}
