//! What another user of the machine can do to a robot's files, tried: to look into them, to spoil
//! them, to put some of its own among them, to signal the process. docs/security.md says the rest.

use std::fs::{Permissions, set_permissions};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use nullsweep_ipc_types::{CommandKind, Mode, Verdict};

use crate::rig::System;

/// A shell as the user `nobody`: what it says; `None` where it cannot be started so.
fn nobody(script: &str, arguments: &[&Path]) -> Option<String> {
    let mut command = Command::new("setpriv");
    command.args(["--reuid=65534", "--regid=65534", "--clear-groups", "sh", "-c", script, "sh"]);
    let ended = command.args(arguments).output().ok()?;
    let said = String::from_utf8_lossy(&ended.stdout).into_owned();
    ended.status.success().then_some(said)
}

/// What is tried with each file; whatever succeeds is said. A file that is gone was the executor's
/// to remove.
const FILE: &str = r#"for file in "$@"; do
    [ -e "$file" ] || continue
    head -c 1 "$file" >/dev/null 2>&1 && [ -f "$file" ] && echo "read $file"
    (printf x >>"$file") 2>/dev/null && echo "written $file"
    (: >"$file") 2>/dev/null && echo "emptied $file"
    mv "$file" "$file.moved" 2>/dev/null && echo "moved $file"
    rm -f "$file" 2>/dev/null && [ ! -e "$file" ] && echo "removed $file"
    chmod 777 "$file" 2>/dev/null && echo "opened $file"
done; true"#;

/// What is tried with each folder.
const FOLDER: &str = r#"for folder in "$@"; do
    (: >"$folder/stranger") 2>/dev/null && echo "entered $folder"
    mkdir "$folder/strangers" 2>/dev/null && echo "settled in $folder"
    ln -s /dev/null "$folder/link" 2>/dev/null && echo "linked in $folder"
done; true"#;

/// Everything below a folder: files, and folders with itself.
fn below(folder: &Path) -> (Vec<PathBuf>, Vec<PathBuf>) {
    let (mut files, mut folders) = (Vec::new(), vec![folder.to_path_buf()]);
    let mut next = 0;
    while let Some(folder) = folders.get(next).cloned() {
        next += 1;
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            let is_folder = entry.file_type().is_ok_and(|kind| kind.is_dir());
            if is_folder { &mut folders } else { &mut files }.push(entry.path());
        }
    }
    (files, folders)
}

/// The segments that appeared in `/dev/shm` since.
fn segments() -> Vec<PathBuf> {
    below(Path::new("/dev/shm")).0
}

#[test]
fn another_user_can_do_nothing_to_a_robots_files() {
    if nobody("true", &[]).is_none() {
        println!("skipped: only root can be another user, with setpriv");
        return;
    }
    let before = segments();
    let system = System::start();
    let root = system.root.path();
    // Others may look into the folder: the least that keeps them out is asked for.
    set_permissions(root, Permissions::from_mode(0o755)).unwrap();
    let (mut files, folders) = below(root);
    // Of this system alone: others that run at the same time have other prefixes.
    let prefix = files
        .iter()
        .find_map(|file| {
            Some(file.file_name()?.to_str()?.strip_prefix("nsw_")?.get(..8)?.to_owned())
        })
        .expect("its files have its prefix");
    let own = |segment: &PathBuf| segment.to_string_lossy().contains(&prefix);
    let own: Vec<PathBuf> =
        segments().into_iter().filter(|s| !before.contains(s) && own(s)).collect();
    assert!(files.len() > 5 && own.len() > 5, "{files:?} {own:?}");
    files.extend(own);
    let paths = |paths: &[PathBuf], script| {
        let paths: Vec<&Path> = paths.iter().map(PathBuf::as_path).collect();
        nobody(script, &paths).expect("the shell ends well")
    };
    // What is open to all is told as that: the looks below are no blind ones.
    let open = tempfile::TempDir::new().unwrap();
    let (folder, file) = (open.path().to_path_buf(), open.path().join("file"));
    std::fs::write(&file, "x").unwrap();
    set_permissions(&file, Permissions::from_mode(0o666)).unwrap();
    set_permissions(&folder, Permissions::from_mode(0o777)).unwrap();
    let all = paths(&[file], FILE) + &paths(&[folder], FOLDER);
    for deed in ["read", "written", "emptied", "moved", "entered", "settled in", "linked in"] {
        assert!(all.contains(deed), "{deed}: {all}");
    }

    assert_eq!(paths(&folders, FOLDER), "");
    // What says whether a node is there and what a service is like may be read.
    let done = paths(&files, FILE);
    let spoilt: Vec<&str> = done.lines().filter(|line| !line.starts_with("read ")).collect();
    assert_eq!(spoilt, Vec::<&str>::new());
    let read: Vec<&str> = done.lines().filter(|line| line.contains("/dev/shm/")).collect();
    assert_eq!(read, Vec::<&str>::new(), "what joints do is read");
    let process = PathBuf::from(system.executor.0.id().to_string());
    let signalled =
        r#"for s in TERM KILL USR1 USR2 STOP; do kill -$s "$1" 2>/dev/null && echo $s; done; true"#;
    assert_eq!(nobody(signalled, &[&process]).expect("the shell ends well"), "");

    // It was all in vain.
    system.wait_for(Mode::Hold);
    let answer = system.client().call(CommandKind::Status, 0.0, Duration::from_secs(2)).unwrap();
    assert_eq!(answer.verdict, Verdict::Accepted.wire());
    system.end();
}
