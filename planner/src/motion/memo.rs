//! Motions that were made or tried before: the next attempt at a plan asks for many of them again.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

use nullsweep_robot::{JointVector, MAX_DOF};

use super::layered::Motion;
use super::leg::Leg;
use crate::roadmap::Blocked;
use crate::workcell::Sample;

/// Motions of one arm in one workcell, at one cost and with one seed. Whatever makes a motion
/// depends on its `Key` alone, so a plan is the same with it as without.
pub struct Memo {
    pub(super) seed: u64,
    /// Along the surface, the redundancy parameter changing evenly.
    pub(super) tracks: Table<Result<Motion<Leg>, Blocked>>,
    /// Whether the arm comes to a sample through free space from where it is at first.
    pub(super) joined: Table<bool>,
    /// All others.
    pub(super) ways: Table<Option<Motion<Leg>>>,
}

impl Memo {
    /// Nothing was made yet.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self { seed, tracks: Table::default(), joined: Table::default(), ways: Table::default() }
    }
}

/// What a motion is made from.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Key {
    how: How,
    from: End,
    to: End,
}

/// Which way it goes.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum How {
    /// Along the surface, from one patch to another.
    Surface(usize, usize),
    /// Through free space, from a sample.
    Jump,
    /// Through free space, from where the arm is at first.
    Start,
}

/// The bits of a joint vector.
type End = [u64; MAX_DOF];

impl Key {
    pub(super) fn new(how: How, from: &JointVector, to: &Sample) -> Self {
        let bits = |q: &JointVector| std::array::from_fn(|j| q[j].to_bits());
        Self { how, from: bits(from), to: bits(&to.q) }
    }
}

/// What came of each key.
pub(super) struct Table<V>(Mutex<HashMap<Key, V>>);

impl<V> Default for Table<V> {
    fn default() -> Self {
        Self(Mutex::default())
    }
}

impl<V: Clone> Table<V> {
    /// What was made of it before, or else is made now.
    pub(super) fn get(&self, key: Key, make: impl FnOnce() -> V) -> V {
        // An entry is put in as a whole: what a thread that panicked leaves behind is sound.
        let open = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(made) = open().get(&key) {
            return made.clone();
        }
        let made = make();
        open().insert(key, made.clone());
        made
    }
}
