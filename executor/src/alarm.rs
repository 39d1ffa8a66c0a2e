//! What reaches the loop past everything else: signals. Nothing is allocated for them, opened or
//! waited for, so an operator's stop works whatever becomes of shared memory, of the queues and of
//! the other threads.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGUSR1, SIGUSR2};
use signal_hook::flag;

use crate::cycle::Order;

/// What was asked for by a signal, read by the loop each cycle.
#[derive(Clone, Debug, Default)]
pub struct Alarm {
    stop: Arc<AtomicBool>,
    disable: Arc<AtomicBool>,
    shutdown: Arc<AtomicBool>,
}

impl Alarm {
    /// One that signals ring from now on: SIGUSR1 stops as `ctl stop` does, SIGUSR2 as `ctl stop
    /// --disable`, SIGTERM, SIGINT and SIGHUP stop and end the program; the second one of these
    /// ends it at once.
    ///
    /// # Errors
    /// When the system refuses a handler.
    pub fn install() -> io::Result<Self> {
        let alarm = Self::default();
        for signal in [SIGTERM, SIGINT, SIGHUP] {
            flag::register_conditional_shutdown(signal, 1, alarm.shutdown.clone())?;
            flag::register(signal, alarm.shutdown.clone())?;
        }
        flag::register(SIGUSR1, alarm.stop.clone())?;
        flag::register(SIGUSR2, alarm.disable.clone())?;
        Ok(alarm)
    }

    /// Asks for what SIGUSR1 does, or SIGUSR2.
    #[cfg(test)]
    pub(crate) fn ring(&self, disable: bool) {
        let flag = if disable { &self.disable } else { &self.stop };
        flag.store(true, Ordering::Release);
    }

    /// Asks for what SIGTERM does.
    pub fn shut_down(&self) {
        self.shutdown.store(true, Ordering::Release);
    }

    /// Whether the program is to end.
    #[must_use]
    pub fn is_shutting_down(&self) -> bool {
        self.shutdown.load(Ordering::Acquire)
    }

    /// The order that goes before all others. `shuts_down`: the loop knows that it is to end.
    pub(crate) fn take(&self, shuts_down: bool) -> Option<Order> {
        // Looked at before it is written to: nearly always there is none.
        let rung =
            |flag: &AtomicBool| flag.load(Ordering::Relaxed) && flag.swap(false, Ordering::Acquire);
        if !shuts_down && self.is_shutting_down() {
            Some(Order::Shutdown)
        } else if rung(&self.disable) {
            Some(Order::StopAndDisable)
        } else if rung(&self.stop) {
            Some(Order::Stop)
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_ring_is_heard_once_and_the_end_comes_first() {
        let alarm = Alarm::default();
        assert_eq!(alarm.take(false), None);
        alarm.ring(false);
        alarm.ring(true);
        alarm.shut_down();
        assert_eq!(alarm.take(false), Some(Order::Shutdown));
        assert_eq!(alarm.take(true), Some(Order::StopAndDisable));
        assert_eq!(alarm.take(true), Some(Order::Stop));
        assert_eq!(alarm.take(true), None);
    }
}
