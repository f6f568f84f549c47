//! STaR-i: the code of a constellation, invariant to scale, translation and rotation (the paper, section III-B).
//!
//! A and B are the two fruits farthest apart, A the one nearer the centroid. A goes to (0, 0, 0), B to (1, 1, 1). C is the
//! fruit farthest from the line AB; the frame is turned about AB until the normal of the plane ABC has the largest z,
//! with `C_x <= C_y`. The other fruits follow by ascending x in that frame. The coordinates of C, D, E... are the code.
//!
//! **Closed form.** With e1 along AB, e2 the unit part of AC orthogonal to e1 and e3 = e1 x e2, let (x, y, z) be the
//! coordinates of P - A in that frame over |AB|. The paper's coordinates are `sqrt(3) R (x, y, z)` with the columns of
//! R being (1, 1, 1) / sqrt 3, (-1, 1, 0) / sqrt 2 and (-1, -1, 2) / sqrt 6. R is a rotation, so the numbers
//! `sqrt(3) (x, y, z)` have the paper's distances exactly. C's z is 0, hence `C_z = (C_x + C_y) / 2` in the paper's
//! frame and `3 K - 7` numbers hold all that its `3 K - 6` do. This form is the one in use: no angle, no optimisation.
//!
//! **Erratum.** The paper prints the angle as `atan(sqrt 3 (v_y - v_z) / (3 v_z))`. Setting the derivative of
//! `v'_z = v_z cos t + sqrt(3)/3 (v_y - v_x) sin t` to zero gives `tan t = sqrt(3) (v_y - v_x) / (3 v_z)`: the x of the
//! normal, not its z. With the printed angle the code changes under rotation, so it is no descriptor. Moreover `atan`
//! ends at the minimum for one half of all normals; `atan2(sqrt(3) (v_y - v_x), 3 v_z)` always finds the maximum.
//! [`paper_code`] follows the construction with both corrections and is the reference that the closed form is tested
//! against.

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

/// Least distance of C from the line AB over |AB|. The direction of C about AB, and with it every other coordinate, is
/// uncertain by sigma over that distance: below this a fruit's centimetres turn the frame by several degrees.
pub const MIN_RADIUS: f64 = 0.1;
/// Least distance of two fruits over |AB|; nearer ones are one fruit twice, and their order in the code is chance.
pub const MIN_SEPARATION: f64 = 1e-6;
/// Constellations described in one piece of work.
const PER_TASK: usize = 4096;

/// Why a set of fruits has no code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Degenerate {
    /// All fruits lie near one line, see [`MIN_RADIUS`].
    Collinear,
    /// Two fruits share a place, see [`MIN_SEPARATION`].
    Duplicate,
}

/// The order of the fruits (A, B, C, D, ...) as places in `points`, and the code of `D = 3 K - 7` numbers.
///
/// The code is `sqrt 3` times (x, y) of C, then (x, y, z) of each further fruit, see the module.
///
/// # Errors
/// Where the set is degenerate.
#[inline]
pub fn describe<const K: usize, const D: usize>(
    points: &[Point3<f64>; K],
) -> Result<([usize; K], [f64; D]), Degenerate> {
    const { assert!(K >= 4 && D == 3 * K - 7, "a code of K fruits has 3 K - 7 numbers") }
    let (a, b, length_squared) = longest(points)?;
    let (a, b) = if mean_along(points, a, b, length_squared) > 0.5 { (b, a) } else { (a, b) };
    let per_length = 1.0 / length_squared.sqrt();
    let e1 = (points[b] - points[a]) * per_length;
    // Over |AB| from here on: along AB and, as a vector, across it.
    let along: [f64; K] = std::array::from_fn(|i| (points[i] - points[a]).dot(&e1) * per_length);
    let across: [Vector3<f64>; K] = std::array::from_fn(|i| (points[i] - points[a]) * per_length - e1 * along[i]);
    let (c, radius_squared) = farthest(&across, a, b);
    // Not a number where coordinates are beyond what can be squared.
    if radius_squared.is_nan() || radius_squared < MIN_RADIUS * MIN_RADIUS {
        return Err(Degenerate::Collinear);
    }
    let radius = radius_squared.sqrt();
    let e2 = across[c] * (1.0 / radius);
    let e3 = e1.cross(&e2);
    let mut order = [a; K];
    (order[1], order[2]) = (b, c);
    let mut rest = [([0.0; 3], 0.0, 0); K];
    let mut count = 0;
    for i in 0..K {
        if i != a && i != b && i != c {
            let local = [along[i], across[i].dot(&e2), across[i].dot(&e3)];
            // Insertion by x in the paper's frame; K - 3 fruits are one to four.
            let x = paper_x(local);
            let mut place = count;
            while place > 0 && rest[place - 1].1 > x {
                rest[place] = rest[place - 1];
                place -= 1;
            }
            rest[place] = (local, x, i);
            count += 1;
        }
    }
    let mut code = [0.0; D];
    (code[0], code[1]) = (SQRT_3 * along[c], SQRT_3 * radius);
    for (next, (local, _, i)) in rest[..count].iter().enumerate() {
        order[3 + next] = *i;
        for d in 0..3 {
            code[2 + 3 * next + d] = SQRT_3 * local[d];
        }
    }
    Ok((order, code))
}

/// The order of the fruits (A, B, C, D, ...) as places in `points`.
///
/// # Errors
/// Where the set is degenerate.
pub fn make_canonical<const K: usize, const D: usize>(points: &[Point3<f64>; K]) -> Result<[usize; K], Degenerate> {
    describe::<K, D>(points).map(|(order, _): (_, [f64; D])| order)
}

/// Whether the fruits stand in the order A, B, C, D, ... and the set is not degenerate.
///
/// Checks the five rules one by one and shares nothing with [`make_canonical`] but the arithmetic.
pub fn is_canonical<const K: usize>(points: &[Point3<f64>; K]) -> bool {
    let Ok((_, _, longest_squared)) = longest(points) else { return false };
    let (a, ab) = (points[0], points[1] - points[0]);
    let length = ab.norm();
    let local: Vec<_> = points.iter().map(|p| (p - a) / length).collect();
    let e1 = ab / length;
    let radius = |p: &Vector3<f64>| (p - e1 * p.dot(&e1)).norm();
    let e2 = (local[2] - e1 * local[2].dot(&e1)) / radius(&local[2]);
    let e3 = e1.cross(&e2);
    let xs: Vec<_> = local[3..].iter().map(|p| paper_x([p.dot(&e1), p.dot(&e2), p.dot(&e3)])).collect();
    let mean = local.iter().map(|p| p.dot(&e1)).sum::<f64>() / K as f64;
    // Rounding may turn an exact tie either way.
    let tie = 1e-12;
    ab.norm_squared() >= longest_squared * (1.0 - tie)
        && mean <= 0.5 + tie
        && radius(&local[2]) >= MIN_RADIUS
        && local[3..].iter().all(|p| radius(p) <= radius(&local[2]) + tie)
        && xs.windows(2).all(|x| x[0] <= x[1] + tie)
}

/// The paper's own coordinates of C, D, E... of fruits in canonical order, by the paper's construction with the angle
/// corrected (see the module).
pub fn paper_code<const K: usize>(canonical: &[Point3<f64>; K]) -> Vec<Vector3<f64>> {
    let a = canonical[0];
    let diagonal = Vector3::new(1.0, 1.0, 1.0);
    let u = diagonal / SQRT_3;
    // Any similarity that takes A to the origin and B to (1, 1, 1); the turn about AB is settled below.
    let ab = canonical[1] - a;
    let turn = nalgebra::Rotation3::rotation_between(&ab, &diagonal)
        .unwrap_or_else(|| nalgebra::Rotation3::from_axis_angle(&any_orthogonal(&ab), std::f64::consts::PI));
    let scale = SQRT_3 / ab.norm();
    let placed: Vec<_> = canonical[2..].iter().map(|p| turn * (p - a) * scale).collect();
    let v = diagonal.cross(&placed[0]);
    let angle = (SQRT_3 * (v.y - v.x)).atan2(3.0 * v.z);
    let about_ab = |angle| nalgebra::Rotation3::from_axis_angle(&nalgebra::Unit::new_unchecked(u), angle);
    let mut rotation = about_ab(angle);
    let c = rotation * placed[0];
    if c.x > c.y {
        rotation = about_ab(std::f64::consts::PI) * rotation;
    }
    placed.iter().map(|p| rotation * p).collect()
}

/// The paper's coordinates of C, D, E... from the code in use: `R` of the module applied to each fruit.
pub fn code_in_paper_frame<const D: usize>(code: &[f64; D]) -> Vec<Vector3<f64>> {
    let columns = [
        Vector3::new(1.0, 1.0, 1.0) / SQRT_3,
        Vector3::new(-1.0, 1.0, 0.0) / SQRT_2,
        Vector3::new(-1.0, -1.0, 2.0) / SQRT_6,
    ];
    let place = |x: f64, y: f64, z: f64| columns[0] * x + columns[1] * y + columns[2] * z;
    let c = place(code[0], code[1], 0.0);
    std::iter::once(c).chain(code[2..].chunks_exact(3).map(|p| place(p[0], p[1], p[2]))).collect()
}

/// Constellations with their codes: row `i` of `members` are the fruits A, B, C, D, ... that `codes[i]` describes.
#[derive(Debug, Clone, Default)]
pub struct Described<const K: usize, const D: usize> {
    /// Rows of the fruits in canonical order.
    pub members: Vec<[u32; K]>,
    /// Codes, see [`describe`].
    pub codes: Vec<[f64; D]>,
}

/// Describes all sets that are not degenerate, in their order.
pub fn describe_all<const K: usize, const D: usize>(positions: &[Point3<f64>], sets: &[[u32; K]]) -> Described<K, D> {
    let chunks: Vec<_> = sets
        .par_chunks(PER_TASK)
        .map(|chunk| {
            let mut part =
                Described { members: Vec::with_capacity(chunk.len()), codes: Vec::with_capacity(chunk.len()) };
            for set in chunk {
                if let Ok((order, code)) = describe::<K, D>(&set.map(|row| positions[row as usize])) {
                    part.members.push(order.map(|place| set[place]));
                    part.codes.push(code);
                }
            }
            part
        })
        .collect();
    let total = chunks.iter().map(|part| part.codes.len()).sum();
    let mut all = Described { members: Vec::with_capacity(total), codes: Vec::with_capacity(total) };
    for part in chunks {
        all.members.extend(part.members);
        all.codes.extend(part.codes);
    }
    all
}

const SQRT_2: f64 = std::f64::consts::SQRT_2;
const SQRT_3: f64 = 1.732_050_807_568_877_2;
const SQRT_6: f64 = 2.449_489_742_783_178;
const SQRT_3_OVER_2: f64 = 1.224_744_871_391_589;

/// X in the paper's frame of a fruit at (x, y, z): the first row of `sqrt(3) R`.
#[inline]
fn paper_x([x, y, z]: [f64; 3]) -> f64 {
    x - SQRT_3_OVER_2 * y - z / SQRT_2
}

/// The two fruits farthest apart and their squared distance.
#[inline]
fn longest<const K: usize>(points: &[Point3<f64>; K]) -> Result<(usize, usize, f64), Degenerate> {
    let (mut a, mut b, mut most, mut least) = (0, 0, -1.0, f64::INFINITY);
    for i in 0..K {
        for j in i + 1..K {
            let squared = (points[j] - points[i]).norm_squared();
            least = squared.min(least);
            if squared > most {
                (a, b, most) = (i, j, squared);
            }
        }
    }
    // Also refuses fruits that all share one place.
    if least <= most * (MIN_SEPARATION * MIN_SEPARATION) { Err(Degenerate::Duplicate) } else { Ok((a, b, most)) }
}

/// Mean coordinate along AB over |AB|: at most 1/2 exactly where A is nearer the centroid than B.
#[inline]
fn mean_along<const K: usize>(points: &[Point3<f64>; K], a: usize, b: usize, length_squared: f64) -> f64 {
    let ab = points[b] - points[a];
    let sum: f64 = points.iter().map(|p| (p - points[a]).dot(&ab)).sum();
    sum / (length_squared * K as f64)
}

/// The fruit farthest from the line AB and its squared distance.
#[inline]
fn farthest<const K: usize>(across: &[Vector3<f64>; K], a: usize, b: usize) -> (usize, f64) {
    let (mut c, mut most) = (a, -1.0);
    for (i, offset) in across.iter().enumerate() {
        let squared = offset.norm_squared();
        if squared > most && i != a && i != b {
            (c, most) = (i, squared);
        }
    }
    (c, most)
}

fn any_orthogonal(v: &Vector3<f64>) -> nalgebra::Unit<Vector3<f64>> {
    let axis = if v.x.abs() < v.y.abs() { Vector3::x() } else { Vector3::y() };
    nalgebra::Unit::new_normalize(v.cross(&axis))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Similarity;
    use nalgebra::Rotation3;
    use proptest::prelude::*;

    fn points<const K: usize>() -> impl Strategy<Value = [Point3<f64>; K]> {
        prop::array::uniform(prop::array::uniform3(-1.0..1.0f64).prop_map(Point3::from))
    }

    fn similarity() -> impl Strategy<Value = Similarity> {
        (prop::array::uniform3(-3.0..3.0f64), prop::array::uniform3(-5.0..5.0f64), -1.0..1.0f64).prop_map(
            |(r, t, log_scale)| Similarity {
                rotation: Rotation3::new(Vector3::from(r)),
                translation: Vector3::from(t),
                scale: 10f64.powf(log_scale),
            },
        )
    }

    /// How far the discrete choices are from turning over: longest edge, centroid, farthest C, order by x. Nearer than
    /// this, rounding of a moved copy may choose otherwise.
    fn margin<const K: usize, const D: usize>(points: &[Point3<f64>; K]) -> f64 {
        let Ok((order, code)) = describe::<K, D>(points) else { return 0.0 };
        let p = order.map(|i| points[i]);
        let mut edges: Vec<_> =
            (0..K).flat_map(|i| (i + 1..K).map(move |j| (i, j))).map(|(i, j)| (p[i] - p[j]).norm()).collect();
        edges.sort_by(f64::total_cmp);
        let longest = edges[edges.len() - 1] - edges[edges.len() - 2];
        let ab = p[1] - p[0];
        let mean: f64 = p.iter().map(|q| (q - p[0]).dot(&ab) / ab.norm_squared()).sum::<f64>() / K as f64;
        let frame = code_in_paper_frame(&code);
        let by_x = frame[1..].windows(2).map(|w| w[1].x - w[0].x).fold(f64::INFINITY, f64::min);
        let u = Vector3::new(1.0, 1.0, 1.0) / SQRT_3;
        let radius = |q: &Vector3<f64>| (q - u * q.dot(&u)).norm();
        let by_radius = frame[1..].iter().map(|q| radius(&frame[0]) - radius(q)).fold(f64::INFINITY, f64::min);
        let collinear = (radius(&frame[0]) / SQRT_3 - MIN_RADIUS).abs();
        [longest, (0.5 - mean).abs(), by_x, by_radius, collinear].into_iter().fold(f64::INFINITY, f64::min)
    }

    fn difference<const D: usize>(a: &[f64; D], b: &[f64; D]) -> f64 {
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    /// All that must hold of one set.
    fn check<const K: usize, const D: usize>(
        points: &[Point3<f64>; K],
        moved: &Similarity,
    ) -> Result<(), TestCaseError> {
        prop_assume!(margin::<K, D>(points) > 1e-6);
        let (order, code): (_, [f64; D]) = describe(points).expect("the margin is positive");
        let canonical = order.map(|i| points[i]);
        prop_assert!(is_canonical(&canonical));
        prop_assert_eq!(make_canonical::<K, D>(&canonical), Ok(std::array::from_fn(|i| i)));

        let (moved_order, moved_code): (_, [f64; D]) = describe(&points.map(|p| moved.apply(&p))).expect("as before");
        prop_assert_eq!(moved_order, order);
        prop_assert!(difference(&moved_code, &code) < 1e-9);

        let (mut turned, mut turned_order) = (*points, order.map(|i| (i + 1) % K));
        turned.rotate_right(1);
        prop_assert_eq!(make_canonical::<K, D>(&turned), Ok(turned_order));
        turned_order.swap(0, 1);
        prop_assert!(!is_canonical(&turned_order.map(|i| turned[i])));

        let (constructed, closed) = (paper_code(&canonical), code_in_paper_frame(&code));
        for (a, b) in constructed.iter().zip(&closed) {
            prop_assert!((a - b).norm() < 1e-10, "{} {}", a, b);
        }
        let c = constructed[0];
        prop_assert!((c.z - 0.5 * (c.x + c.y)).abs() < 1e-10 && c.x <= c.y);
        Ok(())
    }

    proptest! {
        #[test]
        fn four(points in points::<4>(), moved in similarity()) {
            check::<4, 5>(&points, &moved)?;
        }

        #[test]
        fn five(points in points::<5>(), moved in similarity()) {
            check::<5, 8>(&points, &moved)?;
        }

        #[test]
        fn six(points in points::<6>(), moved in similarity()) {
            check::<6, 11>(&points, &moved)?;
        }

        #[test]
        fn seven(points in points::<7>(), moved in similarity()) {
            check::<7, 14>(&points, &moved)?;
        }

        #[test]
        fn a_mirror_image_has_another_code(points in points::<5>(), axis in 0..3usize) {
            prop_assume!(margin::<5, 8>(&points) > 1e-6);
            let (_, code): (_, [f64; 8]) = describe(&points).expect("the margin is positive");
            let (d, e) = (Vector3::from_row_slice(&code[2..5]), Vector3::from_row_slice(&code[5..8]));
            let mirror_of = |p: Vector3<f64>| Vector3::new(p.x, p.y, -p.z);
            // Only a constellation that is its own mirror image keeps its code.
            let planar = d.z.abs().max(e.z.abs()) < 1e-3;
            prop_assume!(!planar && (d - mirror_of(e)).amax() > 1e-3);
            let mirrored = points.map(|mut p| { p[axis] = -p[axis]; p });
            let (_, mirror): (_, [f64; 8]) = describe(&mirrored).expect("as before");
            prop_assert!(difference(&code, &mirror) > 0.9e-3);
        }

        #[test]
        fn distances_are_the_papers(a in points::<5>(), b in points::<5>()) {
            if let (Ok((_, a)), Ok((_, b))) = (describe::<5, 8>(&a), describe::<5, 8>(&b)) {
                let ours: f64 = a.iter().zip(&b).map(|(a, b)| (a - b).powi(2)).sum();
                let papers: f64 = code_in_paper_frame(&a).iter().zip(code_in_paper_frame(&b)).map(|(a, b)| (a - b).norm_squared()).sum();
                prop_assert!((ours.sqrt() - papers.sqrt()).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn the_printed_angle_is_no_invariant() {
        // Two copies of one constellation, the printed and the corrected angle of the normal in the frame before the turn.
        let angles = [0.3f64, 1.7].map(|turn| {
            let u = nalgebra::Unit::new_normalize(Vector3::new(1.0, 1.0, 1.0));
            let v = Rotation3::from_axis_angle(&u, turn) * Vector3::new(-1.0, -1.0, 2.0);
            let printed = (SQRT_3 * (v.y - v.z) / (3.0 * v.z)).atan();
            let corrected = (SQRT_3 * (v.y - v.x)).atan2(3.0 * v.z);
            [printed, corrected].map(|angle| (Rotation3::from_axis_angle(&u, angle) * v).z)
        });
        assert!((angles[0][1] - angles[1][1]).abs() < 1e-12);
        assert!((angles[0][0] - angles[1][0]).abs() > 0.1);
    }

    #[test]
    fn degenerate_sets_are_refused() {
        let line: [Point3<f64>; 5] = std::array::from_fn(|i| Point3::new(i as f64, 0.01 * (i % 2) as f64, 0.0));
        assert_eq!(describe::<5, 8>(&line).map(|_| ()), Err(Degenerate::Collinear));
        assert!(!is_canonical(&line));
        let twice =
            [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.5, 0.0], [0.2, 0.2, 0.3]].map(Point3::from);
        assert_eq!(describe::<5, 8>(&twice).map(|_| ()), Err(Degenerate::Duplicate));
        let one_place = [Point3::new(1.0, 2.0, 3.0); 5];
        assert_eq!(describe::<5, 8>(&one_place).map(|_| ()), Err(Degenerate::Duplicate));
    }
}
