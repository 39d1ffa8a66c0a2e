//! What came of each region.

use serde::{Deserialize, Serialize};

use super::region::{Kind, Label, Regions};

/// What came of a region.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RegionFigures {
    /// Its name.
    pub name: String,
    /// What it is for.
    pub kind: Kind,
    /// Points of the surface that belong to it.
    pub points: usize,
    /// Share of them that are passed over as often as is asked for; of what is to be kept out of, at
    /// least once.
    pub coverage: f64,
    /// The same, of those that belong to reachable patches.
    pub coverage_reachable: f64,
}

impl RegionFigures {
    /// Of points with these labels, which the tool passes over so often; some belong to reachable
    /// patches.
    #[must_use]
    pub fn all(
        regions: &Regions,
        labels: &[Label],
        passes: &[u32],
        reachable: &[bool],
    ) -> Vec<Self> {
        let of = |index: usize| {
            let region = &regions.all()[index];
            let (own, wanted) = match region.kind {
                Kind::Sweep(sweep) => (Label::Sweep(index), sweep.passes),
                Kind::KeepOut | Kind::Avoid => (Label::KeepOut(index), 1),
            };
            let points: Vec<usize> = (0..labels.len()).filter(|&i| labels[i] == own).collect();
            let share = |of: &dyn Fn(usize) -> bool| {
                let all = points.iter().filter(|&&i| of(i)).count();
                let hit = points.iter().filter(|&&i| of(i) && passes[i] >= wanted).count();
                if all == 0 { 0.0 } else { hit as f64 / all as f64 }
            };
            Self {
                name: region.name.clone(),
                kind: region.kind,
                points: points.len(),
                coverage: share(&|_| true),
                coverage_reachable: share(&|i| reachable[i]),
            }
        };
        (0..regions.all().len()).map(of).collect()
    }
}
