//! What another user of the machine is told.

use std::fs::{Permissions, set_permissions};
use std::os::unix::fs::PermissionsExt;
use std::process::{Command, Output};

use nullsweep_ipc_types::Mode;

use crate::rig::System;

/// The program as the user `nobody`; `None` where it cannot be started so.
fn as_nobody(arguments: &[&str]) -> Option<Output> {
    let mut command = Command::new("setpriv");
    command.args(["--reuid=65534", "--regid=65534", "--clear-groups"]);
    command.arg(env!("CARGO_BIN_EXE_executor")).args(arguments).output().ok()
}

#[test]
fn another_users_robot_is_told_as_that() {
    if !as_nobody(&["--version"]).is_some_and(|ended| ended.status.success()) {
        println!("skipped: only root can be another user, with setpriv and a program that it sees");
        return;
    }
    let system = System::start();
    let root = system.root.path();
    let here = root.to_str().unwrap();
    // A folder that others may look into, and one that they may not.
    for (mode, arguments) in [
        (0o755, ["ctl", "--ipc-root", here, "stop"].as_slice()),
        (0o755, &["run", "--ipc-root", here]),
        (0o700, &["ctl", "--ipc-root", here, "stop"]),
    ] {
        set_permissions(root, Permissions::from_mode(mode)).unwrap();
        let ended = as_nobody(arguments).unwrap();
        let text = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(1), "{text}");
        let owner = format!("another user's robot or folder: {here} belongs to root (uid 0), ");
        assert!(text.contains(&owner), "{text}");
        assert!(text.contains("uid 65534) (") && text.contains("run every process as"), "{text}");
    }
    // Nobody could do anything to it.
    system.wait_for(Mode::Hold);
    system.end();
}
