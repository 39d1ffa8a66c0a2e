//! What of a program is done, in a file beside it: one line a step, only ever appended to, so that a
//! crash at any moment loses at most the step that it interrupts.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use nullsweep_ipc_types::PlanId;
use serde::{Deserialize, Serialize};

use crate::link::base::Stands;

/// A step that was taken. Stops and plans of a stop are counted from 1, as people are told them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "step", rename_all = "kebab-case", deny_unknown_fields)]
enum Step {
    /// The program that all that follows is of.
    Program {
        /// Its digest, in hexadecimal digits.
        digest: String,
    },
    /// The base stands at a stop.
    Arrived { stop: usize, base: [f64; 3], measured: bool },
    /// An executor has taken a plan. `file`: the plan, where it is another one than the program's.
    Begun { stop: usize, plan: usize, id: String, file: Option<PathBuf> },
    /// That plan was left on its way, in a knot where that is known.
    Left { stop: usize, plan: usize, knot: Option<usize> },
    /// It was followed to its end.
    Finished { stop: usize, plan: usize },
}

/// How far a plan of a program is.
#[derive(Clone, Debug, PartialEq)]
pub enum Progress {
    /// It was not begun.
    Open,
    /// It was begun, and may be on its way, at its end, or left anywhere.
    Begun(Begun),
    /// It is done.
    Finished,
}

/// A plan that was begun.
#[derive(Clone, Debug, PartialEq)]
pub struct Begun {
    /// The plan as the executor knows it.
    pub id: PlanId,
    /// Its file, where it is another one than the program's: what was left of that.
    pub file: Option<PathBuf>,
    /// The knot in which it was left, if that is known.
    pub knot: Option<usize>,
}

/// Why a journal is of no use.
#[derive(Debug, thiserror::Error)]
pub enum JournalError {
    /// It cannot be read or written.
    #[error("the journal {}: {source}", .path.display())]
    File {
        /// Which.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Another process writes to it.
    #[error("the journal {} is in use: the program is being worked through", .path.display())]
    InUse {
        /// Which.
        path: PathBuf,
    },
    /// A line is none of a journal.
    #[error("the journal {}, line {line}: {what}", .path.display())]
    Line {
        /// Which.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong.
        what: String,
    },
    /// It is of another program, or of this one before it was changed.
    #[error("the journal {} is of another program, or of this one as it was before", .path.display())]
    OtherProgram {
        /// Which.
        path: PathBuf,
    },
    /// Work is open, and nobody said to go on with it.
    #[error("the journal {} says that {done} plans of the program are done and more were begun or left", .path.display())]
    Open {
        /// Which.
        path: PathBuf,
        /// Plans that are done.
        done: usize,
    },
    /// There is nothing to go on with.
    #[error("there is no journal {} to go on with", .path.display())]
    None {
        /// Which.
        path: PathBuf,
    },
}

/// A program's journal, open to be gone on with by this process alone.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
    steps: Vec<Step>,
}

impl Journal {
    /// Opens the journal of a program with this digest and this many plans: to go on (`resume`) with what
    /// it says, else to begin. One that says that all is done is begun anew.
    ///
    /// # Errors
    /// See [`JournalError`].
    pub fn open(
        path: &Path,
        digest: u64,
        plans: usize,
        resume: bool,
    ) -> Result<Self, JournalError> {
        let path = path.to_path_buf();
        if resume && !path.exists() {
            return Err(JournalError::None { path });
        }
        let failed = |source| JournalError::File { path: path.clone(), source };
        let options = OpenOptions::new().read(true).append(true).create(true).clone();
        let mut file = options.open(&path).map_err(failed)?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => return Err(JournalError::InUse { path }),
            Err(TryLockError::Error(source)) => return Err(failed(source)),
            Ok(()) => {}
        }
        let mut text = String::new();
        file.read_to_string(&mut text).map_err(failed)?;
        // A line that a crash has cut off was never written.
        let whole = text.rfind('\n').map_or(0, |end| end + 1);
        file.set_len(whole as u64).map_err(failed)?;
        let steps = read(&text[..whole], &path)?;
        let digest = format!("{digest:016x}");
        let mut journal = Self { path: path.clone(), file, steps };
        match journal.steps.first() {
            Some(Step::Program { digest: found }) if *found == digest => {}
            Some(_) => return Err(JournalError::OtherProgram { path }),
            None => {
                journal.put(Step::Program { digest })?;
                return Ok(journal);
            }
        }
        let done = journal.done();
        if resume || journal.steps.len() == 1 {
            return Ok(journal);
        }
        if done < plans {
            return Err(JournalError::Open { path, done });
        }
        journal.file.set_len(0).map_err(failed)?;
        journal.file.seek(SeekFrom::Start(0)).map_err(failed)?;
        journal.steps.clear();
        journal.put(Step::Program { digest })?;
        Ok(journal)
    }

    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// How many plans are done.
    #[must_use]
    pub fn done(&self) -> usize {
        self.steps.iter().filter(|step| matches!(step, Step::Finished { .. })).count()
    }

    /// Whether anything of the program was begun.
    #[must_use]
    pub fn is_begun(&self) -> bool {
        self.steps.len() > 1
    }

    /// The stop at which the base was last, from 0, and where it stood.
    #[must_use]
    pub fn stands(&self) -> Option<(usize, Stands)> {
        self.steps.iter().rev().find_map(|step| match *step {
            Step::Arrived { stop, base, measured } => {
                Some((stop.checked_sub(1)?, Stands { pose: base, measured }))
            }
            _ => None,
        })
    }

    /// How far a plan of a stop is, both from 0.
    #[must_use]
    pub fn progress(&self, at: (usize, usize)) -> Progress {
        let mut progress = Progress::Open;
        for step in &self.steps {
            match step {
                Step::Begun { stop, plan, id, file } if (*stop, *plan) == (at.0 + 1, at.1 + 1) => {
                    let id = parsed(id).unwrap_or(PlanId::NONE);
                    progress = Progress::Begun(Begun { id, file: file.clone(), knot: None });
                }
                Step::Left { stop, plan, knot } if (*stop, *plan) == (at.0 + 1, at.1 + 1) => {
                    if let Progress::Begun(begun) = &mut progress {
                        begun.knot = *knot;
                    }
                }
                Step::Finished { stop, plan } if (*stop, *plan) == (at.0 + 1, at.1 + 1) => {
                    progress = Progress::Finished;
                }
                _ => {}
            }
        }
        progress
    }

    /// The base stands at a stop, from 0.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn arrived(&mut self, stop: usize, stands: Stands) -> Result<(), JournalError> {
        let Stands { pose, measured } = stands;
        self.put(Step::Arrived { stop: stop + 1, base: pose, measured })
    }

    /// An executor has taken a plan; `file`: where it is another one than the program's.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn begun(
        &mut self,
        (stop, plan): (usize, usize),
        id: PlanId,
        file: Option<&Path>,
    ) -> Result<(), JournalError> {
        let (id, file) = (id.to_string(), file.map(Path::to_path_buf));
        self.put(Step::Begun { stop: stop + 1, plan: plan + 1, id, file })
    }

    /// A plan was left on its way.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn left(
        &mut self,
        (stop, plan): (usize, usize),
        knot: Option<usize>,
    ) -> Result<(), JournalError> {
        self.put(Step::Left { stop: stop + 1, plan: plan + 1, knot })
    }

    /// A plan was followed to its end.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn finished(&mut self, (stop, plan): (usize, usize)) -> Result<(), JournalError> {
        self.put(Step::Finished { stop: stop + 1, plan: plan + 1 })
    }

    /// Appends a step, and has it on the disk before anything else happens.
    fn put(&mut self, step: Step) -> Result<(), JournalError> {
        let failed = |source| JournalError::File { path: self.path.clone(), source };
        let mut line = serde_json::to_string(&step).map_err(|e| failed(e.into()))?;
        line.push('\n');
        self.file
            .write_all(line.as_bytes())
            .and_then(|()| self.file.sync_data())
            .map_err(failed)?;
        self.steps.push(step);
        Ok(())
    }
}

fn read(text: &str, path: &Path) -> Result<Vec<Step>, JournalError> {
    let step = |(k, line): (usize, &str)| {
        let wrong = |what: String| JournalError::Line { path: path.into(), line: k + 1, what };
        let step = serde_json::from_str(line).map_err(|e| wrong(e.to_string()))?;
        match &step {
            Step::Program { .. } if k > 0 => Err(wrong("a second program".into())),
            Step::Begun { id, .. } if parsed(id).is_none() => {
                Err(wrong(format!("`{id}` names no plan")))
            }
            _ => Ok(step),
        }
    };
    text.lines().enumerate().map(step).collect()
}

/// A plan's id as people are told it.
fn parsed(text: &str) -> Option<PlanId> {
    let (epoch, number) = text.split_once('/')?;
    let epoch = u64::from_str_radix(epoch, 16).ok()?;
    Some(PlanId { epoch, number: number.parse().ok()? })
}

#[cfg(test)]
mod tests {
    use super::*;

    const ID: PlanId = PlanId { epoch: 0xabc, number: 3 };

    fn folder() -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("program.journal");
        (folder, path)
    }

    #[test]
    fn what_was_done_is_known_again() {
        let (_folder, path) = folder();
        assert!(matches!(Journal::open(&path, 7, 3, true), Err(JournalError::None { .. })));
        let mut journal = Journal::open(&path, 7, 3, false).expect("a new one");
        assert!(!journal.is_begun());
        let stands = Stands { pose: [0.1, 0.2, 0.3], measured: true };
        journal.arrived(1, stands).expect("written");
        journal.begun((1, 0), ID, None).expect("written");
        journal.finished((1, 0)).expect("written");
        journal.begun((1, 1), ID, Some(Path::new("rest.json"))).expect("written");
        journal.left((1, 1), Some(12)).expect("written");
        // Nobody else goes on while it is open.
        assert!(matches!(Journal::open(&path, 7, 3, true), Err(JournalError::InUse { .. })));
        drop(journal);

        let again = Journal::open(&path, 7, 3, true).expect("the same");
        assert_eq!((again.stands(), again.done()), (Some((1, stands)), 1));
        assert_eq!(again.progress((0, 0)), Progress::Open);
        assert_eq!(again.progress((1, 0)), Progress::Finished);
        let begun = Begun { id: ID, file: Some("rest.json".into()), knot: Some(12) };
        assert_eq!(again.progress((1, 1)), Progress::Begun(begun));
    }

    #[test]
    fn a_line_that_was_cut_off_was_never_written() {
        let (_folder, path) = folder();
        let mut journal = Journal::open(&path, 7, 2, false).expect("a new one");
        journal.begun((0, 0), ID, None).expect("written");
        journal.finished((0, 0)).expect("written");
        drop(journal);
        let text = std::fs::read_to_string(&path).expect("a journal");
        // Wherever the last line is cut.
        let before = text.trim_end().rfind('\n').expect("several lines") + 1;
        for end in before..text.len() {
            std::fs::write(&path, &text[..end]).expect("written");
            let mut journal = Journal::open(&path, 7, 2, true).expect("what is whole counts");
            assert!(matches!(journal.progress((0, 0)), Progress::Begun(_)), "cut at {end}");
            journal.finished((0, 0)).expect("written");
            drop(journal);
            assert_eq!(std::fs::read_to_string(&path).expect("a journal"), text, "cut at {end}");
        }
    }

    #[test]
    fn what_is_begun_is_not_begun_again_unasked() {
        let (_folder, path) = folder();
        let mut journal = Journal::open(&path, 7, 1, false).expect("a new one");
        journal.begun((0, 0), ID, None).expect("written");
        drop(journal);
        let open = Journal::open(&path, 7, 1, false);
        assert!(matches!(open, Err(JournalError::Open { done: 0, .. })), "{open:?}");
        let other = Journal::open(&path, 8, 1, true);
        assert!(matches!(other, Err(JournalError::OtherProgram { .. })), "{other:?}");
        let mut journal = Journal::open(&path, 7, 1, true).expect("the same");
        journal.finished((0, 0)).expect("written");
        drop(journal);
        // All is done: it may be done again.
        let anew = Journal::open(&path, 7, 1, false).expect("anew");
        assert!(!anew.is_begun());
        drop(anew);
        assert_eq!(std::fs::read_to_string(&path).expect("a journal").lines().count(), 1);
        std::fs::write(&path, "{\"step\":\"begun\"}\n").expect("written");
        let broken = Journal::open(&path, 7, 1, true).expect_err("no step").to_string();
        assert!(broken.contains("line 1: missing field `stop`"), "{broken}");
    }
}
