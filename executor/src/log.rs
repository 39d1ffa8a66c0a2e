//! The log on its way to standard error: nobody waits for it, and it can fail.
//!
//! A pipe that nobody reads, a reader that is gone or a full disk must keep neither an operator
//! from his answer nor a plan from its admission. So threads put whole lines into a buffer of
//! fixed size, and a thread of the log's own writes them. What finds no room there or cannot be
//! written is lost, counted, and told as soon as something can be written again.
//!
//! tracing-appender's non-blocking writer would be the crate for it, but its lines are allocated by
//! one thread and freed by another, and it does not count what the sink refuses.

use std::collections::VecDeque;
use std::fs::File;
use std::io::{self, IsTerminal, Write};
use std::os::fd::AsFd;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, TryLockError};
use std::thread::{self, Thread};
use std::time::{Duration, Instant};

use tracing_subscriber::EnvFilter;

/// Bytes that may wait to be written: some 2000 lines.
const ROOM: usize = 256 << 10;
/// Bytes that are written at once.
const CHUNK: usize = 16 << 10;
/// How often a line tries for the buffer, which others hold for less than a microsecond; where one
/// of them was put aside in that moment, the line is lost rather than waited with.
const TRIES: u32 = 1000;
/// How long the end of the log may take.
const END_WITHIN: Duration = Duration::from_millis(500);
/// The log's thread looks by itself that often, should a wake-up have been missed.
const LOOK: Duration = Duration::from_millis(100);

#[derive(Debug)]
struct Shared {
    waiting: Mutex<VecDeque<u8>>,
    /// Lines that were lost.
    lost: Arc<AtomicU64>,
    /// No more lines will come.
    ends: AtomicBool,
    /// Nothing will be written any more.
    ended: AtomicBool,
}

/// The log. Writing a line to it never blocks and never fails.
#[derive(Debug)]
pub struct Log {
    shared: Arc<Shared>,
    writer: Option<Thread>,
}

/// Where one thread writes whole lines.
#[derive(Clone, Debug)]
pub(crate) struct Line {
    shared: Arc<Shared>,
    writer: Option<Thread>,
}

impl Log {
    /// Takes what `tracing` is told by this process from now on, panics too, to standard error.
    /// `filter`: what is logged where the environment (`RUST_LOG`) does not say. Another program's
    /// subscriber, where one is there already, stays.
    #[must_use]
    pub fn install(filter: &str) -> Self {
        let log = Self::to_stderr();
        let line = log.line();
        let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(filter));
        let _ = tracing_subscriber::fmt()
            .with_env_filter(filter)
            .with_target(false)
            .with_ansi(io::stderr().is_terminal())
            .log_internal_errors(false)
            .with_writer(move || line.clone())
            .try_init();
        // The usual one writes to standard error itself, which may hang.
        std::panic::set_hook(Box::new(|panic| tracing::error!("{panic}")));
        log
    }

    /// A log to standard error. Past the lock of [`io::stderr`], which would be held while a
    /// write hangs.
    fn to_stderr() -> Self {
        match io::stderr().as_fd().try_clone_to_owned() {
            Ok(own) => Self::start(File::from(own)),
            Err(_) => Self::start(io::stderr()),
        }
    }

    fn start(mut sink: impl Write + Send + 'static) -> Self {
        let shared = Arc::new(Shared {
            waiting: Mutex::new(VecDeque::with_capacity(ROOM)),
            lost: Arc::default(),
            ends: AtomicBool::new(false),
            ended: AtomicBool::new(false),
        });
        let own = shared.clone();
        // Without a thread the log is lost, and counted, as with any other obstacle.
        let writer = thread::Builder::new().name("log".into()).spawn(move || own.write(&mut sink));
        let writer = writer.ok().map(|handle| handle.thread().clone());
        Self { shared, writer }
    }

    /// How many lines were lost so far.
    pub(crate) fn lost(&self) -> Arc<AtomicU64> {
        self.shared.lost.clone()
    }

    pub(crate) fn line(&self) -> Line {
        Line { shared: self.shared.clone(), writer: self.writer.clone() }
    }

    /// Waits until everything is written, but not for long. Returns how many lines were lost.
    pub fn end(self) -> u64 {
        self.shared.ends.store(true, Ordering::Release);
        let Some(writer) = &self.writer else { return self.shared.lost.load(Ordering::Relaxed) };
        writer.unpark();
        let end = Instant::now() + END_WITHIN;
        while !self.shared.ended.load(Ordering::Acquire) && Instant::now() < end {
            thread::sleep(Duration::from_millis(1));
        }
        self.shared.lost.load(Ordering::Relaxed)
    }
}

impl Shared {
    /// The buffer, unless others hold it for longer than they should.
    fn try_waiting(&self) -> Option<MutexGuard<'_, VecDeque<u8>>> {
        for _ in 0..TRIES {
            match self.waiting.try_lock() {
                Ok(guard) => return Some(guard),
                Err(TryLockError::Poisoned(poisoned)) => return Some(poisoned.into_inner()),
                Err(TryLockError::WouldBlock) => std::hint::spin_loop(),
            }
        }
        None
    }

    /// Takes a line in, or loses it. Never allocates.
    fn put(&self, line: &[u8]) {
        let kept = self.try_waiting().is_some_and(|mut waiting| {
            let room = waiting.len() + line.len() <= ROOM;
            if room {
                waiting.extend(line);
            }
            room
        });
        if !kept {
            self.lost.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// The log's thread.
    fn write(&self, sink: &mut impl Write) {
        let mut chunk = Vec::with_capacity(CHUNK);
        let mut told = 0;
        loop {
            // Asked first: what came before the end is seen below.
            let ends = self.ends.load(Ordering::Acquire);
            chunk.clear();
            if let Some(mut waiting) = self.try_waiting() {
                let count = waiting.len().min(CHUNK);
                chunk.extend(waiting.drain(..count));
            } else {
                thread::yield_now();
                continue;
            }
            if chunk.is_empty() {
                if ends {
                    break;
                }
                thread::park_timeout(LOOK);
                continue;
            }
            if sink.write_all(&chunk).and_then(|()| sink.flush()).is_err() {
                let lines = chunk.iter().filter(|byte| **byte == b'\n').count();
                self.lost.fetch_add(lines as u64, Ordering::Relaxed);
                continue;
            }
            let lost = self.lost.load(Ordering::Relaxed);
            if lost > told && chunk.ends_with(b"\n") {
                let _ = writeln!(sink, "executor: {lost} lines of this log were lost so far");
                told = lost;
            }
        }
        self.ended.store(true, Ordering::Release);
    }
}

impl Write for Line {
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        self.shared.put(line);
        if let Some(writer) = &self.writer {
            writer.unpark();
        }
        Ok(line.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Writes a last message to standard error, where it can be written at once.
pub fn last_words(text: &str) {
    let log = Log::to_stderr();
    let _ = writeln!(log.line(), "{text}");
    log.end();
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc;

    use super::*;

    /// A sink that takes nothing until it is told to, or fails.
    struct Stuck {
        go: mpsc::Receiver<io::Result<()>>,
        written: Arc<Mutex<Vec<u8>>>,
    }

    impl Write for Stuck {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            // A sender that is gone lets everything pass.
            self.go.recv().unwrap_or(Ok(()))?;
            self.written.lock().unwrap().extend(bytes);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    /// Lets one write go on, with its result.
    type Go = mpsc::Sender<io::Result<()>>;

    fn stuck() -> (Log, Go, Arc<Mutex<Vec<u8>>>) {
        let (sender, go) = mpsc::channel();
        let written = Arc::new(Mutex::new(Vec::new()));
        (Log::start(Stuck { go, written: written.clone() }), sender, written)
    }

    const LINES: usize = 10_000;

    fn fill(log: &Log) {
        let start = Instant::now();
        let mut line = log.line();
        for k in 0..LINES {
            // As `tracing` does it: one call a line.
            line.write_all(format!("line {k:>90}\n").as_bytes()).unwrap();
        }
        assert!(start.elapsed() < Duration::from_secs(5), "{:?}", start.elapsed());
    }

    #[test]
    fn a_sink_that_takes_nothing_blocks_nobody_and_what_is_lost_is_counted() {
        let (log, go, written) = stuck();
        fill(&log);
        let start = Instant::now();
        let shared = log.shared.clone();
        let lost = log.end() as usize;
        assert!(start.elapsed() < 10 * END_WITHIN, "{:?}", start.elapsed());
        let kept = (ROOM + CHUNK) / 96;
        assert!(lost > 0 && lost >= LINES - kept - 1 && lost < LINES, "{lost}");
        // Now it goes on: what was kept is written, and what was lost told.
        drop(go);
        let end = Instant::now() + Duration::from_secs(20);
        while !shared.ended.load(Ordering::Acquire) && Instant::now() < end {
            thread::sleep(Duration::from_millis(1));
        }
        let text = String::from_utf8(written.lock().unwrap().clone()).unwrap();
        let whole = text.lines().filter(|l| l.starts_with("line ") && l.len() == 95).count();
        assert_eq!(whole + lost, LINES, "every line is either whole or counted");
        let told = format!("executor: {lost} lines of this log were lost so far");
        assert!(text.lines().any(|l| l == told), "{told}");
    }

    #[test]
    fn a_sink_that_fails_costs_lines_and_nothing_else() {
        let (log, go, written) = stuck();
        let mut line = log.line();
        go.send(Err(io::Error::from(io::ErrorKind::StorageFull))).unwrap();
        writeln!(line, "first").unwrap();
        let end = Instant::now() + Duration::from_secs(20);
        while log.shared.lost.load(Ordering::Relaxed) == 0 && Instant::now() < end {
            thread::sleep(Duration::from_millis(1));
        }
        drop(go);
        writeln!(line, "second").unwrap();
        assert_eq!(log.end(), 1);
        let text = String::from_utf8(written.lock().unwrap().clone()).unwrap();
        assert_eq!(text, "second\nexecutor: 1 lines of this log were lost so far\n");
    }
}
