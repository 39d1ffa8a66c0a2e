//! Clusters of joint vectors and the cost from one to another.

use nullsweep_robot::{Branch, Continuous, JointVector, MAX_DOF};
use wide::f32x8;

use crate::cost::Cost;
use crate::workcell::Sample;

/// Lanes that a group of eight samples takes: their joints, then their branch.
const STRIDE: usize = MAX_DOF + 1;

/// The samples of one tool place, at all its headings.
#[derive(Clone, Debug)]
pub struct Cluster {
    samples: Vec<Sample>,
    /// Where a new heading begins, and the end.
    groups: Vec<usize>,
    /// Eight samples after another; the last one fills the last eight.
    lanes: Vec<f32x8>,
}

impl Cluster {
    /// The samples, those of one heading side by side.
    #[must_use]
    pub fn new(samples: Vec<Sample>) -> Self {
        let starts =
            (0..samples.len()).filter(|&i| i == 0 || samples[i].heading != samples[i - 1].heading);
        let groups = starts.chain([samples.len()]).collect();
        let mut lanes = Vec::with_capacity(samples.len().div_ceil(8) * STRIDE);
        for eight in samples.chunks(8) {
            let at = |k: usize| &eight[k.min(eight.len() - 1)];
            for j in 0..MAX_DOF {
                lanes.push(f32x8::from(std::array::from_fn(|k| at(k).q[j] as f32)));
            }
            lanes.push(f32x8::from(std::array::from_fn(|k| f32::from(at(k).branch.0))));
        }
        Self { samples, groups, lanes }
    }

    /// One joint vector, where the arm is: of no branch, so that every way from it counts as a
    /// change of branch where that is expensive.
    #[must_use]
    pub fn at(q: JointVector) -> Self {
        Self::new(vec![Sample { q, branch: Branch(u8::MAX), redundancy: 0.0, heading: 0.0 }])
    }

    /// The samples.
    #[must_use]
    pub fn samples(&self) -> &[Sample] {
        &self.samples
    }

    /// Index ranges of the samples that share a heading.
    pub fn headings(&self) -> impl Iterator<Item = std::ops::Range<usize>> + '_ {
        self.groups.windows(2).map(|w| w[0]..w[1])
    }

    /// Groups of eight samples, the last one filled up.
    pub(super) fn eights(&self) -> usize {
        self.samples.len().div_ceil(8)
    }

    /// Bytes that it takes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(&self.samples[..])
            + size_of_val(&self.groups[..])
            + size_of_val(&self.lanes[..])
    }
}

/// The cost of the straight joint motion between two samples, and of a change of branch.
pub struct Metric<'a, C> {
    cost: &'a C,
    continuous: Continuous,
    /// A whole turn of each continuous joint, infinite for the others.
    period: [f32; MAX_DOF],
    dof: usize,
    /// Added where the branches differ.
    change: f64,
}

impl<'a, C: Cost> Metric<'a, C> {
    /// For an arm of `dof` joints. `change` is added where the branches of two samples differ: 0 in
    /// the paper's model, else what leaving the surface costs.
    #[must_use]
    pub fn new(cost: &'a C, continuous: Continuous, dof: usize, change: f64) -> Self {
        let turn = std::f32::consts::TAU;
        let period = std::array::from_fn(|j| if continuous.is(j) { turn } else { f32::INFINITY });
        Self { cost, continuous, period, dof, change }
    }

    /// The cost from one sample to another.
    #[must_use]
    pub fn between(&self, a: &Sample, b: &Sample) -> f64 {
        let change = if a.branch == b.branch { 0.0 } else { self.change };
        self.straight(&a.q, &b.q) + change
    }

    /// The cost of the straight joint motion.
    #[must_use]
    pub fn straight(&self, a: &JointVector, b: &JointVector) -> f64 {
        self.cost.of(&self.continuous.displacement(a, b))
    }

    /// For each sample of `to` the cost of the straight motion from the nearest sample of `from`, in
    /// single precision; a change of branch is counted.
    #[must_use]
    pub fn nearest(&self, from: &Cluster, to: &Cluster) -> Vec<f32> {
        let mut out = vec![f32x8::splat(f32::INFINITY); to.eights()];
        let labels = vec![0.0; from.samples.len()];
        self.relax(from, &labels, 0.0, to, 0, &mut out);
        out.into_iter().flat_map(f32x8::to_array).take(to.samples.len()).collect()
    }

    /// Lowers `out`, the labels of `to` from its group `first` on, to what the labels of `from`
    /// allow: out[b] = min over a of labels[a] + extra + cost(a, b).
    pub(super) fn relax(
        &self,
        from: &Cluster,
        labels: &[f32],
        extra: f32,
        to: &Cluster,
        first: usize,
        out: &mut [f32x8],
    ) {
        let change = f32x8::splat(self.change as f32);
        let mut d = [f32x8::ZERO; MAX_DOF];
        for (sample, &label) in from.samples.iter().zip(labels) {
            let q = sample.q.map(|q| f32x8::splat(q as f32));
            let branch = f32x8::splat(f32::from(sample.branch.0));
            let label = f32x8::splat(label + extra);
            for (eight, out) in out.iter_mut().enumerate() {
                let lanes = &to.lanes[(first + eight) * STRIDE..][..STRIDE];
                for j in 0..self.dof {
                    let raw = (lanes[j] - q[j]).abs();
                    d[j] = raw.fast_min((f32x8::splat(self.period[j]) - raw).abs());
                }
                let mut cost = label + self.cost.of_eight(&d);
                if self.change > 0.0 {
                    cost += change & lanes[MAX_DOF].simd_ne(branch);
                }
                *out = out.fast_min(cost);
            }
        }
    }
}
