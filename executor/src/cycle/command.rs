//! Operators' orders.

use nullsweep_ipc_types::{EventKind, Fault, Mode, Reason, Verdict};

use super::exchange::{Ask, Order, Output, Reply};
use super::state::{State, StopCause};
use crate::guard::Guard;

impl State {
    /// Takes an order and answers it.
    pub(super) fn obey(&mut self, ask: Ask, now_ns: u64, guard: &Guard, out: &mut Output) {
        let verdict = match ask.order {
            Order::Status => Verdict::Accepted,
            Order::Pause => self.pause(),
            Order::Resume => self.resume(now_ns, guard),
            Order::Stop => self.halt(StopCause::Operator, false, out),
            Order::StopAndDisable => self.halt(StopCause::Operator, true, out),
            Order::Speed(scale) => self.set_scale(scale),
            Order::Reset => self.reset(now_ns, guard),
            Order::Shutdown => {
                self.shutdown = true;
                self.halt(StopCause::Shutdown, true, out)
            }
        };
        out.reply = Some(Reply { ticket: ask.ticket, verdict, snapshot: self.snapshot() });
    }

    fn pause(&mut self) -> Verdict {
        match self.mode {
            Mode::Executing | Mode::Paused => {
                self.paused = true;
                Verdict::Accepted
            }
            Mode::Init | Mode::Hold | Mode::Stopping | Mode::Fault => Verdict::WrongMode,
        }
    }

    fn resume(&mut self, now_ns: u64, guard: &Guard) -> Verdict {
        match self.mode {
            _ if self.shutdown => Verdict::WrongMode,
            Mode::Executing | Mode::Paused => {
                self.paused = false;
                self.mode = Mode::Executing;
                Verdict::Accepted
            }
            Mode::Hold | Mode::Init if self.disabled => {
                self.disabled = false;
                self.mode = Mode::Init;
                Verdict::Accepted
            }
            Mode::Fault if self.fault == Fault::Halted => self.reset(now_ns, guard),
            Mode::Init | Mode::Hold | Mode::Stopping | Mode::Fault => Verdict::WrongMode,
        }
    }

    /// Stops, for good reason in every mode: where nothing moves there is nothing to do.
    fn halt(&mut self, cause: StopCause, disable: bool, out: &mut Output) -> Verdict {
        let why = if cause == StopCause::Shutdown { Reason::Shutdown } else { Reason::Stopped };
        self.end_waiting(EventKind::Aborted, why, out);
        self.disabled |= disable;
        match self.mode {
            Mode::Executing | Mode::Paused | Mode::Stopping => {
                self.mode = Mode::Stopping;
                if self.stop != Some(StopCause::Shutdown) {
                    self.stop = Some(cause);
                }
            }
            Mode::Init | Mode::Hold | Mode::Fault => {}
        }
        Verdict::Accepted
    }

    fn set_scale(&mut self, scale: f64) -> Verdict {
        if !(0.0..=1.0).contains(&scale) {
            return Verdict::BadValue;
        }
        self.scale = scale;
        Verdict::Accepted
    }

    fn reset(&mut self, now_ns: u64, guard: &Guard) -> Verdict {
        match self.mode {
            Mode::Fault if self.is_cleared(now_ns, guard) => {
                self.mode = Mode::Init;
                self.fault = Fault::None;
                self.disabled = self.shutdown;
                self.forget();
                Verdict::Accepted
            }
            Mode::Fault => Verdict::StillFaulty,
            Mode::Hold | Mode::Init => {
                self.fault = Fault::None;
                Verdict::Accepted
            }
            Mode::Executing | Mode::Paused | Mode::Stopping => Verdict::WrongMode,
        }
    }
}
