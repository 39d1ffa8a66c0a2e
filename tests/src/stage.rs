//! Processes on one stage: each system under one root path of its own, every process killed when
//! its owner goes, whatever the reason.

use std::ffi::{OsStr, OsString};
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};
use std::{io, thread};

use anyhow::{Context, bail};
use rustix::process::{Pid, Signal, getppid, kill_process, set_parent_process_death_signal};
use tempfile::TempDir;

/// A folder for one system: its root path for iceoryx2, its processes' output, its files.
#[derive(Debug)]
pub struct Stage {
    folder: TempDir,
    program: PathBuf,
    robot: String,
}

/// The parts that a program can play when it starts itself again, by a hidden first argument.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The planner's own command line.
    Planner,
    /// The executor's own command line.
    Executor,
    /// The mock's own command line.
    Mock,
    /// Publishes a sketch, see [`crate::publisher`].
    Sketch,
    /// `nullsweep`, which starts the programs beside it.
    Front,
}

impl Part {
    /// Every part.
    pub const ALL: [Self; 5] =
        [Self::Planner, Self::Executor, Self::Mock, Self::Sketch, Self::Front];

    /// The hidden first argument.
    #[must_use]
    pub fn argument(self) -> &'static str {
        match self {
            Self::Planner => "__planner",
            Self::Executor => "__executor",
            Self::Mock => "__mock",
            Self::Sketch => "__sketch",
            Self::Front => "__front",
        }
    }

    /// For people.
    #[must_use]
    pub fn name(self) -> &'static str {
        &self.argument()[2..]
    }
}

/// Asks the kernel to kill this process when the one that started it ends: even a parent that is
/// killed itself leaves nobody behind. Call it first in a process that plays a [`Part`].
pub fn die_with_parent() -> io::Result<()> {
    let parent = getppid();
    set_parent_process_death_signal(Some(Signal::KILL))?;
    // The parent may have ended before the request was made.
    if getppid() == parent { Ok(()) } else { Err(io::Error::other("the parent has ended")) }
}

impl Stage {
    /// A stage whose processes are `program` started again.
    pub fn new(program: impl Into<PathBuf>, robot: &str) -> io::Result<Self> {
        let folder = TempDir::with_prefix("nullsweep-")?;
        Ok(Self { folder, program: program.into(), robot: robot.into() })
    }

    /// Does `work` on a stage for the PR2 whose processes are this program started again, and then
    /// copies the stage's files to `keep`, whatever came of it.
    pub fn with<T>(
        keep: Option<&Path>,
        work: impl FnOnce(&Self) -> anyhow::Result<T>,
    ) -> anyhow::Result<T> {
        let stage = Self::new(std::env::current_exe()?, "pr2")?;
        let result = work(&stage);
        if let Some(folder) = keep {
            stage
                .copy_files(folder)
                .with_context(|| format!("cannot fill {}", folder.display()))?;
        }
        result
    }

    /// The robot's name in the services' names.
    #[must_use]
    pub fn robot(&self) -> &str {
        &self.robot
    }

    /// The root path of this system.
    #[must_use]
    pub fn root(&self) -> PathBuf {
        self.file("ipc")
    }

    /// A file of this stage.
    #[must_use]
    pub fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Copies the files of this stage (plans, figures, the processes' output) to a folder.
    pub fn copy_files(&self, to: &Path) -> io::Result<()> {
        fs::create_dir_all(to)?;
        for entry in fs::read_dir(self.folder.path())? {
            let entry = entry?;
            if entry.file_type()?.is_file() {
                fs::copy(entry.path(), to.join(entry.file_name()))?;
            }
        }
        Ok(())
    }

    /// The options that every part takes: where its services are.
    #[must_use]
    pub fn place(&self) -> [OsString; 4] {
        let root = self.root().into_os_string();
        ["--robot-name".into(), self.robot.clone().into(), "--ipc-root".into(), root]
    }

    /// Starts a part. `name` tells its output files apart.
    pub fn start<A: Into<OsString>>(
        &self,
        part: Part,
        name: &str,
        args: impl IntoIterator<Item = A>,
    ) -> io::Result<Process> {
        let own = std::iter::once(part.argument().into());
        self.launch(&self.program, name, own.chain(args.into_iter().map(Into::into)))
    }

    /// Starts another program.
    pub fn launch(
        &self,
        program: impl AsRef<OsStr>,
        name: &str,
        args: impl IntoIterator<Item = OsString>,
    ) -> io::Result<Process> {
        let (stdout, stderr) =
            (self.file(&format!("{name}.out")), self.file(&format!("{name}.err")));
        let child = Command::new(program)
            .args(args)
            // What a user's cell says is not meant for a stage of its own.
            .env(nullsweep_cell::VARIABLE, "")
            .stdin(Stdio::null())
            .stdout(File::create(&stdout)?)
            .stderr(File::create(&stderr)?)
            .spawn()?;
        Ok(Process { name: name.into(), child, stdout, stderr, status: None })
    }
}

/// A started process; killed when this is dropped.
#[derive(Debug)]
pub struct Process {
    name: String,
    child: Child,
    stdout: PathBuf,
    stderr: PathBuf,
    status: Option<ExitStatus>,
}

impl Process {
    /// Its name on the stage.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its number to the system.
    #[must_use]
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Its exit status, `None` while it runs.
    pub fn status(&mut self) -> io::Result<Option<ExitStatus>> {
        if self.status.is_none() {
            self.status = self.child.try_wait()?;
        }
        Ok(self.status)
    }

    /// Waits for its end, at most `timeout`.
    pub fn wait(&mut self, timeout: Duration) -> io::Result<Option<ExitStatus>> {
        let end = Instant::now() + timeout;
        loop {
            let status = self.status()?;
            if status.is_some() || Instant::now() >= end {
                return Ok(status);
            }
            thread::sleep(Duration::from_millis(5));
        }
    }

    /// Waits for it to end well, at most `timeout`.
    pub fn succeed(&mut self, timeout: Duration) -> anyhow::Result<()> {
        match self.wait(timeout)? {
            Some(status) if status.success() => Ok(()),
            Some(status) => bail!("{} failed ({status}): {}", self.name(), self.last_words()),
            None => bail!("{} did not end within {} s", self.name(), timeout.as_secs()),
        }
    }

    /// Asks it to end (SIGTERM) and waits; `None` where it does not end by itself in time.
    pub fn terminate(&mut self, timeout: Duration) -> io::Result<Option<ExitStatus>> {
        if self.status()?.is_none() {
            self.signal(Signal::TERM)?;
        }
        self.wait(timeout)
    }

    /// Ends it at once (SIGKILL).
    pub fn kill(&mut self) -> io::Result<()> {
        if self.status()?.is_none() {
            self.child.kill()?;
            self.status = Some(self.child.wait()?);
        }
        Ok(())
    }

    /// Sends it a signal.
    pub fn signal(&self, signal: Signal) -> io::Result<()> {
        let id = i32::try_from(self.child.id()).ok().and_then(Pid::from_raw);
        let id = id.ok_or_else(|| io::Error::other("no such process"))?;
        Ok(kill_process(id, signal)?)
    }

    /// What it wrote to standard output so far.
    #[must_use]
    pub fn stdout(&self) -> String {
        read(&self.stdout)
    }

    /// What it wrote to standard error so far.
    #[must_use]
    pub fn stderr(&self) -> String {
        read(&self.stderr)
    }

    /// The last lines of what it wrote to standard error so far.
    #[must_use]
    pub fn last_words(&self) -> String {
        let text = self.stderr();
        let lines: Vec<_> = text.trim_end().lines().collect();
        lines[lines.len().saturating_sub(8)..].join("\n  ")
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // Nothing can be done about a failure here, and the kernel ends it with its parent.
        let _ = self.kill();
    }
}

fn read(path: &Path) -> String {
    fs::read(path).map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sleeper(stage: &Stage) -> Process {
        // `sh __mock …` fails at once, so the shell is given as the program by hand.
        let (stdout, stderr) = (stage.file("s.out"), stage.file("s.err"));
        let child = Command::new("sleep")
            .arg("60")
            .stdout(File::create(&stdout).expect("a file"))
            .stderr(File::create(&stderr).expect("a file"))
            .spawn()
            .expect("sleep starts");
        Process { name: "sleep".into(), child, stdout, stderr, status: None }
    }

    #[test]
    fn processes_end_on_request_and_with_their_owner() {
        let stage = Stage::new("sh", "pr2").expect("a folder");
        let mut asked = sleeper(&stage);
        assert!(asked.status().expect("known").is_none());
        let status = asked.terminate(Duration::from_secs(20)).expect("sent").expect("ended");
        assert!(!status.success());

        let dropped = sleeper(&stage);
        let id = Pid::from_raw(i32::try_from(dropped.child.id()).expect("small")).expect("one");
        drop(dropped);
        assert!(rustix::process::test_kill_process(id).is_err());
    }

    #[test]
    fn output_is_kept_apart() {
        let stage = Stage::new("sh", "pr2").expect("a folder");
        let mut process = stage.start(Part::Mock, "a", ["x"]).expect("sh starts");
        let status = process.wait(Duration::from_secs(20)).expect("known").expect("ended");
        assert!(!status.success());
        assert!(process.stderr().contains("__mock") && process.stdout().is_empty());
    }
}
