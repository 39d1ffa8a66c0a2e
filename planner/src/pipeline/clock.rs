//! How long the stages take.

use std::collections::BTreeMap;
use std::time::Instant;

/// Seconds by stage.
#[derive(Default)]
pub(super) struct Clock(pub(super) BTreeMap<String, f64>);

impl Clock {
    pub(super) fn time<T>(&mut self, stage: &str, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        *self.0.entry(stage.into()).or_default() += start.elapsed().as_secs_f64();
        result
    }
}
