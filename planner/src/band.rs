//! Symmetric systems whose entries stand near the diagonal.

/// A symmetric, positive definite matrix: row by row the diagonal and what stands to its right, as far
/// as the band goes.
pub(crate) struct Band {
    width: usize,
    entries: Vec<f64>,
}

impl Band {
    /// All zero. `width`: how many entries of a row there are, the diagonal's included.
    pub(crate) fn zero(size: usize, width: usize) -> Self {
        Self { width, entries: vec![0.0; size * width] }
    }

    /// Adds to an entry at or right of the diagonal, within the band.
    #[inline]
    pub(crate) fn add(&mut self, row: usize, column: usize, value: f64) {
        self.entries[row * self.width + column - row] += value;
    }

    /// Solves in place by L D Lᵀ; the right side becomes the solution.
    pub(crate) fn solve(mut self, x: &mut [f64]) {
        let (n, width) = (x.len(), self.width);
        for i in 0..n {
            let reach = width.min(n - i);
            let (done, rest) = self.entries.split_at_mut((i + 1) * width);
            let row = &mut done[i * width..];
            let diagonal = row[0].max(f64::MIN_POSITIVE);
            for k in 1..reach {
                let share = row[k] / diagonal;
                if share != 0.0 {
                    let below = &mut rest[(k - 1) * width..];
                    for (entry, own) in below.iter_mut().zip(&row[k..reach]) {
                        *entry -= share * own;
                    }
                    x[i + k] -= share * x[i];
                }
            }
            row[1..reach].iter_mut().for_each(|entry| *entry /= diagonal);
            row[0] = diagonal;
        }
        for i in (0..n).rev() {
            let row = &self.entries[i * width..][..width.min(n - i)];
            let known = row[1..].iter().zip(&x[i + 1..]).map(|(l, x)| l * x);
            x[i] = known.fold(x[i] / row[0], |own, known| own - known);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_solution_solves() {
        let (n, width) = (23, 5);
        let entry = |i: usize, j: usize| match i.abs_diff(j) {
            0 => 5.0 + 0.1 * i as f64,
            apart if apart < width => libm::sin(1.0 + i.min(j) as f64) / apart as f64,
            _ => 0.0,
        };
        let mut matrix = Band::zero(n, width);
        for i in 0..n {
            for j in i..n.min(i + width) {
                matrix.add(i, j, entry(i, j));
            }
        }
        let wanted: Vec<f64> = (0..n).map(|i| libm::cos(i as f64)).collect();
        let mut x: Vec<f64> =
            (0..n).map(|i| (0..n).map(|j| entry(i, j) * wanted[j]).sum()).collect();
        matrix.solve(&mut x);
        for (found, wanted) in x.iter().zip(&wanted) {
            assert!((found - wanted).abs() < 1e-12, "{found} for {wanted}");
        }
    }
}
