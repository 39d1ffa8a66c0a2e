//! A bad network between two ends: what TCP makes of lost packets is that bytes come late, and all that
//! come after them.

use std::io::{Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

/// One way.
const DELAY: Duration = Duration::from_millis(10);
/// What TCP sends at once, and how long it waits for an acknowledgement before it sends it again; twice
/// as long each time.
const SEGMENT: usize = 1400;
const TIMEOUT: Duration = Duration::from_millis(200);

/// What becomes of bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Line {
    /// They come through, late where a segment was lost.
    Stands = 0,
    /// Connections are closed and refused.
    Cut = 1,
    /// Nothing comes through, and nobody is told.
    Silent = 2,
}

/// A way for TCP connections.
pub(crate) struct Proxy {
    state: Arc<State>,
    pub(crate) port: u16,
}

#[derive(Default)]
struct State {
    line: AtomicU8,
    over: AtomicBool,
    segments: AtomicU64,
    lost: AtomicU64,
    /// Of 1000 segments so many are lost.
    loss: u64,
    open: Mutex<Vec<TcpStream>>,
}

impl Proxy {
    /// To that port, with so many of 1000 segments lost.
    pub(crate) fn to(port: u16, loss: u64) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let own = listener.local_addr().unwrap().port();
        let state = Arc::new(State { loss, ..State::default() });
        let shared = Arc::clone(&state);
        thread::spawn(move || {
            for (number, stream) in listener.incoming().flatten().enumerate() {
                if shared.over.load(Ordering::Acquire) {
                    return;
                }
                // While the line is silent a connection is made by the system, and nothing said on it.
                if shared.line() != Line::Cut
                    && let Ok(onward) = TcpStream::connect(("127.0.0.1", port))
                {
                    shared.join(stream, onward, number as u64);
                }
            }
        });
        Self { state, port: own }
    }

    pub(crate) fn set(&self, line: Line) {
        self.state.line.store(line as u8, Ordering::Release);
        if line == Line::Cut {
            self.state.close();
        }
    }

    /// How many segments went through it, and how many of them were lost once or more.
    pub(crate) fn count(&self) -> (u64, u64) {
        let of = |count: &AtomicU64| count.load(Ordering::Relaxed);
        (of(&self.state.segments), of(&self.state.lost))
    }
}

impl Drop for Proxy {
    fn drop(&mut self) {
        self.state.over.store(true, Ordering::Release);
        self.state.close();
        let _ = TcpStream::connect(("127.0.0.1", self.port));
    }
}

impl State {
    fn line(&self) -> Line {
        match self.line.load(Ordering::Acquire) {
            0 => Line::Stands,
            1 => Line::Cut,
            _ => Line::Silent,
        }
    }

    fn close(&self) {
        for stream in self.open.lock().unwrap().drain(..) {
            let _ = stream.shutdown(Shutdown::Both);
        }
    }

    fn join(self: &Arc<Self>, one: TcpStream, other: TcpStream, number: u64) {
        let copy = |stream: &TcpStream| stream.try_clone().unwrap();
        self.open.lock().unwrap().extend([copy(&one), copy(&other)]);
        for (seed, from, to) in
            [(2 * number, copy(&one), copy(&other)), (2 * number + 1, other, one)]
        {
            let state = Arc::clone(self);
            thread::spawn(move || state.carry(from, to, seed));
        }
    }

    /// One way of a connection: read at once, written when a segment would have come.
    fn carry(&self, mut from: TcpStream, mut to: TcpStream, seed: u64) {
        let (sender, segments) = std::sync::mpsc::sync_channel::<(Instant, Vec<u8>)>(64);
        let reader = thread::spawn(move || {
            let mut buffer = [0; SEGMENT];
            while let Ok(count @ 1..) = from.read(&mut buffer) {
                if sender.send((Instant::now(), buffer[..count].to_vec())).is_err() {
                    break;
                }
            }
            let _ = from.shutdown(Shutdown::Both);
        });
        let mut random = Random(0x9e37_79b9 ^ (seed << 32) ^ seed);
        for (read, segment) in segments {
            let (mut late, mut timeout, mut lost) = (DELAY, TIMEOUT, 0);
            while random.below(1000) < self.loss {
                (late, timeout, lost) = (late + timeout, 2 * timeout, 1);
            }
            self.segments.fetch_add(1, Ordering::Relaxed);
            self.lost.fetch_add(lost, Ordering::Relaxed);
            thread::sleep(late.saturating_sub(read.elapsed()));
            while self.line() == Line::Silent && !self.over.load(Ordering::Acquire) {
                thread::sleep(Duration::from_millis(5));
            }
            if self.over.load(Ordering::Acquire) || to.write_all(&segment).is_err() {
                break;
            }
        }
        let _ = to.shutdown(Shutdown::Both);
        let _ = reader.join();
    }
}

/// xorshift64*: the same losses in every run, as far as the segments are the same.
struct Random(u64);

impl Random {
    fn below(&mut self, bound: u64) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 33) % bound
    }
}
