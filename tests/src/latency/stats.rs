//! Percentiles of a time, and how they are shown.

use hdrhistogram::Histogram;
use nullsweep_ipc_types::{HISTOGRAM_BUCKETS, bucket_upper_ns};
use serde::Serialize;

/// Longest time that is told apart: one minute. \[ns\]
const LONGEST_NS: u64 = 60_000_000_000;

/// The distribution of a time, every sample counted.
#[derive(Clone, Debug)]
pub struct Times(Histogram<u64>);

/// Percentiles in nanoseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Percentiles {
    /// Number of samples.
    pub count: u64,
    /// Half of all samples are at or below.
    pub p50_ns: u64,
    /// Nine in ten.
    pub p90_ns: u64,
    /// 99 %.
    pub p99_ns: u64,
    /// 99.9 %.
    pub p999_ns: u64,
    /// 99.99 %.
    pub p9999_ns: u64,
    /// The largest.
    pub max_ns: u64,
}

impl Default for Times {
    fn default() -> Self {
        // Three digits over a minute: 200 kB, all of it taken at once.
        Self(Histogram::new_with_max(LONGEST_NS, 3).expect("the bounds are valid constants"))
    }
}

impl Times {
    /// Counts one sample.
    pub fn record(&mut self, ns: u64) {
        self.0.saturating_record(ns);
    }

    /// Counts one value so many times.
    pub fn record_n(&mut self, ns: u64, count: u64) {
        self.0.saturating_record_n(ns, count);
    }

    /// Each value that was recorded, at this resolution, rising, and how often.
    pub fn counts(&self) -> impl Iterator<Item = (u64, u64)> + '_ {
        self.0.iter_recorded().map(|v| (v.value_iterated_to(), v.count_at_value()))
    }

    /// Counts all samples of another distribution.
    pub fn merge(&mut self, other: &Self) {
        self.0.add(&other.0).expect("both have the same bounds");
    }

    /// Its percentiles.
    #[must_use]
    pub fn percentiles(&self) -> Percentiles {
        let at = |quantile| self.0.value_at_quantile(quantile);
        if self.0.is_empty() {
            return Percentiles::default();
        }
        Percentiles {
            count: self.0.len(),
            p50_ns: at(0.5),
            p90_ns: at(0.9),
            p99_ns: at(0.99),
            p999_ns: at(0.999),
            p9999_ns: at(0.9999),
            max_ns: self.0.max(),
        }
    }
}

/// Percentiles of the executor's own histogram: each is the upper bound of its bucket, and the
/// open last bucket counts as the largest that can be told.
#[must_use]
pub fn of_buckets(buckets: &[u32; HISTOGRAM_BUCKETS]) -> Percentiles {
    let mut times = Times::default();
    for (bucket, count) in buckets.iter().enumerate().filter(|(_, count)| **count > 0) {
        times.0.saturating_record_n(bucket_upper_ns(bucket), u64::from(*count));
    }
    // A bucket's bound, not the histogram's: it rounds up to its own resolution.
    let bound = |ns: u64| {
        (0..HISTOGRAM_BUCKETS).map(bucket_upper_ns).rfind(|upper| *upper <= ns).unwrap_or(ns)
    };
    let p = times.percentiles();
    Percentiles {
        count: p.count,
        p50_ns: bound(p.p50_ns),
        p90_ns: bound(p.p90_ns),
        p99_ns: bound(p.p99_ns),
        p999_ns: bound(p.p999_ns),
        p9999_ns: bound(p.p9999_ns),
        max_ns: bound(p.max_ns),
    }
}

impl Percentiles {
    /// The heads of the columns of [`Self::cells`].
    pub const HEADS: [&'static str; 7] = ["n", "p50", "p90", "p99", "p99.9", "p99.99", "max"];

    /// Count and percentiles as text, µs.
    #[must_use]
    pub fn cells(&self) -> [String; 7] {
        let us = |ns: u64| {
            let us = ns as f64 * 1e-3;
            if us < 100.0 { format!("{us:.2}") } else { format!("{us:.0}") }
        };
        [
            self.count.to_string(),
            us(self.p50_ns),
            us(self.p90_ns),
            us(self.p99_ns),
            us(self.p999_ns),
            us(self.p9999_ns),
            us(self.max_ns),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_those_of_the_samples() {
        let mut times = Times::default();
        for ns in 1..=10_000u64 {
            times.record(ns * 100);
        }
        let mut twice = times.clone();
        twice.merge(&times);
        for (p, count) in [(times.percentiles(), 10_000), (twice.percentiles(), 20_000)] {
            assert_eq!(p.count, count);
            for (value, expected) in [
                (p.p50_ns, 500_000.0),
                (p.p90_ns, 900_000.0),
                (p.p99_ns, 990_000.0),
                (p.p999_ns, 999_000.0),
                (p.max_ns, 1e6),
            ] {
                assert!((value as f64 / expected - 1.0).abs() < 2e-3, "{value} for {expected}");
            }
        }
        assert_eq!(Times::default().percentiles(), Percentiles::default());
    }

    #[test]
    fn buckets_give_their_upper_bounds() {
        let mut buckets = [0; HISTOGRAM_BUCKETS];
        buckets[3] = 90;
        buckets[10] = 10;
        let p = of_buckets(&buckets);
        assert_eq!((p.count, p.p50_ns), (100, bucket_upper_ns(3)));
        assert_eq!(
            (p.p90_ns, p.p99_ns, p.max_ns),
            (bucket_upper_ns(3), bucket_upper_ns(10), bucket_upper_ns(10))
        );
    }
}
