//! Which robot's system a command line means.

use std::path::PathBuf;

use clap::Args;
use nullsweep_ipc_types::service;

/// The robot and the folder of its services.
#[derive(Clone, Debug, Args)]
pub(crate) struct SystemArgs {
    /// The robot's name in the services' names.
    #[arg(long, global = true, value_name = "NAME", default_value = service::DEFAULT_ROBOT)]
    pub(crate) robot_name: String,
    /// Folder that isolates this system from others on the machine.
    #[arg(long, global = true, value_name = "FOLDER")]
    pub(crate) ipc_root: Option<PathBuf>,
}
