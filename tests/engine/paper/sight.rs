//! What the data see (section 4).

use kincal::lie::Vec3;
use kincal::simulate::random_commands;
use nalgebra::{DMatrix, DVector};

use super::reference::*;

fn rank(rows: &DMatrix<f64>) -> usize {
    let values = values(rows);
    values.iter().filter(|s| **s > 1e-10 * values[0]).count()
}

#[test]
fn ranks_of_the_42_columns_are_those_of_the_facts() {
    let machine = machine();
    let random = random_commands(&machine, 200, 9);
    let three = [ORIGIN, Vec3([0.05, 0.0, 0.0]), Vec3([0.0, 0.04, 0.03])];
    let centres = [ORIGIN, Vec3([0.1, 0.0, 0.0]), Vec3([0.0, 0.1, 0.0]), Vec3([0.0, 0.0, 0.1])];
    let four = |p: Vec3<f64>| centres.iter().flat_map(|c| from_centre(*c)(p)).collect::<Vec<_>>();
    let one = from_centre(ORIGIN);
    let elsewhere = from_centre(Vec3([0.03, -0.2, 0.07]));
    let turn = full_turn(360);
    let segment: Vec<f64> = (0..180).map(|k| (k as f64).to_radians()).collect();
    let cone = |senses| path(&machine, 0.1, &turn, senses, true);
    let rows = |qs: &[Vec<f64>], sees: &dyn Fn(Vec3<f64>) -> Vec<Vec3<f64>>, points: &[Vec3<f64>]| {
        rank(&factor_rows(&machine, qs, sees, points))
    };
    for (what, ours, theirs) in [
        ("three tool points", rows(&random, &coordinates, &three), 20),
        ("tool tip", rows(&random, &coordinates, &[ORIGIN]), 17),
        ("four centres", rows(&random, &four, &[ORIGIN]), 17),
        ("one centre", rows(&random, &one, &[ORIGIN]), 14),
        ("one centre elsewhere", rows(&random, &elsewhere, &[ORIGIN]), 14),
        ("path of table 7", rows(&table_7_path(&machine, &turn), &one, &[ORIGIN]), 12),
        ("one segment of it", rows(&table_7_path(&machine, &segment), &one, &[ORIGIN]), 12),
        ("cone in w, A+ C-", rows(&cone([1.0, 1.0]), &one, &[ORIGIN]), 14),
        ("cone in w, A- C+", rows(&cone([-1.0, -1.0]), &one, &[ORIGIN]), 9),
    ] {
        println!("{what}: {ours} (facts: {theirs})");
        assert_eq!(ours, theirs, "{what}");
    }
}

#[test]
fn singular_values_of_the_path_of_table_7_are_those_of_the_facts() {
    let machine = machine();
    let theirs = [19.19, 13.58, 12.33, 2.356, 1.984, 0.504, 0.316, 0.0623, 0.0134, 0.00627, 5.5e-4, 2.4e-4];
    let full =
        factor_rows(&machine, &table_7_path(&machine, &full_turn(100)), &from_centre(ORIGIN), &[ORIGIN]);
    let ours = values(&full);
    for (ours, theirs) in ours.iter().zip(theirs) {
        println!("{ours:.4e} (facts: {theirs:e})");
        close("singular value", *ours, theirs, 0.02);
    }
    assert!(ours[12] < 1e-12);
    // Rotations of h_t: the tool point is the origin of the frame.
    assert!((39..42).all(|k| full.column(k).amax() < 1e-15));
    let segment: Vec<f64> = (0..100).map(|k| (1.8 * f64::from(k)).to_radians()).collect();
    let part = factor_rows(&machine, &table_7_path(&machine, &segment), &from_centre(ORIGIN), &[ORIGIN]);
    let kept = |rows: &DMatrix<f64>, unit_m: f64| {
        let scaled =
            DMatrix::from_fn(rows.nrows(), 42, |i, k| rows[(i, k)] * if k % 6 < 3 { unit_m } else { 1.0 });
        let values = values(&scaled);
        values.iter().filter(|s| **s > 1e-3 * values[0]).count()
    };
    let counts = [kept(&full, 1.0), kept(&part, 1.0), kept(&full, 0.1), kept(&part, 0.1)];
    println!("above 1e-3 of the largest: {counts:?} (facts: 8, 7 in m; 9, 7 in 0.1 m)");
    assert_eq!(counts, [8, 7, 9, 7]);
}

#[test]
fn a_constant_error_of_distance_is_absorbed_on_every_cone_path() {
    let machine = machine();
    for (senses, turned) in [([1.0, 1.0], false), ([1.0, 1.0], true), ([-1.0, -1.0], true)] {
        let qs = path(&machine, 0.1, &full_turn(100), senses, turned);
        let rows = factor_rows(&machine, &qs, &from_centre(ORIGIN), &[ORIGIN]);
        let bias = DVector::from_element(100, 1.0);
        let x = rows.clone().svd(true, true).solve(&bias, 1e-10).expect("an SVD with both factors");
        let left = (rows * x - bias).amax();
        println!("senses {senses:?}, turned {turned}: {left:.1e} of a constant is left");
        assert!(left < 1e-10, "{left:e}");
    }
}
