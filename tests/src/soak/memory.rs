//! The resident memory of a process over time.

use std::fmt;
use std::time::{Duration, Instant};

use anyhow::{Context, ensure};

/// Time between two looks.
const EVERY: Duration = Duration::from_millis(500);

/// What a process held, since it has warmed up.
#[derive(Debug)]
pub(super) struct Memory {
    name: &'static str,
    id: u32,
    looked: Option<Instant>,
    start: Instant,
    /// When, since the start \[min\], and how much \[KiB\].
    held: Vec<(f64, i64)>,
}

impl Memory {
    pub(super) fn of(name: &'static str, id: u32) -> Self {
        Self { name, id, looked: None, start: Instant::now(), held: Vec::new() }
    }

    /// Looks, now and then, and remembers what it saw where the process is warm.
    pub(super) fn look(&mut self, warm: bool) -> anyhow::Result<()> {
        if !warm || self.looked.is_some_and(|at| at.elapsed() < EVERY) {
            return Ok(());
        }
        self.looked = Some(Instant::now());
        let path = format!("/proc/{}/status", self.id);
        let status = std::fs::read_to_string(&path)
            .with_context(|| format!("the {} is gone: {path}", self.name))?;
        let held = resident(&status).with_context(|| format!("{path} has no VmRSS"))?;
        self.held.push((self.start.elapsed().as_secs_f64() / 60.0, held));
        Ok(())
    }

    /// From the first to the last look. \[KiB\]
    fn ends(&self) -> Option<(i64, i64)> {
        Some((self.held.first()?.1, self.held.last()?.1))
    }

    /// Of the line nearest to all looks. \[KiB/min\]
    fn slope(&self) -> f64 {
        let n = self.held.len().max(1) as f64;
        let mean = |of: &dyn Fn(&(f64, i64)) -> f64| self.held.iter().map(of).sum::<f64>() / n;
        let (time, held) = (mean(&|h| h.0), mean(&|h| h.1 as f64));
        let both = mean(&|h| (h.0 - time) * (h.1 as f64 - held));
        both / mean(&|h| (h.0 - time).powi(2)).max(f64::MIN_POSITIVE)
    }

    /// It has not grown by more than this. \[KiB\]
    pub(super) fn check(&self, growth: i64) -> anyhow::Result<()> {
        let (first, last) = self.ends().context("the run was too short to look at memory")?;
        ensure!(last - first <= growth, "the {} grows: {self}", self.name);
        Ok(())
    }
}

impl fmt::Display for Memory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (first, last) = self.ends().unwrap_or_default();
        let (name, looks, slope) = (self.name, self.held.len(), self.slope());
        write!(f, "{name}: {first} KiB warm, {last} KiB at the end, ")?;
        write!(f, "{slope:+.1} KiB/min over {looks} looks")
    }
}

/// What stands behind `VmRSS:`. \[KiB\]
fn resident(status: &str) -> Option<i64> {
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    line.trim().strip_suffix("kB")?.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(held: Vec<(f64, i64)>) -> Memory {
        Memory { held, ..Memory::of("executor", 1) }
    }

    #[test]
    fn growth_is_found_and_standing_still_is_none() {
        let flat = of((0..100).map(|k| (f64::from(k), 5000 + i64::from(k % 3))).collect());
        assert!(flat.slope().abs() < 0.1 && flat.check(100).is_ok(), "{flat}");
        let leak = of((0..100).map(|k| (f64::from(k), 5000 + 20 * i64::from(k))).collect());
        assert!((leak.slope() - 20.0).abs() < 1e-6, "{leak}");
        assert!(leak.check(100).is_err() && of(Vec::new()).check(100).is_err());
    }

    #[test]
    fn this_process_holds_memory() {
        let mut own = Memory::of("test", std::process::id());
        own.look(false).expect("nothing is looked at");
        assert!(own.ends().is_none());
        own.look(true).expect("it is there");
        assert!(own.ends().expect("a look").0 > 0);
        assert!(Memory::of("none", u32::MAX).look(true).is_err());
    }
}
