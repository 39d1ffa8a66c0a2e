//! Other work for the machine: stress-ng, ended with the run.

use std::io;
use std::process::{Child, Command, Stdio};

use anyhow::{Context, bail};

/// What it is asked for: every processor, memory that comes and goes (which interrupts all others),
/// switches of context, and timers.
pub(super) const WORK: [&str; 8] =
    ["--cpu", "0", "--vm", "1", "--vm-bytes", "64M", "--switch", "1"];

/// The running load; ended when this is dropped.
#[derive(Debug)]
pub(super) struct Load(Child);

impl Load {
    /// Starts it.
    pub(super) fn start() -> anyhow::Result<Self> {
        let mut command = Command::new("stress-ng");
        command.args(["--quiet"]).args(WORK);
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        match command.spawn() {
            Ok(child) => Ok(Self(child)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                bail!("--load needs stress-ng: install it, or leave the option out")
            }
            Err(error) => Err(error).context("stress-ng cannot be started"),
        }
    }
}

impl Drop for Load {
    fn drop(&mut self) {
        // SIGTERM lets it end its own children, which SIGKILL would leave behind.
        let id = i32::try_from(self.0.id()).ok().and_then(rustix::process::Pid::from_raw);
        if let Some(id) = id {
            let _ = rustix::process::kill_process(id, rustix::process::Signal::TERM);
        }
        let _ = self.0.wait();
    }
}
