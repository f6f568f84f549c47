//! Golden codes of `testdata/star_i.json`, worked out by another way in `testdata/star_i_reference.py`.

use nalgebra::Point3;
use pomona::paper::descriptor::{Degenerate, code_in_paper_frame, describe, is_canonical};
use serde::Deserialize;

#[derive(Deserialize)]
struct Golden {
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    name: String,
    points: Vec<[f64; 3]>,
    degenerate: Option<String>,
    order: Option<Vec<usize>>,
    paper: Option<Vec<[f64; 3]>>,
    code: Option<Vec<f64>>,
}

/// Coordinates of millions of metres carry 1e-9 m of rounding; codes are of length one.
const TOLERANCE: f64 = 2e-8;

#[test]
fn codes_are_as_worked_out_elsewhere() {
    let text = include_str!("../../../testdata/star_i.json");
    let golden: Golden = serde_json::from_str(text).expect("the file of its own script");
    for case in &golden.cases {
        match case.points.len() {
            4 => check::<4, 5>(case),
            5 => check::<5, 8>(case),
            6 => check::<6, 11>(case),
            7 => check::<7, 14>(case),
            k => panic!("{}: {k} fruits", case.name),
        }
    }
    assert!(golden.cases.len() >= 20);
}

fn check<const K: usize, const D: usize>(case: &Case) {
    let points: [Point3<f64>; K] = std::array::from_fn(|i| Point3::from(case.points[i]));
    let found = describe::<K, D>(&points);
    if let Some(why) = &case.degenerate {
        let expected = if why == "duplicate" { Degenerate::Duplicate } else { Degenerate::Collinear };
        assert_eq!(found.err(), Some(expected), "{}", case.name);
        return;
    }
    let (order, code) = found.expect(&case.name);
    assert_eq!(Some(order.to_vec()), case.order, "{}", case.name);
    assert!(is_canonical(&order.map(|i| points[i])), "{}", case.name);
    for (ours, expected) in code.iter().zip(case.code.as_ref().expect("a code")) {
        assert!((ours - expected).abs() < TOLERANCE, "{}: {ours} {expected}", case.name);
    }
    for (ours, expected) in code_in_paper_frame(&code).iter().zip(case.paper.as_ref().expect("coordinates")) {
        assert!((ours - nalgebra::Vector3::from(*expected)).amax() < TOLERANCE, "{}", case.name);
    }
}
