//! The prices of breaking a tour's rules, and their ascent.

use super::cuts::Cut;

/// How much of the last direction goes into the next one.
const MEMORY: f64 = 0.7;
/// Steps without a price after which a set is forgotten.
const FORGOTTEN: u32 = 300;
/// No rule.
const NONE: u32 = u32::MAX;

/// A link between two nodes, in a direction where costs are asymmetric.
#[derive(Clone, Copy)]
pub(super) struct Link {
    pub(super) from: u32,
    pub(super) to: u32,
    pub(super) cost: f64,
    /// The rules about each of its nodes and the other one's cluster.
    turns: [u32; 2],
}

/// Prices of links by their ends. Half of each link at a node counts as leaving it where costs are
/// symmetric. What is chosen then keeps the rules where
/// - each cluster is left once,
/// - each node is left as often as it is entered,
/// - a node has no more links with one cluster than it is left: it is left to another one than it
///   was entered from,
///
/// and for some sets of nodes what [`Cut`] says.
pub(super) struct Prices {
    m: usize,
    symmetric: bool,
    /// Cluster of each node.
    cluster: Vec<u32>,
    /// For leaving each cluster.
    clusters: Vec<Rule>,
    /// For leaving each node, and the reward for entering it; 0 where costs are symmetric.
    nodes: Vec<Rule>,
    /// For links of a node with one cluster, at least 0; the rule of each pair of them, row-major.
    turns: Vec<Turn>,
    turn_prices: Vec<f64>,
    turn_of: Vec<u32>,
    cuts: Vec<PricedCut>,
    /// What each link costs for lying within sets.
    within: Vec<f64>,
    /// What the links that leave and enter a node cost by all the rest.
    leave: Vec<f64>,
    enter: Vec<f64>,
    /// How often each node is left and entered.
    left: Vec<f64>,
    entered: Vec<f64>,
}

#[derive(Clone, Copy, Default)]
struct Rule {
    price: f64,
    direction: f64,
}

struct Turn {
    node: u32,
    cluster: u32,
    direction: f64,
    links: f64,
}

struct PricedCut {
    cut: Cut,
    /// The links within it.
    links: Vec<u32>,
    rule: Rule,
    /// Steps since it had a price.
    idle: u32,
}

fn blend(direction: &mut f64, slope: f64) {
    *direction = MEMORY * *direction + (1.0 - MEMORY) * slope;
}

impl Prices {
    /// No prices, for nodes of these clusters.
    pub(super) fn new(cluster: Vec<u32>, m: usize, symmetric: bool) -> Self {
        let n = cluster.len();
        Self {
            m,
            symmetric,
            clusters: vec![Rule::default(); m],
            nodes: vec![Rule::default(); n],
            turns: Vec::new(),
            turn_prices: Vec::new(),
            turn_of: vec![NONE; n * m],
            cuts: Vec::new(),
            within: Vec::new(),
            leave: vec![0.0; n],
            enter: vec![0.0; n],
            left: vec![0.0; n],
            entered: vec![0.0; n],
            cluster,
        }
    }

    /// A link whose rules are priced from now on; it has the next number.
    pub(super) fn link(&mut self, from: u32, to: u32, cost: f64) -> Link {
        let turns = [(from, to), (to, from)].map(|(node, other)| {
            let cluster = self.cluster[other as usize];
            let slot = &mut self.turn_of[node as usize * self.m + cluster as usize];
            if *slot == NONE {
                *slot = self.turns.len() as u32;
                self.turns.push(Turn { node, cluster, direction: 0.0, links: 0.0 });
                self.turn_prices.push(0.0);
            }
            *slot
        });
        let mut within = 0.0;
        for cut in self.cuts.iter_mut().filter(|c| c.cut.has(from, to)) {
            cut.links.push(self.within.len() as u32);
            within += cut.rule.price;
        }
        self.within.push(within);
        Link { from, to, cost, turns }
    }

    /// Has sets of nodes priced.
    pub(super) fn add_cuts(&mut self, cuts: Vec<Cut>, links: &[Link]) {
        self.cuts.retain(|cut| cut.idle < FORGOTTEN);
        for cut in cuts {
            let links = (0..links.len()).filter(|&k| cut.has(links[k].from, links[k].to));
            let links = links.map(|k| k as u32).collect();
            self.cuts.push(PricedCut { cut, links, rule: Rule::default(), idle: 0 });
        }
    }

    /// Cost and prices of link number `k`.
    #[inline]
    pub(super) fn priced(&self, k: usize, link: &Link) -> f64 {
        let [x, y] = link.turns;
        let ends = self.leave[link.from as usize] + self.enter[link.to as usize];
        let turns = self.turn_prices[x as usize] + self.turn_prices[y as usize];
        link.cost + ends + turns + self.within[k]
    }

    /// Adds the prices to the costs of all links, row-major.
    pub(super) fn add_to_all(&self, costs: &mut [f64]) {
        let (n, m) = (self.cluster.len(), self.m);
        let mut turns = vec![0.0; n * m];
        for (turn, price) in self.turns.iter().zip(&self.turn_prices) {
            turns[turn.node as usize * m + turn.cluster as usize] = *price;
        }
        for u in 0..n {
            let a = self.cluster[u] as usize;
            for (v, cost) in costs[u * n..(u + 1) * n].iter_mut().enumerate() {
                let b = self.cluster[v] as usize;
                *cost += self.leave[u] + self.enter[v] + turns[u * m + b] + turns[v * m + a];
            }
        }
        for PricedCut { cut, rule, .. } in self.cuts.iter().filter(|cut| cut.rule.price > 0.0) {
            let inside: Vec<usize> = (0..n).filter(|&v| cut.members[v]).collect();
            for &u in &inside {
                for &v in &inside {
                    costs[u * n + v] += rule.price;
                }
            }
        }
    }

    /// What the prices make every tour cost more at most.
    pub(super) fn total(&self) -> f64 {
        self.clusters.iter().map(|rule| rule.price).sum()
    }

    /// A step in the direction in which the chosen links, given by their numbers, break the rules,
    /// by so much that the bound may rise by `rise`.
    pub(super) fn step(&mut self, links: &[Link], chosen: &[bool], rise: f64) {
        self.count(links, chosen);
        let squares = self.turn_directions(chosen);
        self.go(rise / squares.max(1e-9));
    }

    /// Counts what the chosen links leave and enter.
    fn count(&mut self, links: &[Link], chosen: &[bool]) {
        self.left.fill(0.0);
        self.entered.fill(0.0);
        let share = if self.symmetric { 0.5 } else { 1.0 };
        for (link, _) in links.iter().zip(chosen).filter(|(_, chosen)| **chosen) {
            self.left[link.from as usize] += share;
            let end = if self.symmetric { &mut self.left } else { &mut self.entered };
            end[link.to as usize] += share;
            link.turns.iter().for_each(|&k| self.turns[k as usize].links += 1.0);
        }
    }

    /// Turns the directions towards what was counted; the sum of the squares of the slopes.
    fn turn_directions(&mut self, chosen: &[bool]) -> f64 {
        let mut squares = 0.0;
        let mut slopes = vec![-1.0; self.m];
        for (left, &c) in self.left.iter().zip(&self.cluster) {
            slopes[c as usize] += left;
        }
        for (rule, slope) in self.clusters.iter_mut().zip(slopes) {
            squares += slope * slope;
            blend(&mut rule.direction, slope);
        }
        if !self.symmetric {
            for (rule, (left, entered)) in
                self.nodes.iter_mut().zip(self.left.iter().zip(&self.entered))
            {
                squares += (left - entered).powi(2);
                blend(&mut rule.direction, left - entered);
            }
        }
        // A price of 0 cannot fall.
        let mut bounded = |price: f64, direction: &mut f64, slope: f64| {
            if slope > 0.0 || price > 0.0 {
                squares += slope * slope;
            }
            blend(direction, slope);
        };
        for (turn, price) in self.turns.iter_mut().zip(&self.turn_prices) {
            let slope = std::mem::take(&mut turn.links) - self.left[turn.node as usize];
            bounded(*price, &mut turn.direction, slope);
        }
        for PricedCut { cut, links, rule, .. } in &mut self.cuts {
            let within = links.iter().filter(|&&k| chosen[k as usize]).count() as f64;
            let counted = cut.counted.iter().map(|&v| self.left[v as usize]).sum::<f64>();
            bounded(rule.price, &mut rule.direction, within - counted);
        }
        squares
    }

    /// Goes so far in the directions, and finds what links then cost.
    fn go(&mut self, length: f64) {
        // The rewards of the nodes for being left.
        let mut reward = vec![0.0; self.cluster.len()];
        for (turn, price) in self.turns.iter().zip(&mut self.turn_prices) {
            *price = (*price + length * turn.direction).max(0.0);
            reward[turn.node as usize] += *price;
        }
        self.within.fill(0.0);
        for PricedCut { cut, links, rule, idle } in &mut self.cuts {
            rule.price = (rule.price + length * rule.direction).max(0.0);
            *idle = if rule.price > 0.0 { 0 } else { *idle + 1 };
            if rule.price > 0.0 {
                cut.counted.iter().for_each(|&v| reward[v as usize] += rule.price);
                links.iter().for_each(|&k| self.within[k as usize] += rule.price);
            }
        }
        for rule in self.clusters.iter_mut().chain(&mut self.nodes) {
            rule.price += length * rule.direction;
        }
        for (u, reward) in reward.into_iter().enumerate() {
            let price = self.clusters[self.cluster[u] as usize].price - reward;
            if self.symmetric {
                (self.leave[u], self.enter[u]) = (0.5 * price, 0.5 * price);
            } else {
                let balance = self.nodes[u].price;
                (self.leave[u], self.enter[u]) = (price + balance, -balance);
            }
        }
    }
}
