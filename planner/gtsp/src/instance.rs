//! The instance: clusters of nodes, arc costs between them, the price of a jump, and the tour's ends.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use crate::adjacency::{Adjacency, Misfit};

/// A generalised travelling-salesman instance: visit every cluster once, at one node of each.
///
/// Clusters count from 0, nodes from 0 within their cluster. Costs may have any unit, the same as
/// the jump prices; they may be asymmetric and negative. A finite entry is an arc; `+inf`, or a
/// cluster pair without a block, is *not* an arc: passing there is a **jump**, priced by [`Jump`]
/// and counted apart.
///
/// A clone shares the costs.
#[derive(Clone)]
pub struct Instance {
    sizes: Vec<usize>,
    offsets: Vec<usize>,
    store: Store,
    jump: Jump,
    ends: Ends,
}

/// Arc costs between the nodes of different clusters.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Costs {
    /// Row-major n×n over all nodes in cluster order, n = the sum of the sizes; `+inf` where there
    /// is no arc. Entries inside one cluster are never read.
    Dense(Vec<f64>),
    /// Blocks of adjacent cluster pairs only; every other pair is a jump. Give both directions of
    /// a symmetric pair (see [`Block::both_ways`]).
    Blocks(Vec<Block>),
    /// Costs computed when asked for, for example from coordinates.
    OnDemand(OnDemand),
}

/// Costs from every node of one cluster to every node of another.
#[derive(Clone, Debug)]
pub struct Block {
    /// Cluster that the arcs leave.
    pub from: usize,
    /// Cluster that the arcs enter.
    pub to: usize,
    /// Row-major |from|×|to|; `+inf` where there is no arc.
    pub costs: Vec<f64>,
}

impl Block {
    /// The block and its transpose, for a symmetric pair of clusters: `rows` = |from|, `costs` as in
    /// [`Block::costs`]. [`Instance::new`] finds a length that does not fit.
    pub fn both_ways(from: usize, to: usize, rows: usize, costs: Vec<f64>) -> [Self; 2] {
        let columns = costs.len() / rows.max(1);
        let transposed = (0..columns)
            .flat_map(|j| (0..rows).map(move |i| (i, j)))
            .map(|(i, j)| costs[i * columns + j])
            .collect();
        [Self { from, to, costs }, Self { from: to, to: from, costs: transposed }]
    }
}

/// Costs from a function. The solver reads them at the start and keeps a copy; later it asks only
/// for the arcs of tours that it has found.
#[derive(Clone)]
pub struct OnDemand {
    /// For each cluster the clusters that its arcs enter; `None`: all of them.
    pub neighbours: Option<Vec<Vec<usize>>>,
    /// Cost of the arc, `+inf` where there is none.
    pub cost: CostFn,
}

impl fmt::Debug for OnDemand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("OnDemand").field("neighbours", &self.neighbours).finish_non_exhaustive()
    }
}

/// Cost of the arc from (cluster, node) to (cluster, node), in this order of arguments. It must be
/// pure: the same for the same arguments.
pub type CostFn = Arc<dyn Fn(usize, usize, usize, usize) -> f64 + Send + Sync>;

/// Price of going from one cluster to another where no arc exists, in the unit of the costs.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Jump {
    /// A tour with a jump is infeasible: its total cost is `+inf`.
    Forbidden,
    /// One price for every pair.
    Uniform(f64),
    /// Row-major |clusters|×|clusters|: a price for every ordered pair, that of the diagonal unused.
    Table(Vec<f64>),
}

/// How the tour begins and ends.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Ends {
    /// A closed tour.
    Closed,
    /// An open path from a fixed start outside the clusters: cost from it to every node, in cluster
    /// order (length n). `+inf`: that node cannot be first without a jump, which costs the uniform
    /// price or the largest of the table. Zeros: a free start.
    OpenFromCosts(Vec<f64>),
    /// An open path whose first cluster is this one, usually of one node: the start.
    OpenFromCluster(usize),
}

/// What is wrong with the parts of an instance.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InstanceError {
    /// There is nothing to visit.
    #[error("the instance has no clusters: give at least one")]
    NoClusters,
    /// A cluster without nodes can never be visited.
    #[error("cluster {cluster} has no nodes: leave it out")]
    EmptyCluster {
        /// Its index.
        cluster: usize,
    },
    /// An array has the wrong length.
    #[error("{what} has {found} entries, expected {expected}")]
    Length {
        /// Which array.
        what: String,
        /// Entries found.
        found: usize,
        /// Entries needed.
        expected: usize,
    },
    /// A cluster index of a block or neighbour list is out of range, or joins a cluster with itself.
    #[error("arcs from cluster {from} to {to}: the two must differ and be below {clusters}")]
    ClusterPair {
        /// Cluster left.
        from: usize,
        /// Cluster entered.
        to: usize,
        /// Number of clusters.
        clusters: usize,
    },
    /// Two blocks for one directed pair.
    #[error("block {from} → {to} is given twice")]
    DuplicateBlock {
        /// Cluster left.
        from: usize,
        /// Cluster entered.
        to: usize,
    },
    /// The start cluster does not exist.
    #[error("start cluster {cluster} is not below {clusters}")]
    StartCluster {
        /// The index given.
        cluster: usize,
        /// Number of clusters.
        clusters: usize,
    },
    /// A cost is NaN or −inf.
    #[error("{what}, entry {entry}: the cost {value} is neither finite nor +inf")]
    Cost {
        /// Which array.
        what: String,
        /// Index of the entry, from 0.
        entry: usize,
        /// The value.
        value: f64,
    },
    /// A jump price is not finite.
    #[error(
        "jump price {value} of entry {entry} is not finite; use Jump::Forbidden to allow no jumps"
    )]
    JumpPrice {
        /// Index of the entry of a table, 0 for a uniform price.
        entry: usize,
        /// The value.
        value: f64,
    },
}

#[derive(Clone)]
enum Store {
    Dense(Arc<[f64]>),
    /// Where each pair's block begins in `data`.
    Blocks {
        adjacent: Adjacency,
        starts: Arc<[usize]>,
        data: Arc<[f64]>,
    },
    OnDemand {
        adjacent: Option<Adjacency>,
        cost: CostFn,
    },
}

impl Instance {
    /// A checked instance of clusters with `sizes` nodes. On-demand costs are not checked here; a
    /// NaN or −inf from them counts as "no arc".
    ///
    /// # Errors
    /// Where a cluster is empty, an array has the wrong length, an index is out of range, or a cost
    /// or price is not a number that can be used.
    pub fn new(
        sizes: &[usize],
        costs: Costs,
        jump: Jump,
        ends: Ends,
    ) -> Result<Self, InstanceError> {
        if sizes.is_empty() {
            return Err(InstanceError::NoClusters);
        }
        if let Some(cluster) = sizes.iter().position(|&s| s == 0) {
            return Err(InstanceError::EmptyCluster { cluster });
        }
        let mut offsets = vec![0];
        for s in sizes {
            offsets.push(offsets[offsets.len() - 1] + s);
        }
        let (m, n) = (sizes.len(), offsets[sizes.len()]);
        match &jump {
            Jump::Forbidden => {}
            Jump::Uniform(h) => check_prices(&[*h])?,
            Jump::Table(table) => {
                check_length("the jump table", table.len(), m * m)?;
                check_prices(table)?;
            }
        }
        match &ends {
            Ends::Closed => {}
            Ends::OpenFromCosts(start) => {
                check_length("the start costs", start.len(), n)?;
                check_costs("the start costs", start, 0..n)?;
            }
            &Ends::OpenFromCluster(cluster) if cluster >= m => {
                return Err(InstanceError::StartCluster { cluster, clusters: m });
            }
            Ends::OpenFromCluster(_) => {}
        }
        let store = match costs {
            Costs::Dense(matrix) => {
                check_length("the dense matrix", matrix.len(), n * n)?;
                for a in 0..m {
                    let (inside, outside) = (offsets[a], offsets[a + 1]);
                    for row in inside..outside {
                        for range in [row * n..row * n + inside, row * n + outside..(row + 1) * n] {
                            check_costs("the dense matrix", &matrix, range)?;
                        }
                    }
                }
                Store::Dense(matrix.into())
            }
            Costs::Blocks(blocks) => pack(sizes, blocks)?,
            Costs::OnDemand(OnDemand { neighbours, cost }) => {
                let adjacent = neighbours.map(|lists| adjacency(m, lists)).transpose()?;
                Store::OnDemand { adjacent, cost }
            }
        };
        Ok(Self { sizes: sizes.to_vec(), offsets, store, jump, ends })
    }

    /// Number of nodes of each cluster.
    pub fn sizes(&self) -> &[usize] {
        &self.sizes
    }

    /// Number of clusters.
    pub fn clusters(&self) -> usize {
        self.sizes.len()
    }

    /// Number of nodes in all clusters.
    pub fn nodes(&self) -> usize {
        self.offsets[self.sizes.len()]
    }

    /// Index of a node among all nodes in cluster order.
    ///
    /// # Panics
    /// Where there is no such cluster.
    pub fn node_index(&self, cluster: usize, node: usize) -> usize {
        self.offsets[cluster] + node
    }

    /// How the tour begins and ends.
    pub fn ends(&self) -> &Ends {
        &self.ends
    }

    /// How jumps are priced.
    pub fn jump(&self) -> &Jump {
        &self.jump
    }

    /// Cost of the arc from node `i` of cluster `a` to node `j` of another cluster `b`; `None`
    /// where only a jump leads there.
    ///
    /// # Panics
    /// May panic where a cluster or node does not exist.
    pub fn arc(&self, a: usize, i: usize, b: usize, j: usize) -> Option<f64> {
        let cost = match &self.store {
            Store::Dense(matrix) => {
                matrix[(self.offsets[a] + i) * self.nodes() + self.offsets[b] + j]
            }
            Store::Blocks { adjacent, starts, data } => match adjacent.number(a, b) {
                None => f64::INFINITY,
                Some(pair) => data[starts[pair] + i * self.sizes[b] + j],
            },
            Store::OnDemand { cost, .. } if self.adjacent(a, b) => cost(a, i, b, j),
            Store::OnDemand { .. } => f64::INFINITY,
        };
        cost.is_finite().then_some(cost)
    }

    /// Whether some arc may lead from cluster `a` to another cluster `b`.
    ///
    /// # Panics
    /// May panic where a cluster does not exist.
    pub fn adjacent(&self, a: usize, b: usize) -> bool {
        let joins = |adjacent: &Adjacency| adjacent.number(a, b).is_some();
        match &self.store {
            Store::Dense(_) => true,
            Store::Blocks { adjacent, .. } => joins(adjacent),
            Store::OnDemand { adjacent, .. } => adjacent.as_ref().is_none_or(joins),
        }
    }

    /// Price of a jump from cluster `a` to cluster `b`; `+inf` where jumps are forbidden.
    ///
    /// # Panics
    /// May panic where a cluster does not exist.
    pub fn jump_price(&self, a: usize, b: usize) -> f64 {
        match &self.jump {
            Jump::Forbidden => f64::INFINITY,
            Jump::Uniform(h) => *h,
            Jump::Table(table) => table[a * self.sizes.len() + b],
        }
    }

    /// Price of a jump from the fixed start of [`Ends::OpenFromCosts`]: the uniform price or the
    /// largest of the table, `+inf` where jumps are forbidden.
    pub fn start_jump_price(&self) -> f64 {
        match &self.jump {
            Jump::Forbidden => f64::INFINITY,
            Jump::Uniform(h) => *h,
            Jump::Table(table) => table.iter().copied().fold(0.0, f64::max),
        }
    }
}

impl fmt::Debug for Instance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Instance")
            .field("clusters", &self.clusters())
            .field("nodes", &self.nodes())
            .finish_non_exhaustive()
    }
}

/// Packs blocks into one array, checked.
fn pack(sizes: &[usize], blocks: Vec<Block>) -> Result<Store, InstanceError> {
    let pairs = blocks.iter().map(|block| (block.from, block.to)).collect();
    let adjacent = joined(sizes.len(), pairs)?;
    let mut starts = vec![0; adjacent.len()];
    let mut data = Vec::with_capacity(blocks.iter().map(|b| b.costs.len()).sum());
    for Block { from, to, costs } in blocks {
        let what = format!("block {from} → {to}");
        check_length(&what, costs.len(), sizes[from] * sizes[to])?;
        check_costs(&what, &costs, 0..costs.len())?;
        if let Some(pair) = adjacent.number(from, to) {
            starts[pair] = data.len();
        }
        data.extend_from_slice(&costs);
    }
    Ok(Store::Blocks { adjacent, starts: starts.into(), data: data.into() })
}

/// The cluster pairs that neighbour lists join.
fn adjacency(m: usize, lists: Vec<Vec<usize>>) -> Result<Adjacency, InstanceError> {
    check_length("the neighbour lists", lists.len(), m)?;
    let listed = lists.into_iter().enumerate().flat_map(|(from, mut list)| {
        list.sort_unstable();
        list.dedup();
        list.into_iter().map(move |to| (from, to))
    });
    joined(m, listed.collect())
}

fn joined(m: usize, pairs: Vec<(usize, usize)>) -> Result<Adjacency, InstanceError> {
    Adjacency::new(m, pairs).map_err(|misfit| match misfit {
        Misfit::Clusters(from, to) => InstanceError::ClusterPair { from, to, clusters: m },
        Misfit::Twice(from, to) => InstanceError::DuplicateBlock { from, to },
    })
}

fn check_length(what: &str, found: usize, expected: usize) -> Result<(), InstanceError> {
    if found == expected {
        Ok(())
    } else {
        Err(InstanceError::Length { what: what.to_owned(), found, expected })
    }
}

/// Checks the costs of a range of an array.
fn check_costs(what: &str, array: &[f64], range: Range<usize>) -> Result<(), InstanceError> {
    let wrong = |c: &f64| c.is_nan() || *c == f64::NEG_INFINITY;
    match array[range.clone()].iter().position(wrong) {
        None => Ok(()),
        Some(k) => {
            let entry = range.start + k;
            Err(InstanceError::Cost { what: what.to_owned(), entry, value: array[entry] })
        }
    }
}

fn check_prices(prices: &[f64]) -> Result<(), InstanceError> {
    match prices.iter().position(|p| !p.is_finite()) {
        None => Ok(()),
        Some(entry) => Err(InstanceError::JumpPrice { entry, value: prices[entry] }),
    }
}
