//! Side trips that are not worth their time: where accelerations are limited, each costs some stops.

use super::attempt::{Attempt, Planning, Visit};
use crate::sweep::coverage;

/// Share of the points to sweep that may be left out for it.
const LOSS: f64 = 0.003;

impl Planning<'_> {
    /// How many of the points to sweep may be left out where accelerations are limited.
    pub(super) fn spare(&self) -> usize {
        let whole = self.to_sweep.iter().filter(|counts| **counts).count();
        (LOSS * whole as f64) as usize
    }

    /// Takes ways out of an attempt that lead back to where they began, and stops from its end, those
    /// first that sweep least by themselves, as long as they sweep little together.
    pub(super) fn prune(&self, attempt: &mut Attempt) {
        let left = attempt.left.iter().filter(|left| **left).count();
        let mut spare = self.spare().saturating_sub(left);
        let mut changed = false;
        loop {
            let visits = &mut attempt.sequence.visits;
            let swept: Vec<Vec<u32>> = visits.iter().map(|visit| self.swept(visit)).collect();
            let mut times = vec![0u16; self.to_sweep.len()];
            swept.iter().flatten().for_each(|&i| times[i as usize] += 1);
            let lost = |&(from, to): &(usize, usize)| {
                let mut here = vec![0u16; times.len()];
                swept[from..to].iter().flatten().for_each(|&i| here[i as usize] += 1);
                (0..here.len()).filter(|&i| here[i] > 0 && here[i] == times[i]).count()
            };
            let least = loops(visits).into_iter().map(|range| (lost(&range), range));
            // Of those that sweep as little the longest.
            let least =
                least.min_by_key(|&(lost, (from, to))| (lost, std::cmp::Reverse(to - from)));
            let Some((lost, (from, to))) = least.filter(|(lost, _)| *lost <= spare) else { break };
            spare -= lost;
            visits.drain(from..to);
            changed = true;
        }
        if changed {
            attempt.plan = self.assemble(attempt.method, &attempt.patches, &attempt.sequence);
            attempt.left = self.left(&attempt.plan);
        }
    }

    /// The points to sweep that the way to a stop sweeps and that were not swept before.
    fn swept(&self, visit: &Visit) -> Vec<u32> {
        let tool = self.job.tool.on(self.cell.arm);
        let on_surface = visit.leg.joints.iter().zip(&visit.leg.line).filter(|(_, l)| l.is_some());
        let poses: Vec<_> = on_surface.map(|(q, _)| tool.pose(q)).collect();
        let swept = coverage::swept(self.sight, &poses, &self.job.tool);
        let counts = |i: &u32| {
            let i = *i as usize;
            swept[i] && self.to_sweep[i] && !self.already[i]
        };
        (0..swept.len() as u32).filter(counts).collect()
    }
}

/// The ranges of visits after which the arm is where it was before them, and the last visit.
fn loops(visits: &[Visit]) -> Vec<(usize, usize)> {
    let mut found = Vec::new();
    for from in 1..visits.len() {
        let q = visits[from - 1].sample.q;
        let back = (from..visits.len()).filter(|&to| visits[to].sample.q == q);
        found.extend(back.map(|to| (from, to + 1)));
    }
    if visits.len() > 1 {
        found.push((visits.len() - 1, visits.len()));
    }
    found
}

#[cfg(test)]
mod tests {
    use nullsweep_robot::{Branch, JointVector};

    use super::*;
    use crate::motion::Leg;
    use crate::workcell::Sample;

    #[test]
    fn what_may_be_left_out_ends_where_it_began_or_is_the_last_stop() {
        let at = |x: f64| {
            let q = JointVector::from_fn(|_| x);
            let sample = Sample { q, branch: Branch(0), redundancy: 0.0, heading: 0.0 };
            Visit { patch: 0, sample, leg: Leg { joints: vec![q], line: vec![None] } }
        };
        // To 2 and back to 1, from there to 3 and back again.
        let visits: Vec<Visit> = [1.0, 2.0, 1.0, 3.0, 1.0, 4.0].map(at).into();
        assert_eq!(loops(&visits), [(1, 3), (1, 5), (3, 5), (5, 6)]);
        assert!(loops(&visits[..1]).is_empty());
    }
}
