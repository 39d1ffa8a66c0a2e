//! A goal in place of one that a controller is under way with, for controllers that take the new one at
//! once.

use crate::whole::Goal;

impl Goal {
    /// The goal with what is still ahead of `old` before it, up to where it takes over: from the last
    /// point that is passed at `now_ns` on, so that it makes no difference when the controller gets it.
    pub(crate) fn behind(self, old: &Self, now_ns: u64) -> Self {
        let passed = old.points.iter().rposition(|p| old.start_ns + p.after_ns <= now_ns);
        let ahead = &old.points[passed.unwrap_or(0)..];
        let Some(first) = ahead.first() else { return self };
        let start_ns = old.start_ns + first.after_ns;
        let until = |p: &&crate::Point| old.start_ns + p.after_ns <= self.start_ns;
        let before = ahead.iter().take_while(until).map(|p| (old.start_ns + p.after_ns, p));
        let after = self.points.iter().map(|p| (self.start_ns + p.after_ns, p));
        let points = before
            .chain(after)
            .map(|(at_ns, p)| crate::Point { after_ns: at_ns - start_ns, ..*p })
            .collect();
        Self { start_ns, points, ..self }
    }
}

#[cfg(test)]
mod tests {
    use nullsweep_robot::JointVector;

    use super::*;
    use crate::Point;

    const MS: u64 = 1_000_000;

    fn goal(start_ms: u64, points: &[(u64, f64)]) -> Goal {
        let point = |&(ms, at): &(u64, f64)| Point {
            after_ns: ms * MS,
            q: JointVector::from_fn(|j| if j == 0 { at } else { 0.0 }),
            v: JointVector::ZERO,
        };
        let points = points.iter().map(point).collect();
        Goal { id: "new".into(), start_ns: start_ms * MS, until_ns: 0, points, curved: true }
    }

    fn shown(goal: &Goal) -> (u64, Vec<(u64, f64)>) {
        let points = goal.points.iter().map(|p| (p.after_ns / MS, p.q[0])).collect();
        (goal.start_ns / MS, points)
    }

    #[test]
    fn what_is_ahead_of_the_old_one_comes_before_the_new_one() {
        let old = goal(1000, &[(0, 0.0), (100, 0.1), (200, 0.2), (300, 0.3), (400, 0.4)]);
        // Taken over in the old one's point at 1300 ms, which the new one does not repeat.
        let new = || goal(1300, &[(50, 0.5), (90, 0.6)]);
        let joined = [(0, 0.1), (100, 0.2), (200, 0.3), (250, 0.5), (290, 0.6)];
        for now in [1100, 1199] {
            let found = new().behind(&old, now * MS);
            assert_eq!(shown(&found), (1100, joined.to_vec()), "at {now}");
        }
        assert_eq!(new().behind(&old, 0).points.len(), 6, "it has not begun");
        // And one more, while that is under way.
        let third = goal(1390, &[(10, 0.7)]).behind(&new().behind(&old, 1199 * MS), 1280 * MS);
        assert_eq!(
            shown(&third),
            (1200, vec![(0, 0.2), (100, 0.3), (150, 0.5), (190, 0.6), (200, 0.7)])
        );
    }
}
