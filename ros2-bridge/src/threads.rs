//! Whether the DDS library's threads are still there. They end for good where a wait of theirs is
//! interrupted, as it is in a process that was stopped and goes on (SIGSTOP and SIGCONT, a debugger, a
//! laptop's lid): nothing is heard and said any more, and no call says so.

use std::collections::BTreeSet;
use std::path::Path;
use std::time::{Duration, Instant};

/// This process's threads, as the kernel lists them.
const TASKS: &str = "/proc/self/task";

/// How often it is looked.
const LOOK: Duration = Duration::from_millis(100);

/// Threads that were started by one piece of work.
#[derive(Clone, Debug, Default)]
pub struct Threads {
    started: BTreeSet<u32>,
    /// When it was last looked, and whether one had ended.
    looked: Option<Instant>,
    ended: bool,
}

impl Threads {
    /// Does the work, which no other work that starts or ends threads may accompany; its threads.
    pub fn of<T>(work: impl FnOnce() -> T) -> (Self, T) {
        let before = all();
        let done = work();
        let started = all().difference(&before).copied().collect();
        (Self { started, ..Self::default() }, done)
    }

    /// Whether one of them has ended.
    pub fn has_ended(&mut self) -> bool {
        if self.looked.is_none_or(|at| at.elapsed() >= LOOK) {
            self.looked = Some(Instant::now());
            let is_gone = |thread: &u32| !Path::new(TASKS).join(thread.to_string()).exists();
            self.ended = self.started.iter().any(is_gone);
        }
        self.ended
    }
}

fn all() -> BTreeSet<u32> {
    let tasks = std::fs::read_dir(TASKS).into_iter().flatten().flatten();
    tasks.filter_map(|task| task.file_name().to_str()?.parse().ok()).collect()
}

#[cfg(test)]
mod tests {
    use std::process::Command;

    use signal_hook::consts::SIGSTOP;

    use super::*;
    use crate::args::Common;
    use crate::domain::{join, spin};

    /// Threads that end where they should not are seen; those that go on are not taken for ended.
    #[test]
    fn a_process_that_was_stopped_and_goes_on_knows_that_it_is_deaf() {
        let common = Common { domain: 77, network: vec![[127, 0, 0, 1].into()] };
        let node = || {
            let mut node = join(&common, "stopped").expect("a domain");
            spin(&mut node).expect("a thread");
            node
        };
        let (mut threads, node) = Threads::of(node);
        assert!(threads.started.len() >= 3, "{threads:?}");
        std::thread::sleep(Duration::from_millis(300));
        assert!(!threads.has_ended());
        let go = format!("sleep 0.3; kill -CONT {}", std::process::id());
        let mut other = Command::new("sh").args(["-c", &go]).spawn().expect("a shell");
        signal_hook::low_level::raise(SIGSTOP).expect("stopped, and gone on");
        other.wait().expect("it ends");
        let began = Instant::now();
        while !threads.has_ended() {
            assert!(began.elapsed() < Duration::from_secs(5), "{threads:?} go on");
            std::thread::sleep(Duration::from_millis(10));
        }
        // To leave the domain would wait for those that have ended.
        std::mem::forget(node);
    }
}
