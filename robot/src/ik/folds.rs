//! Posture signs: which side of its singularities a configuration is on.
//!
//! Two solutions for one target are told apart by the singularities between them. At most singular
//! postures of real arms one joint alone is straight (an elbow, a wrist), wherever the others are;
//! those joints and angles are found here by sampling. The sign of the Jacobian's determinant
//! tells the rest (a shoulder's overhead singularity).

use std::f64::consts::{PI, TAU};

use nalgebra::Matrix6;

use super::spread::spread;
use crate::chain::{Chain, Jacobian};
use crate::{JointVector, MAX_DOF};

/// The fold joints of a chain.
#[derive(Clone, Debug)]
pub(super) struct Folds {
    /// Joint and the angle at which it is straight; half a turn on, it is folded. \[rad\]
    pub(super) joints: Vec<(usize, f64)>,
    columns: Vec<usize>,
}

/// Samples of the other joints for each angle of one.
const SAMPLES: usize = 48;
/// Angles looked at in half a turn.
const ANGLES: usize = 90;
/// A joint folds where the mean determinant is below this part of its largest value.
const DEPTH: f64 = 0.05;
/// Most folds that a branch number can hold.
pub(super) const MOST_FOLDS: usize = 4;

impl Folds {
    /// Samples a chain whose joint `held` does not move.
    pub(super) fn of(chain: &Chain, held: Option<usize>) -> Self {
        let columns: Vec<usize> = (0..chain.dof()).filter(|i| Some(*i) != held).collect();
        let mut folds = Self { joints: Vec::new(), columns };
        if folds.columns.len() != 6 {
            return folds;
        }
        let others: Vec<JointVector> = (0..SAMPLES).map(|k| sample(chain, k)).collect();
        for &joint in &folds.columns.clone() {
            if chain.steps[joint].prismatic {
                continue;
            }
            let mean = |angle: f64| {
                let det = |q: &JointVector| {
                    let mut q = *q;
                    q[joint] = angle;
                    folds.determinant(&chain.jacobian(&q).1).abs()
                };
                others.iter().map(det).sum::<f64>()
            };
            let angle = |k: usize| PI * (k as f64 / ANGLES as f64) - 0.5 * PI;
            let means: Vec<f64> = (0..ANGLES).map(|k| mean(angle(k))).collect();
            let most = means.iter().copied().fold(0.0, f64::max);
            let least = (0..ANGLES).min_by(|&a, &b| means[a].total_cmp(&means[b])).unwrap_or(0);
            if most > 0.0 && means[least] < DEPTH * most && folds.joints.len() < MOST_FOLDS {
                folds.joints.push((joint, angle(least)));
            }
        }
        folds
    }

    /// Bit 0: the determinant is negative; bit 1 + k: fold joint k is on its negative side.
    pub(super) fn signs(&self, q: &JointVector, jacobian: &Jacobian) -> u8 {
        let negative = self.columns.len() == 6 && self.determinant(jacobian) < 0.0;
        u8::from(negative) | self.sides(q) << 1
    }

    /// Bit k: fold joint k is on its negative side.
    pub(super) fn sides(&self, q: &JointVector) -> u8 {
        let side = |k: usize, &(joint, straight): &(usize, f64)| {
            u8::from(libm::sin(q[joint] - straight) < 0.0) << k
        };
        self.joints.iter().enumerate().fold(0, |bits, (k, fold)| bits | side(k, fold))
    }

    /// Configurations near the other postures for the same target.
    pub(super) fn mirrored(
        &self,
        q: &JointVector,
        jacobian: &Jacobian,
        dof: usize,
    ) -> Vec<JointVector> {
        let mut starts = Vec::new();
        for &(joint, straight) in &self.joints {
            let mut alone = *q;
            alone[joint] = 2.0 * straight - q[joint];
            starts.push(alone);
            if joint > 0 && joint + 1 < dof {
                // A wrist comes to the same rotation with half a turn before and after it.
                alone[joint - 1] += PI;
                alone[joint + 1] += PI;
                starts.push(alone);
            }
        }
        if dof >= 6 {
            // A shoulder comes to the same upper arm from behind.
            let mut behind = *q;
            behind[0] += PI;
            starts.push(behind);
            behind[1] = -q[1];
            behind[dof - 3] += PI;
            starts.push(behind);
        }
        if self.columns.len() == 6 {
            // Across the nearest singularity: along the direction that moves the tip least.
            let least = self.least_direction(jacobian);
            for reach in [0.4, -0.4] {
                starts.push(JointVector::from_fn(|i| q[i] + reach * least[i]));
            }
        }
        starts
    }

    /// The unit joint velocity that moves the tip least.
    fn least_direction(&self, jacobian: &Jacobian) -> JointVector {
        let square = self.square(jacobian);
        let eigen = (square.transpose() * square).symmetric_eigen();
        let k = eigen.eigenvalues.imin();
        let mut direction = [0.0; MAX_DOF];
        for (i, &column) in self.columns.iter().enumerate() {
            direction[column] = eigen.eigenvectors[(i, k)];
        }
        JointVector::new(direction)
    }

    fn square(&self, jacobian: &Jacobian) -> Matrix6<f64> {
        let mut square = Matrix6::zeros();
        for (k, &column) in self.columns.iter().enumerate().take(6) {
            square.set_column(k, &jacobian.column(column));
        }
        square
    }

    fn determinant(&self, jacobian: &Jacobian) -> f64 {
        self.square(jacobian).determinant()
    }
}

/// Share of the arm's self-motion that each joint takes, averaged over sampled configurations of
/// an arm with one joint more than a pose has freedoms; sums to about 1.
pub(super) fn self_motion(chain: &Chain) -> [f64; MAX_DOF] {
    let mut shares = [0.0; MAX_DOF];
    for k in 0..SAMPLES {
        let (_, jacobian) = chain.jacobian(&sample(chain, k));
        // By Cramer's rule, joint i moves with the determinant of all other columns.
        let minors: [f64; MAX_DOF] = std::array::from_fn(|i| {
            if i >= chain.dof() {
                return 0.0;
            }
            let columns = (0..chain.dof()).filter(|c| *c != i).collect();
            Folds { joints: Vec::new(), columns }.determinant(&jacobian).abs()
        });
        let sum: f64 = minors.iter().sum();
        for (share, minor) in shares.iter_mut().zip(minors) {
            *share += minor / (sum + f64::MIN_POSITIVE) / SAMPLES as f64;
        }
    }
    shares
}

/// The k-th configuration of a sequence that fills −π … π of each joint evenly.
fn sample(chain: &Chain, k: usize) -> JointVector {
    JointVector::from_fn(|i| if i < chain.dof() { PI * (2.0 * spread(k, i) - 1.0) } else { 0.0 })
}

/// Whether two configurations are one, by whole turns.
pub(super) fn same(a: &JointVector, b: &JointVector, within: f64) -> bool {
    a.iter().zip(b).all(|(a, b)| {
        let d = (a - b).abs().rem_euclid(TAU);
        d.min(TAU - d) < within
    })
}
