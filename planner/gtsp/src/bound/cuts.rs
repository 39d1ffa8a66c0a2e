//! Sets of nodes that the chosen links must leave, and where they do not yet.
//!
//! A tour that visits a node j of a set T, outside which a whole cluster lies, leaves T: so it has
//! no more links within T than it visits nodes of T beside j (the generalised subtour elimination of
//! Fischetti, Salazar González & Toth, Oper. Res. 45(3), 1997). In place of j stands a whole cluster
//! where T has one.

use std::collections::VecDeque;

/// Less is no violation worth a price.
const LEAST: f64 = 0.05;

/// A node that lies in a set of at most so many is not asked for one of its own; of larger sets, those
/// are passed over that hold a quarter of all nodes.
const LARGEST: usize = 40;

/// A rule: at most as many links between `members` as times that `counted` ones are left.
pub(super) struct Cut {
    /// For each node, whether it belongs to the set.
    pub(super) members: Vec<bool>,
    /// The members but j, or but a whole cluster.
    pub(super) counted: Vec<u32>,
}

impl Cut {
    /// Whether a link between two nodes lies within the set.
    pub(super) fn has(&self, u: u32, v: u32) -> bool {
        self.members[u as usize] && self.members[v as usize]
    }
}

/// Links between nodes, each with how much of it is chosen.
pub(super) struct Support {
    /// Neighbour, and number of the arc, for each node.
    arcs: Vec<Vec<(u32, u32)>>,
    /// What each arc lets through; arc k ^ 1 goes back.
    full: Vec<f64>,
    /// How often each node is visited.
    visits: Vec<f64>,
    /// The nodes of each cluster.
    whole: Vec<Vec<u32>>,
}

impl Support {
    /// Of `n` nodes in clusters; links from, to and the amount.
    pub(super) fn new(
        cluster: &[u32],
        m: usize,
        links: impl Iterator<Item = (u32, u32, f64)>,
    ) -> Self {
        let n = cluster.len();
        let mut whole = vec![Vec::new(); m];
        for (u, &c) in cluster.iter().enumerate() {
            whole[c as usize].push(u as u32);
        }
        let mut support =
            Self { arcs: vec![Vec::new(); n], full: Vec::new(), visits: vec![0.0; n], whole };
        for (u, v, amount) in links {
            let k = support.full.len() as u32;
            support.arcs[u as usize].push((v, k));
            support.arcs[v as usize].push((u, k + 1));
            // Half of what crosses a set leaves it.
            support.full.extend([0.5 * amount; 2]);
            support.visits[u as usize] += 0.5 * amount;
            support.visits[v as usize] += 0.5 * amount;
        }
        support
    }

    /// Sets that are left less often than they should be, `most` at most: of the nodes on the
    /// shortest ways from some node, `reach` in number, without those of cluster `sink`.
    pub(super) fn violated(
        &mut self,
        cluster: &[u32],
        (sink, reach): (usize, usize),
        most: usize,
    ) -> Vec<Cut> {
        let n = cluster.len();
        let mut order: Vec<usize> = (0..n).filter(|&v| self.visits[v] > LEAST).collect();
        order.sort_by(|&v, &w| self.visits[w].total_cmp(&self.visits[v]).then(v.cmp(&w)));
        let mut found: Vec<(f64, Vec<u32>)> = Vec::new();
        let mut used = vec![false; n];
        let mut flow = Flow::default();
        for j in order {
            if used[j] || cluster[j] as usize == sink {
                continue;
            }
            let barred = |v: u32| cluster[v as usize] as usize == sink;
            let Some(short) = flow.shortage(self, j as u32, reach, &barred) else { continue };
            let inside = flow.side();
            if inside.len() > LARGEST.max(n / 4) {
                continue;
            }
            // Large sets have other ones in them.
            if inside.len() <= LARGEST {
                inside.iter().for_each(|&v| used[v as usize] = true);
            }
            found.push((short, inside));
        }
        found.sort_by(|x, y| y.0.total_cmp(&x.0).then_with(|| x.1.cmp(&y.1)));
        found.dedup();
        let cuts = found.into_iter().filter_map(|(_, inside)| self.cut(cluster, &inside));
        cuts.take(most).collect()
    }

    /// The rule for a set; `None` where no whole cluster lies outside.
    fn cut(&self, cluster: &[u32], inside: &[u32]) -> Option<Cut> {
        let mut members = vec![false; cluster.len()];
        inside.iter().for_each(|&v| members[v as usize] = true);
        let outside = |whole: &Vec<u32>| whole.iter().all(|&v| !members[v as usize]);
        if !self.whole.iter().any(outside) {
            return None;
        }
        let counted = self.counted(cluster, &members, inside);
        Some(Cut { members, counted })
    }

    /// The members but a whole cluster, or but the most visited one.
    fn counted(&self, cluster: &[u32], members: &[bool], inside: &[u32]) -> Vec<u32> {
        let whole = |c: u32| self.whole[c as usize].iter().all(|&v| members[v as usize]);
        let spared = inside.iter().map(|&v| cluster[v as usize]).find(|&c| whole(c));
        let visits = |v: u32| self.visits[v as usize];
        let most = inside.iter().copied().max_by(|&v, &w| visits(v).total_cmp(&visits(w)));
        let kept = |v: &u32| match spared {
            Some(c) => cluster[*v as usize] != c,
            None => Some(*v) != most,
        };
        inside.iter().copied().filter(kept).collect()
    }
}

/// The largest flow from a node out of its surroundings, and the smallest cut with it.
#[derive(Default)]
struct Flow {
    room: Vec<f64>,
    /// The surroundings, and what the last search came to.
    near: Vec<bool>,
    seen: Vec<bool>,
    came: Vec<(u32, u32)>,
    queue: VecDeque<u32>,
}

impl Flow {
    /// By how much `j` is visited more often than its surroundings are left, if that is enough for
    /// a cut.
    fn shortage(
        &mut self,
        support: &Support,
        j: u32,
        reach: usize,
        barred: &dyn Fn(u32) -> bool,
    ) -> Option<f64> {
        let n = support.arcs.len();
        self.room.clone_from(&support.full);
        self.came.resize(n, (0, 0));
        self.near.clear();
        self.near.resize(n, false);
        self.near[j as usize] = true;
        self.queue.clear();
        self.queue.push_back(j);
        let mut count = 1;
        while let Some(u) = self.queue.pop_front() {
            for &(v, _) in &support.arcs[u as usize] {
                if count < reach && !self.near[v as usize] && !barred(v) {
                    self.near[v as usize] = true;
                    self.queue.push_back(v);
                    count += 1;
                }
            }
        }
        let due = support.visits[j as usize] - LEAST;
        let mut flow = 0.0;
        while let Some(end) = self.way_out(support, j) {
            let mut amount = f64::INFINITY;
            let mut at = end;
            while at != j {
                let (u, k) = self.came[at as usize];
                amount = amount.min(self.room[k as usize]);
                at = u;
            }
            at = end;
            while at != j {
                let (u, k) = self.came[at as usize];
                self.room[k as usize] -= amount;
                self.room[k as usize ^ 1] += amount;
                at = u;
            }
            flow += amount;
            if flow >= due {
                return None;
            }
        }
        Some(due + LEAST - flow)
    }

    /// The first node outside the surroundings that something can still flow to.
    fn way_out(&mut self, support: &Support, j: u32) -> Option<u32> {
        self.seen.clear();
        self.seen.resize(support.arcs.len(), false);
        self.seen[j as usize] = true;
        self.queue.clear();
        self.queue.push_back(j);
        while let Some(u) = self.queue.pop_front() {
            if !self.near[u as usize] {
                return Some(u);
            }
            for &(v, k) in &support.arcs[u as usize] {
                if !self.seen[v as usize] && self.room[k as usize] > 1e-9 {
                    self.seen[v as usize] = true;
                    self.came[v as usize] = (u, k);
                    self.queue.push_back(v);
                }
            }
        }
        None
    }

    /// The node's side of the cut.
    fn side(&self) -> Vec<u32> {
        (0..self.seen.len() as u32).filter(|&v| self.seen[v as usize]).collect()
    }
}
