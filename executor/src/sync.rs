//! What the threads share: wait-free queues and atomics. With the feature `model` these are
//! shuttle's, and a queue of the same behaviour, so that `models` tries the orders in which threads
//! can meet in the very code that runs.

#[cfg(not(feature = "model"))]
mod shared {
    pub(crate) use std::sync::atomic::{AtomicBool, AtomicU64};

    pub(crate) use rtrb::{Consumer, Producer, RingBuffer};
}

#[cfg(feature = "model")]
#[allow(unreachable_pub, reason = "as rtrb's are")]
mod shared {
    use std::collections::VecDeque;
    use std::sync::Arc;

    use rtrb::{PopError, PushError};
    use shuttle::sync::Mutex;
    pub(crate) use shuttle::sync::atomic::{AtomicBool, AtomicU64};

    /// As `rtrb`'s: each operation is one moment, between them another thread may run.
    #[derive(Debug)]
    pub struct RingBuffer<T>(Mutex<VecDeque<T>>, usize);

    /// The end that puts in.
    #[derive(Debug)]
    pub struct Producer<T>(Arc<RingBuffer<T>>);

    /// The end that takes out.
    #[derive(Debug)]
    pub struct Consumer<T>(Arc<RingBuffer<T>>);

    impl<T> RingBuffer<T> {
        /// Both ends of a queue with room for so many.
        #[expect(clippy::new_ret_no_self, reason = "as rtrb's")]
        pub fn new(capacity: usize) -> (Producer<T>, Consumer<T>) {
            let own = Arc::new(Self(Mutex::new(VecDeque::with_capacity(capacity)), capacity));
            (Producer(own.clone()), Consumer(own))
        }

        fn with<R>(&self, act: impl FnOnce(&mut VecDeque<T>) -> R) -> R {
            act(&mut self.0.lock().expect("no thread panics here"))
        }
    }

    impl<T> Producer<T> {
        /// Puts one in, where there is room.
        pub fn push(&mut self, value: T) -> Result<(), PushError<T>> {
            let most = self.0.1;
            self.0.with(|queue| {
                if queue.len() == most {
                    return Err(PushError::Full(value));
                }
                queue.push_back(value);
                Ok(())
            })
        }

        /// How many there is room for, or more.
        pub fn slots(&self) -> usize {
            self.0.1 - self.0.with(|queue| queue.len())
        }

        /// Whether there is room for none.
        pub fn is_full(&self) -> bool {
            self.slots() == 0
        }
    }

    impl<T> Consumer<T> {
        /// Takes the oldest one out.
        pub fn pop(&mut self) -> Result<T, PopError> {
            self.0.with(|queue| queue.pop_front()).ok_or(PopError::Empty)
        }

        /// How many there are, or more.
        pub fn slots(&self) -> usize {
            self.0.with(|queue| queue.len())
        }

        /// Whether there is none.
        pub fn is_empty(&self) -> bool {
            self.slots() == 0
        }
    }
}

pub(crate) use shared::{AtomicBool, AtomicU64, Consumer, Producer, RingBuffer};
