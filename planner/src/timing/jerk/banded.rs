//! Symmetric systems with two bands beside the diagonal.

/// A symmetric, positive definite matrix: row by row the diagonal, and what stands one and two
/// columns to its right.
pub(super) struct Banded {
    rows: Vec<[f64; 3]>,
}

impl Banded {
    /// All zero.
    pub(super) fn zero(size: usize) -> Self {
        Self { rows: vec![[0.0; 3]; size] }
    }

    /// Adds to an entry at or right of the diagonal.
    #[inline]
    pub(super) fn add(&mut self, row: usize, right: usize, value: f64) {
        self.rows[row][right] += value;
    }

    /// Solves in place by L D Lᵀ; the right side becomes the solution.
    pub(super) fn solve(mut self, x: &mut [f64]) {
        let n = self.rows.len();
        for i in 0..n {
            let [d, a, b] = self.rows[i];
            let d = if d > 0.0 { d } else { f64::MIN_POSITIVE };
            let (l1, l2) = (a / d, b / d);
            if i + 1 < n {
                self.rows[i + 1][0] -= l1 * a;
                self.rows[i + 1][1] -= l1 * b;
                x[i + 1] -= l1 * x[i];
            }
            if i + 2 < n {
                self.rows[i + 2][0] -= l2 * b;
                x[i + 2] -= l2 * x[i];
            }
            self.rows[i] = [d, l1, l2];
        }
        for i in (0..n).rev() {
            let [d, l1, l2] = self.rows[i];
            let one = if i + 1 < n { l1 * x[i + 1] } else { 0.0 };
            let two = if i + 2 < n { l2 * x[i + 2] } else { 0.0 };
            x[i] = x[i] / d - one - two;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_solution_solves() {
        let n = 9;
        let entry = |i: usize, j: usize| match i.abs_diff(j) {
            0 => 5.0 + i as f64,
            1 => -1.0 - 0.1 * i.min(j) as f64,
            2 => 0.7,
            _ => 0.0,
        };
        let mut matrix = Banded::zero(n);
        for i in 0..n {
            for right in 0..3 {
                if i + right < n {
                    matrix.add(i, right, entry(i, i + right));
                }
            }
        }
        let wanted: Vec<f64> = (0..n).map(|i| (i as f64).sin()).collect();
        let mut x: Vec<f64> =
            (0..n).map(|i| (0..n).map(|j| entry(i, j) * wanted[j]).sum()).collect();
        matrix.solve(&mut x);
        for (found, wanted) in x.iter().zip(&wanted) {
            assert!((found - wanted).abs() < 1e-12);
        }
    }
}
