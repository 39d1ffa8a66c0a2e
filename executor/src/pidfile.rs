//! Which process is the executor of a robot: a file that it keeps locked while it lives. Who finds
//! it unlocked knows that nobody is there, whatever it says.

use std::fs::{self, DirBuilder, File, Permissions, TryLockError};
use std::io::{self, Read, Seek, Write};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

use rustix::fd::OwnedFd;
use rustix::process::{Pid, PidfdFlags, Signal, geteuid, pidfd_open, pidfd_send_signal};
use xxhash_rust::xxh3::xxh3_64;

use crate::system::SystemArgs;

/// The folder of such files, in a folder for such things.
const FOLDER: &str = "nullsweep";

/// How long somebody may look at the file.
const LOOKED_AT: Duration = Duration::from_millis(200);

/// Why a process could not be told to be the executor, or not be signalled.
#[derive(Debug, thiserror::Error)]
pub(crate) enum PidFileError {
    /// Another one runs.
    #[error(
        "all places are taken: an executor runs for this robot under this root path already, \
         process {pid}; `executor ctl` commands it, `kill {pid}` ends it"
    )]
    Taken {
        /// It.
        pid: String,
    },
    /// The file cannot be written.
    #[error("{}: {error}", .path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        error: io::Error,
    },
}

/// This process's own file, locked.
#[derive(Debug)]
pub(crate) struct PidFile {
    path: PathBuf,
    _locked: File,
}

impl PidFile {
    /// Tells that this process is the executor for `robot` under `root`.
    ///
    /// # Errors
    /// When another one is, or the file cannot be written.
    pub(crate) fn claim(robot: &str, root: Option<&Path>) -> Result<Self, PidFileError> {
        let folder = own_folder()?;
        let path = folder.join(name(robot, root));
        let failed = |error| PidFileError::Write { path: path.clone(), error };
        let start = Instant::now();
        loop {
            let mut open = File::options();
            open.read(true).write(true).create(true).truncate(false);
            let mut file = open.open(&path).map_err(failed)?;
            match file.try_lock() {
                Ok(()) => {}
                // Who looks for an executor locks it for a moment.
                Err(TryLockError::WouldBlock) if start.elapsed() < LOOKED_AT => {
                    thread::sleep(LOOKED_AT / 10);
                    continue;
                }
                Err(TryLockError::WouldBlock) => {
                    let pid = read_pid(&mut file).map_or_else(|| "?".into(), |pid| pid.to_string());
                    return Err(PidFileError::Taken { pid });
                }
                Err(TryLockError::Error(e)) => return Err(failed(e)),
            }
            // The one before may have removed it between opening and locking.
            let same = |a: fs::Metadata, b: fs::Metadata| a.ino() == b.ino() && a.dev() == b.dev();
            let there = file.metadata().map_err(failed)?;
            if !fs::metadata(&path).is_ok_and(|now| same(there, now)) {
                continue;
            }
            let shown = root.map_or_else(|| "-".into(), |root| root.display().to_string());
            let content = format!("{}\n{robot}\n{shown}\n", std::process::id());
            let written = file.set_len(0).and_then(|()| file.write_all(content.as_bytes()));
            written.map_err(failed)?;
            return Ok(Self { path, _locked: file });
        }
    }
}

impl Drop for PidFile {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.path);
    }
}

/// An executor that runs. It is held by a handle of the kernel's, so that no other process that
/// comes to have its number is ever meant.
#[derive(Debug)]
pub(crate) struct Running {
    pub(crate) pid: i32,
    handle: OwnedFd,
}

impl Running {
    /// The executor for `robot` under `root`, if this user runs one.
    pub(crate) fn find(robot: &str, root: Option<&Path>) -> Option<Self> {
        let name = name(robot, root);
        // In another user's folder stands what that one likes.
        let own = folders().into_iter().filter(|folder| is_own(folder).is_ok());
        own.map(|folder| folder.join(&name)).find_map(|file| Self::of_file(&file))
    }

    fn of_file(path: &Path) -> Option<Self> {
        let mut file = File::open(path).ok()?;
        let locked = |file: &File| matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock));
        if !locked(&file) {
            return None;
        }
        let pid = read_pid(&mut file)?;
        let running = Self::of_pid(pid).ok()?;
        // Still locked: the process that wrote the number lives, so the handle is of it.
        locked(&file).then_some(running)
    }

    /// The process of this number, if it minds the signals of an executor.
    ///
    /// # Errors
    /// When there is no such process, or its signals would kill it.
    pub(crate) fn of_pid(pid: i32) -> io::Result<Self> {
        let number = (pid > 0).then(|| Pid::from_raw(pid)).flatten();
        let number = number.ok_or_else(|| io::Error::other("there is no such process"))?;
        let handle = pidfd_open(number, PidfdFlags::empty())?;
        let status = fs::read_to_string(format!("/proc/{pid}/status"))?;
        if !minds(&status, &[Signal::USR1, Signal::USR2]) {
            return Err(io::Error::other("it is no executor: a signal to stop would kill it"));
        }
        Ok(Self { pid, handle })
    }

    /// The executor of a robot, after it was told by a signal to stop: past shared memory, whatever
    /// has become of that. `None` where none is found, or none that may be signalled.
    pub(crate) fn stopped(system: &SystemArgs, disable: bool) -> Option<Self> {
        Self::find(&system.robot_name, system.ipc_root.as_deref())
            .filter(|running| running.stop(disable).is_ok())
    }

    /// Has it stop on its path, and disable the motors where that is asked for.
    ///
    /// # Errors
    /// When it has ended, or is another user's.
    pub(crate) fn stop(&self, disable: bool) -> io::Result<()> {
        let signal = if disable { Signal::USR2 } else { Signal::USR1 };
        Ok(pidfd_send_signal(&self.handle, signal)?)
    }
}

/// Whether a process has handlers for all these signals, by its `/proc/PID/status`.
fn minds(status: &str, signals: &[Signal]) -> bool {
    let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:"));
    let mask = caught.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    signals.iter().all(|signal| mask & (1 << (signal.as_raw() - 1)) != 0)
}

fn read_pid(file: &mut File) -> Option<i32> {
    let mut text = String::new();
    file.rewind().ok()?;
    file.take(4096).read_to_string(&mut text).ok()?;
    text.lines().next()?.parse().ok()
}

/// The file's name: one for each robot under each root path.
fn name(robot: &str, root: Option<&Path>) -> String {
    match root {
        None => format!("{robot}.pid"),
        Some(root) => {
            // Two names of one folder are one system.
            let _ = fs::create_dir_all(root);
            let root = root.canonicalize().unwrap_or_else(|_| root.to_path_buf());
            format!("{robot}-{:016x}.pid", xxh3_64(root.as_os_str().as_encoded_bytes()))
        }
    }
}

/// Where such files may lie, the best place first. Which of them there are depends on how a process
/// was started, so all are looked at.
fn folders() -> Vec<PathBuf> {
    let uid = geteuid().as_raw();
    let given = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from);
    let session = PathBuf::from(format!("/run/user/{uid}"));
    let mut all: Vec<_> = given.into_iter().filter(|folder| folder.is_absolute()).collect();
    all.push(session);
    if uid == 0 {
        all.push("/run".into());
    }
    let mut all: Vec<_> = all.into_iter().map(|folder| folder.join(FOLDER)).collect();
    all.push(std::env::temp_dir().join(format!("{FOLDER}-{uid}")));
    all
}

/// The first of them that is, or can be made, this user's alone.
fn own_folder() -> Result<PathBuf, PidFileError> {
    let (path, error) = (PathBuf::from(FOLDER), io::ErrorKind::NotFound.into());
    let mut why = PidFileError::Write { path, error };
    for folder in folders() {
        match keep(&folder) {
            Ok(()) => return Ok(folder),
            Err(error) => why = PidFileError::Write { path: folder, error },
        }
    }
    Err(why)
}

/// Makes a folder, and sees to it that no other user can put anything into it.
fn keep(folder: &Path) -> io::Result<()> {
    match DirBuilder::new().mode(0o700).create(folder) {
        Err(e) if e.kind() != io::ErrorKind::AlreadyExists => return Err(e),
        _ => {}
    }
    is_own(folder)?;
    fs::set_permissions(folder, Permissions::from_mode(0o700))
}

/// Whether a folder is this user's, and no link to anywhere.
fn is_own(folder: &Path) -> io::Result<()> {
    let facts = fs::symlink_metadata(folder)?;
    if facts.is_dir() && facts.uid() == geteuid().as_raw() {
        return Ok(());
    }
    Err(io::Error::other("it is another user's, or no folder"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_is_there_is_told_and_a_stale_file_is_nobody() {
        let root = tempfile::TempDir::new().unwrap();
        let root = Some(root.path());
        assert!(Running::find("r", root).is_none());
        let mine = PidFile::claim("r", root).unwrap();
        let e = PidFile::claim("r", root).unwrap_err();
        assert!(e.to_string().contains(&format!("process {}", std::process::id())), "{e}");
        // Another robot, and another root, are others.
        drop(PidFile::claim("s", root).unwrap());
        drop(PidFile::claim("r", None).unwrap());
        // This process has no handlers: it is not to be killed by a stop.
        assert!(Running::find("r", root).is_none());
        let path = mine.path.clone();
        let text = fs::read(&path).unwrap();
        drop(mine);
        assert!(!path.exists());
        fs::write(&path, text).unwrap();
        assert!(Running::of_file(&path).is_none(), "nobody has it locked");
        let again = PidFile::claim("r", root).unwrap();
        assert_eq!(again.path, path);
    }

    #[test]
    fn a_folder_of_others_is_not_used() {
        let place = tempfile::TempDir::new().unwrap();
        let folder = place.path().join("open");
        fs::create_dir(&folder).unwrap();
        fs::set_permissions(&folder, Permissions::from_mode(0o777)).unwrap();
        keep(&folder).unwrap();
        assert_eq!(fs::metadata(&folder).unwrap().mode() & 0o777, 0o700);
        let link = place.path().join("link");
        std::os::unix::fs::symlink(&folder, &link).unwrap();
        assert!(keep(&link).is_err() && is_own(&link).is_err(), "it may lead anywhere");
        assert!(is_own(&folder).is_ok());
        if std::os::unix::fs::chown(&folder, Some(65534), None).is_ok() {
            assert!(keep(&folder).is_err() && is_own(&folder).is_err());
        } else {
            println!("skipped: only root can give a folder away");
        }
    }

    #[test]
    fn only_a_process_that_minds_the_signals_is_one() {
        let both = [Signal::USR1, Signal::USR2];
        assert!(minds("Name:\tx\nSigCgt:\t0000000000000a00\n", &both));
        assert!(!minds("SigCgt:\t0000000000000200\n", &both));
        assert!(!minds("SigIgn:\t0000000000000a00\n", &both) && !minds("", &both));
        for pid in [-1, 0, i32::MAX] {
            assert!(Running::of_pid(pid).is_err(), "{pid}");
        }
    }
}
