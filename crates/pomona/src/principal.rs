//! Principal axes of places.

use nalgebra::{Matrix3, Vector3};

/// In which directions places extend about their mean, and how far.
pub(crate) struct Principal {
    /// A proper rotation whose columns are the axes, the longest first.
    pub(crate) axes: Matrix3<f64>,
    /// Standard deviation along each.
    pub(crate) extents: [f64; 3],
}

impl Principal {
    /// Of so many places about their mean; `None` where there are none, or numbers do not hold their squares.
    pub(crate) fn of<'a>(places: impl ExactSizeIterator<Item = &'a Vector3<f64>> + Clone) -> Option<Self> {
        let count = places.len() as f64;
        let middle = places.clone().sum::<Vector3<f64>>() / count;
        let scatter = places.map(|p| (p - middle) * (p - middle).transpose()).sum::<Matrix3<f64>>() / count;
        if !scatter.iter().all(|x| x.is_finite()) {
            return None;
        }
        let eigen = scatter.symmetric_eigen();
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let extents = order.map(|i| eigen.eigenvalues[i].max(0.0).sqrt());
        let [along, up] = [order[0], order[1]].map(|i| eigen.eigenvectors.column(i).into_owned());
        let axes = Matrix3::from_columns(&[along, up, along.cross(&up)]);
        axes.iter().all(|x| x.is_finite()).then_some(Self { axes, extents })
    }

    /// The axes, the longest first.
    pub(crate) fn ways(&self) -> [Vector3<f64>; 3] {
        [0, 1, 2].map(|i| self.axes.column(i).into_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_way_comes_first_and_the_axes_are_a_turn() {
        let corner = |i: u8| {
            let sign = |bit: u8| if i & bit == 0 { -1.0 } else { 1.0 };
            Vector3::new(sign(1), 5.0 * sign(2), 2.0 * sign(4)) + Vector3::repeat(100.0)
        };
        let box_of: Vec<_> = (0..8).map(corner).collect();
        let found = Principal::of(box_of.iter()).expect("a box has axes");
        for (found, expected) in found.extents.iter().zip([5.0, 2.0, 1.0]) {
            assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        }
        assert!((found.axes.determinant() - 1.0).abs() < 1e-9);
        assert!((found.ways()[0].y.abs() - 1.0).abs() < 1e-9);
    }

    #[test]
    fn without_places_there_are_none() {
        assert!(Principal::of([].iter()).is_none());
        let far = [Vector3::repeat(1e200), Vector3::repeat(-1e200)];
        assert!(Principal::of(far.iter()).is_none());
    }
}
