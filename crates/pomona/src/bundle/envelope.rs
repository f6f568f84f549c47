//! Symmetric matrices of 6 x 6 blocks with an envelope: of row i only the blocks from its first one to the diagonal are
//! kept. A Cholesky factor fills nothing outside the envelope, and neither does the part of the inverse that covariances
//! need. A camera that drives along a row sees each point for a few dozen frames, so rows are short and 10,000 poses
//! cost 10,000 small rows, not 10,000^3.

use nalgebra::{Matrix6, Vector6};
use std::ops::Range;

/// The lower triangle within the envelope.
#[derive(Debug, Clone)]
pub(super) struct Envelope {
    first: Vec<usize>,
    start: Vec<usize>,
    blocks: Vec<Matrix6<f64>>,
}

impl Envelope {
    /// Zeros; `first[i] <= i` is the first block of row i.
    pub(super) fn zeros(first: Vec<usize>) -> Self {
        let mut start = vec![0];
        for (row, &column) in first.iter().enumerate() {
            start.push(start[row] + row + 1 - column);
        }
        let blocks = vec![Matrix6::zeros(); start[first.len()]];
        Self { first, start, blocks }
    }

    pub(super) fn len(&self) -> usize {
        self.first.len()
    }

    fn place(&self, row: usize, column: usize) -> usize {
        debug_assert!(self.first[row] <= column && column <= row, "block ({row}, {column}) is outside the envelope");
        self.start[row] + column - self.first[row]
    }

    /// Block of the lower triangle, `first[row] <= column <= row`.
    pub(super) fn block(&self, row: usize, column: usize) -> &Matrix6<f64> {
        &self.blocks[self.place(row, column)]
    }

    /// The same, to write.
    pub(super) fn block_mut(&mut self, row: usize, column: usize) -> &mut Matrix6<f64> {
        let place = self.place(row, column);
        &mut self.blocks[place]
    }

    /// Whether a block is kept.
    pub(super) fn holds(&self, row: usize, column: usize) -> bool {
        self.first[row] <= column && column <= row
    }

    /// Blocks of one row in some columns.
    fn run(&self, row: usize, columns: Range<usize>) -> &[Matrix6<f64>] {
        if columns.is_empty() {
            return &[];
        }
        &self.blocks[self.place(row, columns.start)..=self.place(row, columns.end - 1)]
    }

    /// L with L L^T = the matrix, `None` where it is not positive definite. Off the diagonal the factor is L, on the
    /// diagonal the inverse of the triangle.
    pub(super) fn cholesky(mut self) -> Option<Factor> {
        for row in 0..self.len() {
            for column in self.first[row]..=row {
                let both = self.first[row].max(self.first[column])..column;
                let mut block = *self.block(row, column);
                for (a, b) in self.run(row, both.clone()).iter().zip(self.run(column, both)) {
                    subtract_product(&mut block, a, b);
                }
                *self.block_mut(row, column) = if column < row {
                    block * self.block(column, column).transpose()
                } else {
                    block.cholesky()?.l().solve_lower_triangular(&Matrix6::identity())?
                };
            }
        }
        Some(Factor(self))
    }
}

/// `block -= a b^T`, the inner loop of everything here; written out so that it becomes vector instructions.
#[inline]
fn subtract_product(block: &mut Matrix6<f64>, a: &Matrix6<f64>, b: &Matrix6<f64>) {
    let (block, a, b) = (block.as_mut_slice(), a.as_slice(), b.as_slice());
    for (a, b) in a.as_chunks::<6>().0.iter().zip(b.as_chunks::<6>().0) {
        for (column, factor) in block.as_chunks_mut::<6>().0.iter_mut().zip(b) {
            for (entry, value) in column.iter_mut().zip(a) {
                *entry -= value * factor;
            }
        }
    }
}

/// A Cholesky factor, with the inverses of its triangles on the diagonal.
#[derive(Debug, Clone)]
pub(super) struct Factor(Envelope);

impl Factor {
    /// Solves in place.
    pub(super) fn solve(&self, right: &mut [Vector6<f64>]) {
        let factor = &self.0;
        for row in 0..factor.len() {
            let mut sum = right[row];
            let columns = factor.first[row]..row;
            for (block, known) in factor.run(row, columns.clone()).iter().zip(&right[columns]) {
                sum -= block * known;
            }
            right[row] = factor.block(row, row) * sum;
        }
        for row in (0..factor.len()).rev() {
            let found = factor.block(row, row).tr_mul(&right[row]);
            right[row] = found;
            for (column, entry) in right.iter_mut().enumerate().take(row).skip(factor.first[row]) {
                *entry -= factor.block(row, column).tr_mul(&found);
            }
        }
    }

    /// The blocks of the inverse within the envelope (Takahashi's recursion).
    ///
    /// Z L = L^-T gives, from the last column to the first, `Z_ij` = [i = j] L_jj^-T L_jj^-1 - sum_{k > j} `Z_ik` `L_kj` L_jj^-1.
    /// With `L_kj` also `L_ij` is in the envelope, so `Z_ik` is: its row reaches to the left of k.
    pub(super) fn inverse(&self) -> Envelope {
        let factor = &self.0;
        let mut inverse = Envelope::zeros(factor.first.clone());
        let mut below: Vec<Vec<usize>> = vec![Vec::new(); factor.len()];
        for row in 0..factor.len() {
            for rows in &mut below[factor.first[row]..row] {
                rows.push(row);
            }
        }
        for column in (0..factor.len()).rev() {
            let triangle = factor.block(column, column);
            for &row in below[column].iter().rev() {
                let mut sum = Matrix6::zeros();
                for &k in &below[column] {
                    let known = if k <= row { *inverse.block(row, k) } else { inverse.block(k, row).transpose() };
                    sum -= known * factor.block(k, column);
                }
                *inverse.block_mut(row, column) = sum * triangle;
            }
            let mut sum = triangle.transpose();
            for &k in &below[column] {
                sum -= inverse.block(k, column).tr_mul(factor.block(k, column));
            }
            *inverse.block_mut(column, column) = sum * triangle;
        }
        inverse
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix;
    use nalgebra::{DMatrix, DVector};

    /// A positive definite matrix with rows of many lengths, and the same dense.
    fn matrices(n: usize) -> (Envelope, DMatrix<f64>) {
        let mut random = SplitMix(5);
        let mut number = move || random.below(2_000_001) as f64 / 1e6 - 1.0;
        let first: Vec<usize> = (0..n).map(|row| if row % 7 == 6 { 0 } else { row.saturating_sub(row % 4) }).collect();
        let mut sparse = Envelope::zeros(first.clone());
        let mut dense = DMatrix::zeros(6 * n, 6 * n);
        for (row, &from) in first.iter().enumerate() {
            for column in from..=row {
                let mut block = Matrix6::from_fn(|_, _| number());
                if row == column {
                    block = block * block.transpose() + Matrix6::identity() * 30.0;
                }
                *sparse.block_mut(row, column) = block;
                dense.view_mut((6 * row, 6 * column), (6, 6)).copy_from(&block);
                dense.view_mut((6 * column, 6 * row), (6, 6)).copy_from(&block.transpose());
            }
        }
        (sparse, dense)
    }

    #[test]
    fn solves_like_a_dense_matrix() {
        let (sparse, dense) = matrices(15);
        let right = DVector::from_fn(90, |row, _| (row as f64 * 0.7).sin());
        let expected = dense.cholesky().expect("positive definite").solve(&right);
        let mut found: Vec<_> = right.as_slice().chunks_exact(6).map(Vector6::from_column_slice).collect();
        sparse.cholesky().expect("positive definite").solve(&mut found);
        for (row, block) in found.iter().enumerate() {
            assert!((block - expected.rows(6 * row, 6)).norm() < 1e-12);
        }
    }

    #[test]
    fn the_inverse_in_the_envelope_is_that_of_the_dense_matrix() {
        let (sparse, dense) = matrices(15);
        let expected = dense.try_inverse().expect("regular");
        let found = sparse.clone().cholesky().expect("positive definite").inverse();
        for row in 0..15 {
            for column in (0..=row).filter(|&column| sparse.holds(row, column)) {
                let difference = found.block(row, column) - expected.view((6 * row, 6 * column), (6, 6));
                assert!(difference.norm() < 1e-12, "block ({row}, {column})");
            }
        }
    }

    #[test]
    fn what_is_not_positive_definite_has_no_factor() {
        let (mut sparse, _) = matrices(3);
        *sparse.block_mut(1, 1) -= Matrix6::identity() * 1000.0;
        assert!(sparse.cholesky().is_none());
    }
}
