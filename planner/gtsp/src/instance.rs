//! The instance: clusters of nodes, arc costs between them, the price of a jump, and the tour's ends.

use std::fmt;
use std::sync::Arc;

/// A generalized travelling-salesman instance: visit every cluster once, at one node of each.
///
/// Nodes are named (cluster, node within the cluster). Costs are unitless, may be asymmetric and
/// negative. A finite entry is an arc; `+inf`, or a cluster pair without a block, is *not* an arc:
/// passing there is a **jump**, priced by [`Jump`] and counted apart.
#[derive(Clone)]
pub struct Instance {
    sizes: Vec<usize>,
    offsets: Vec<usize>,
    store: Store,
    jump: Jump,
    ends: Ends,
}

/// Arc costs between the nodes of different clusters.
pub enum Costs {
    /// Row-major n×n over all nodes in cluster order, n = the sum of the sizes. Entries inside one
    /// cluster are never read.
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
    /// The block and its transpose: `rows` = |from|, a symmetric pair of clusters.
    pub fn both_ways(from: usize, to: usize, rows: usize, costs: Vec<f64>) -> [Self; 2] {
        let columns = costs.len() / rows.max(1);
        let transposed = (0..columns)
            .flat_map(|j| (0..rows).map(move |i| (i, j)))
            .map(|(i, j)| costs[i * columns + j])
            .collect();
        [Self { from, to, costs }, Self { from: to, to: from, costs: transposed }]
    }
}

/// Costs from a function of (cluster, node, cluster, node); it must be pure.
#[derive(Clone)]
pub struct OnDemand {
    /// For each cluster the clusters that its arcs enter; `None`: all of them.
    pub neighbours: Option<Vec<Vec<usize>>>,
    /// Cost of the arc, `+inf` where there is none.
    pub cost: CostFn,
}

/// See [`OnDemand::cost`].
pub type CostFn = Arc<dyn Fn(usize, usize, usize, usize) -> f64 + Send + Sync>;

/// Price of going from one cluster to another where no arc exists.
#[derive(Clone, Debug, PartialEq)]
pub enum Jump {
    /// A tour with a jump is infeasible: its total cost is `+inf`.
    Forbidden,
    /// One price for every pair.
    Uniform(f64),
    /// Row-major |clusters|×|clusters|, for example estimates of the transfer motion.
    Table(Vec<f64>),
}

/// How the tour begins and ends.
#[derive(Clone, Debug, PartialEq)]
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

/// A number that a cost can be made of.
pub trait Weight: Copy {
    /// The nearest f64.
    fn to_f64(self) -> f64;
}

macro_rules! weights {
    ($($t:ty),*) => { $(impl Weight for $t { fn to_f64(self) -> f64 { self as f64 } })* };
}
weights!(f32, f64, i16, u16, i32, u32, i64, u64);

impl Costs {
    /// Dense costs from any kind of number.
    pub fn dense<W: Weight>(matrix: &[W]) -> Self {
        Self::Dense(matrix.iter().map(|w| w.to_f64()).collect())
    }
}

/// What is wrong with the parts of an instance.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
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
    /// A cluster index is out of range, or a block joins a cluster with itself.
    #[error("block {from} → {to}: indices must differ and be below {clusters}")]
    BlockIndex {
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
    #[error("{what}: the cost {value} is neither finite nor +inf")]
    Cost {
        /// Where it stands.
        what: String,
        /// The value.
        value: f64,
    },
    /// A jump price is not finite.
    #[error(
        "the jump price {value} is not finite; use Jump::Forbidden where jumps are not allowed"
    )]
    JumpPrice {
        /// The value.
        value: f64,
    },
}

#[derive(Clone)]
enum Store {
    Dense(Arc<[f64]>),
    Blocks { index: Arc<[usize]>, data: Arc<[f64]> },
    OnDemand { adjacent: Option<Arc<[bool]>>, cost: CostFn },
}

const ABSENT: usize = usize::MAX;

impl Instance {
    /// A checked instance of clusters with `sizes` nodes. On-demand costs are not checked here; a
    /// NaN or −inf from them counts as "no arc".
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
                check_costs("start costs", start)?;
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
                    for row in offsets[a]..offsets[a + 1] {
                        let (inside, outside) = (offsets[a], offsets[a + 1]);
                        for range in [0..inside, outside..n] {
                            check_costs(
                                "the dense matrix",
                                &matrix[row * n + range.start..row * n + range.end],
                            )?;
                        }
                    }
                }
                Store::Dense(matrix.into())
            }
            Costs::Blocks(blocks) => pack(sizes, blocks)?,
            Costs::OnDemand(OnDemand { neighbours, cost }) => {
                let adjacent = match neighbours {
                    None => None,
                    Some(lists) => {
                        check_length("the neighbour lists", lists.len(), m)?;
                        let mut table = vec![false; m * m];
                        for (from, list) in lists.iter().enumerate() {
                            for &to in list {
                                if to >= m || to == from {
                                    return Err(InstanceError::BlockIndex {
                                        from,
                                        to,
                                        clusters: m,
                                    });
                                }
                                table[from * m + to] = true;
                            }
                        }
                        Some(table.into())
                    }
                };
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
    pub fn arc(&self, a: usize, i: usize, b: usize, j: usize) -> Option<f64> {
        let cost = match &self.store {
            Store::Dense(matrix) => {
                matrix[(self.offsets[a] + i) * self.nodes() + self.offsets[b] + j]
            }
            Store::Blocks { index, data } => match index[a * self.sizes.len() + b] {
                ABSENT => f64::INFINITY,
                at => data[at + i * self.sizes[b] + j],
            },
            Store::OnDemand { adjacent, cost } => {
                if adjacent.as_ref().is_some_and(|t| !t[a * self.sizes.len() + b]) {
                    f64::INFINITY
                } else {
                    cost(a, i, b, j)
                }
            }
        };
        cost.is_finite().then_some(cost)
    }

    /// Whether some arc may lead from cluster `a` to cluster `b`.
    pub fn adjacent(&self, a: usize, b: usize) -> bool {
        let at = a * self.sizes.len() + b;
        match &self.store {
            Store::Dense(_) => true,
            Store::Blocks { index, .. } => index[at] != ABSENT,
            Store::OnDemand { adjacent, .. } => adjacent.as_ref().is_none_or(|t| t[at]),
        }
    }

    /// Price of a jump from cluster `a` to cluster `b`; `+inf` where jumps are forbidden.
    pub fn jump_price(&self, a: usize, b: usize) -> f64 {
        match &self.jump {
            Jump::Forbidden => f64::INFINITY,
            Jump::Uniform(h) => *h,
            Jump::Table(table) => table[a * self.sizes.len() + b],
        }
    }

    /// Price of a jump from the fixed start of [`Ends::OpenFromCosts`].
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

fn pack(sizes: &[usize], blocks: Vec<Block>) -> Result<Store, InstanceError> {
    let m = sizes.len();
    let mut index = vec![ABSENT; m * m];
    let mut data = Vec::with_capacity(blocks.iter().map(|b| b.costs.len()).sum());
    for Block { from, to, costs } in blocks {
        if from >= m || to >= m || from == to {
            return Err(InstanceError::BlockIndex { from, to, clusters: m });
        }
        if index[from * m + to] != ABSENT {
            return Err(InstanceError::DuplicateBlock { from, to });
        }
        let what = format!("block {from} → {to}");
        check_length(&what, costs.len(), sizes[from] * sizes[to])?;
        check_costs(&what, &costs)?;
        index[from * m + to] = data.len();
        data.extend_from_slice(&costs);
    }
    Ok(Store::Blocks { index: index.into(), data: data.into() })
}

fn check_length(what: &str, found: usize, expected: usize) -> Result<(), InstanceError> {
    if found == expected {
        Ok(())
    } else {
        Err(InstanceError::Length { what: what.to_owned(), found, expected })
    }
}

fn check_costs(what: &str, costs: &[f64]) -> Result<(), InstanceError> {
    match costs.iter().find(|c| c.is_nan() || **c == f64::NEG_INFINITY) {
        None => Ok(()),
        Some(&value) => Err(InstanceError::Cost { what: what.to_owned(), value }),
    }
}

fn check_prices(prices: &[f64]) -> Result<(), InstanceError> {
    match prices.iter().find(|p| !p.is_finite()) {
        None => Ok(()),
        Some(&value) => Err(InstanceError::JumpPrice { value }),
    }
}
