//! Tables 4, 6 and 8 against the model (section 3).

use kincal::lie::{Twist, Vec3};
use kincal::simulate::random_commands;
use kincal::{Chain, Machine};
use nalgebra::{DMatrix, DVector};

use super::reference::*;

/// A printed table of 42 components, um and urad, machine order; with all of `w`, `c`, `a` times `workpiece_sign`.
fn printed(machine: &Machine, table: &[(&str, [f64; 6]); 7], workpiece_sign: f64) -> DVector<f64> {
    let of = |frame: &str| table.iter().find(|(f, _)| *f == frame).expect("seven frames").1;
    let values = machine.dyads().iter().enumerate().flat_map(|(j, d)| {
        let sign = if j < machine.workpiece_count() { workpiece_sign } else { 1.0 };
        of(&d.frame).map(|x| sign * x)
    });
    DVector::from_iterator(42, values)
}

const TABLE_6: [(&str, [f64; 6]); 7] = [
    ("w", [-16.0, 34.0, -167.0, -2.0, 25.0, 5.0]),
    ("c", [-28.0, -107.0, -167.0, -48.0, 38.0, 5.0]),
    ("a", [-28.0, -21.0, 23.0, -50.0, 44.0, 14.0]),
    ("y", [-28.0, -21.0, 23.0, -50.0, 44.0, 14.0]),
    ("x", [-28.0, -21.0, 23.0, -39.0, 44.0, 9.0]),
    ("z", [-28.0, -21.0, 23.0, -39.0, 39.0, 0.0]),
    ("t", [-28.0, -21.0, 23.0, 0.0, 0.0, 0.0]),
];

/// As printed, `dz` of y being +5.
const TABLE_4: [(&str, [f64; 6]); 7] = [
    ("w", [13.0, 18.0, -3.0, -1.0, 1.0, 3.0]),
    ("c", [-3.0, -1.0, -3.0, 56.0, -3.0, 3.0]),
    ("a", [-3.0, -1.0, -5.0, 56.0, -8.0, -7.0]),
    ("y", [-3.0, -1.0, 5.0, 56.0, -8.0, -7.0]),
    ("x", [-3.0, -1.0, -5.0, 27.0, -8.0, 25.0]),
    ("z", [-3.0, -1.0, -5.0, 27.0, 6.0, 0.0]),
    ("t", [-3.0, -1.0, -5.0, 0.0, 0.0, 0.0]),
];

/// Part of `x` that no combination of the rows makes, and the rank: what a solver that starts at zero can never have written.
fn outside(rows: &DMatrix<f64>, x: &DVector<f64>) -> (f64, usize) {
    let svd = rows.clone().svd(false, true);
    let v_t = svd.v_t.expect("asked for");
    let largest = svd.singular_values.amax();
    let mut rest = x.clone();
    let mut rank = 0;
    for (i, s) in svd.singular_values.iter().enumerate() {
        if *s > 1e-10 * largest {
            rank += 1;
            let v = v_t.row(i).transpose();
            let part = v.dot(x);
            rest -= part * v;
        }
    }
    (rest.amax(), rank)
}

#[test]
fn table_6_could_have_come_from_chain_factors_and_from_no_other_reading() {
    let machine = machine();
    let generic = factor_rows(&machine, &random_commands(&machine, 200, 5), &from_centre(ORIGIN), &[ORIGIN]);
    let on_path = |senses| {
        let qs = path(&machine, 0.1, &full_turn(360), senses, false);
        // The printed table is in the machine's own frames, with C in the sense of e6.
        factor_rows(&machine, &qs, &from_centre(ORIGIN), &[ORIGIN])
    };
    let as_is = printed(&machine, &TABLE_6, 1.0);
    let (in_general, rank) = outside(&generic, &as_is);
    assert_eq!(rank, 14);
    let (executed, rank) = outside(&on_path([1.0, 1.0]), &as_is);
    assert_eq!(rank, 12);
    println!(
        "table 6: outside by {in_general:.2} (random poses), {executed:.2} (path of table 7); um or urad"
    );
    // Numbers are printed to 1 um and 1 urad.
    assert!(in_general < 0.7 && executed < 0.7, "{in_general}, {executed}");
    for senses in [[-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]] {
        let (other, _) = outside(&on_path(senses), &as_is);
        println!("  the same path with senses {senses:?}: {other:.1}");
        assert!(other > 10.0 * executed, "{senses:?}: {other}");
    }
    let (flipped, _) = outside(&generic, &printed(&machine, &TABLE_6, -1.0));
    println!("  with w, c, a of the other sign: {flipped:.1}");
    assert!(flipped > 10.0, "{flipped}");
}

#[test]
fn table_4_has_a_wrong_sign_and_another_path() {
    let machine = machine();
    let generic = factor_rows(&machine, &random_commands(&machine, 200, 5), &from_centre(ORIGIN), &[ORIGIN]);
    let mut mended = TABLE_4;
    mended[3].1[2] = -5.0;
    let (as_is, _) = outside(&generic, &printed(&machine, &TABLE_4, 1.0));
    let (right, _) = outside(&generic, &printed(&machine, &mended, 1.0));
    let on_path =
        factor_rows(&machine, &table_7_path(&machine, &full_turn(360)), &from_centre(ORIGIN), &[ORIGIN]);
    let (elsewhere, _) = outside(&on_path, &printed(&machine, &mended, 1.0));
    println!(
        "table 4: outside by {as_is:.2} as printed, {right:.2} with dz of y = -5 um, {elsewhere:.2} on the path of table 7"
    );
    assert!(as_is > 5.0 && right < 0.7 && elsewhere > 2.0, "{as_is}, {right}, {elsewhere}");
}

/// Rows of tables 7 and 8: mm and deg.
const TABLE_7: [[f64; 5]; 6] = [
    [0.0, -44.0232, 41.0652, 75.0, 0.0],
    [0.1213, -44.0749, 40.8723, 75.0, 0.073],
    [0.2434, -44.1266, 40.6783, 75.0, 0.146],
    [0.3642, -44.18, 40.4827, 75.0, 0.22],
    [0.4858, -44.2324, 40.291, 74.999, 0.293],
    [0.6061, -44.2841, 40.097, 74.999, 0.366],
];
const TABLE_8: [[f64; 5]; 6] = [
    [0.1979, -44.1563, 41.1418, 74.9993, 0.0008],
    [0.3196, -44.208, 40.9488, 74.9993, 0.0722],
    [0.4419, -44.2597, 40.7548, 74.9993, 0.1452],
    [0.563, -44.3132, 40.5592, 74.9993, 0.2192],
    [0.6849, -44.3656, 40.3675, 74.9983, 0.2922],
    [0.8055, -44.4173, 40.1736, 74.9983, 0.3652],
];

const TABLE_9: [[f64; 5]; 6] = [
    [0.0, -31.0822, 89.3617, 75.0, 0.0],
    [0.1828, -31.1339, 89.1688, 75.0, 0.073],
    [0.3669, -31.1856, 88.9743, 75.0, 0.146],
    [0.5492, -31.2395, 88.7787, 75.0, 0.22],
    [0.7328, -31.2924, 88.587, 74.999, 0.293],
    [0.9146, -31.3441, 88.3925, 74.999, 0.366],
];

/// How the print was made: bar vector at 100 mm to 1 um (of table 9 times 1.5), A and C to 0.001 deg; `c_sense`: C of the program in the
/// sense of the machine's joint. Returns the largest distance of a row from the printed one, the first row's, and the largest coordinate, mm.
fn off_print(machine: &Machine, c_sense: f64, turned: bool) -> (f64, Vec3<f64>, f64) {
    let (mut worst, mut first, mut largest) = (0.0f64, ORIGIN, 0.0f64);
    for (table, scale) in [(TABLE_7, 1.0), (TABLE_9, 1.5)] {
        for (k, row) in table.iter().enumerate() {
            let (bar, a, c) = cone(0.1, (0.1 * k as f64).to_radians(), 0.0);
            let round = |x: f64| (x.to_degrees() * 1e3).round() / 1e3;
            let (a, c) = (round(a), round(c));
            assert!((a - row[3]).abs() < 1e-9 && (c - row[4]).abs() < 1e-9, "row {k}: A {a}, C {c}");
            let at = commands(machine, &[0.0, 0.0, 0.0, a, c_sense * c]);
            let b_from_w = Chain::nominal(machine).sweep(&at).b_from_w();
            let bar = Vec3(bar.0.map(|x| (x * 1e6).round() * 1e-6 * scale));
            let bar = if turned { b_from_w.rotation * bar } else { bar };
            let p = (bar + b_from_w.translation).times(1e3);
            let off = Vec3([row[0], row[1], row[2]]) - p;
            if (k, scale) == (0, 1.0) {
                first = off;
            }
            worst = worst.max(off.norm());
            largest = off.0.iter().fold(largest, |m, x| m.max(x.abs()));
        }
    }
    (worst, first, largest)
}

#[test]
fn the_printed_programs_come_from_other_pivots_than_the_printed_ones() {
    let (fitted, stated) = (machine(), crate::common::machine("ac_table_tilting"));
    let (_, _, off) = off_print(&fitted, 1.0, false);
    println!("tables 7 and 9: all 12 rows within {:.3} um with the fitted pivots (facts: 0.036)", off * 1e3);
    assert!(off * 1e3 < 0.05, "{off}");
    // In that file C turns against the program.
    let (off, first, _) = off_print(&stated, -1.0, false);
    println!(
        "  with the printed pivots: off by up to {off:.4} mm (facts: 1.4543), row 1 by {:.3?} mm (facts: 0, -0.257, 1.421)",
        first.0
    );
    close("printed pivots", off, 1.4543, 1e-3);
    assert!((first - Vec3([0.0, -0.257, 1.421])).norm() < 1e-3, "{first:?}");
    // The bar vector is not turned with the table, and C has the other sense: either way the rows miss.
    let (turned, ..) = off_print(&fitted, 1.0, true);
    let (other, ..) = off_print(&fitted, -1.0, false);
    println!("  bar vector turned with the table: {turned:.1} mm; C positive: {other:.3} mm");
    assert!(turned > 10.0 && other > 0.5, "{turned}, {other}");
    // Home offsets: printed ones leave twice z_c, fitted ones close.
    let gap = |m: &Machine| {
        (0..m.workpiece_count()).fold(ORIGIN, |sum, j| sum + m.dyads()[j].placement.at).times(1e3)
    };
    println!("  sum of the pivots: {:.3?} mm printed, {:.4?} mm fitted", gap(&stated).0, gap(&fitted).0);
    assert!((gap(&stated) - Vec3([0.0, 0.0, 0.99])).norm() < 1e-9 && gap(&fitted).norm() < 1e-9);
}

/// Commands from `x y z A C` in mm and deg.
fn commands(machine: &Machine, row: &[f64; 5]) -> Vec<f64> {
    let of = |name: &String| match name.as_str() {
        "x" => row[0] * 1e-3,
        "y" => row[1] * 1e-3,
        "z" => row[2] * 1e-3,
        "a" => row[3].to_radians(),
        _ => row[4].to_radians(),
    };
    machine.commands().iter().map(of).collect()
}

/// Position of the tool point by the commands x y z A C: 3 x 5, m per m and m per rad.
fn joint_rows(machine: &Machine, q: &[f64]) -> DMatrix<f64> {
    let sweep = Chain::nominal(machine).sweep(q);
    let p = sweep.w_from_t().translation;
    let order = ["x", "y", "z", "a", "c"];
    let mut rows = DMatrix::zeros(3, 5);
    for (i, along) in coordinates(p).into_iter().enumerate() {
        let mut row = vec![0.0; machine.commands().len()];
        sweep.command_row(machine, kincal::lie::Wrench::at_point(along, p), &mut row);
        for (k, name) in order.iter().enumerate() {
            let c = machine.commands().iter().position(|x| x == name).expect("a joint");
            rows[(i, k)] = row[c];
        }
    }
    rows
}

#[test]
fn the_rotary_steps_of_table_8_are_those_of_the_unweighted_pseudo_inverse_but_for_one_sign() {
    let machine = machine();
    for (row, (before, after)) in TABLE_7.iter().zip(&TABLE_8).enumerate() {
        let rows = joint_rows(&machine, &commands(&machine, before));
        // dq = Jᵀ λ; λ from the linear axes, then the companions.
        let step = DVector::from_iterator(3, (0..3).map(|k| (after[k] - before[k]) * 1e-3));
        let lambda = rows.columns(0, 3).transpose().lu().solve(&step).expect("three linear axes");
        let companions = rows.columns(3, 2).transpose() * lambda;
        for (k, name) in ["A", "C"].iter().enumerate() {
            let seen = (after[3 + k] - before[3 + k]).to_radians();
            let off = (seen - companions[k]).abs() * 1e6;
            println!(
                "row {} d{name}: {:.1} urad predicted, {:.1} printed",
                row + 1,
                companions[k] * 1e6,
                seen * 1e6
            );
            if (row, *name) == (0, "C") {
                // The minus sign is lost in print: with it the row agrees like the others.
                assert!(off > 20.0 && (-seen - companions[k]).abs() * 1e6 < 1.8, "{off}");
            } else {
                // Table 8 is printed to 0.0001 deg and table 7 to 0.001 deg or better: half of the former, and a little.
                assert!(off < 1.8, "row {row}, {name}: off by {off:.2} urad");
            }
        }
    }
    // The printed normal matrix of five joints has rank three.
    let rows = joint_rows(&machine, &commands(&machine, &TABLE_7[0]));
    assert_eq!((rows.transpose() * &rows).rank(1e-9), 3);
}

#[test]
fn table_6_does_not_predict_table_8() {
    let machine = machine();
    let x = printed(&machine, &TABLE_6, 1.0) * 1e-6;
    let mut misses = [0.0f64; 3];
    for (row, (before, after)) in TABLE_7.iter().zip(&TABLE_8).enumerate() {
        let q = commands(&machine, before);
        let error = factor_rows(&machine, std::slice::from_ref(&q), &coordinates, &[ORIGIN]) * &x;
        let step = -joint_rows(&machine, &q).pseudo_inverse(1e-9).expect("finite") * error;
        let um = |k: usize| step[k] * 1e6;
        if row == 0 {
            println!(
                "row 1: ({:.1}, {:.1}, {:.1}) um, {:.1}, {:.1} urad; printed (197.9, -133.1, 76.6), -12.2, -14.0",
                um(0),
                um(1),
                um(2),
                um(3),
                um(4)
            );
            for (k, theirs) in [170.1, -218.3, 40.3, -23.2, -19.5].into_iter().enumerate() {
                assert!((um(k) - theirs).abs() < 0.15, "{k}: {} against {theirs}", um(k));
            }
        }
        (0..3).for_each(|k| misses[k] += ((after[k] - before[k]) * 1e3 - um(k)).powi(2) / 6.0);
    }
    let rms = misses.map(f64::sqrt);
    println!("rms over rows ({:.1}, {:.1}, {:.1}) um (facts: 28.6, 85.1, 36.3)", rms[0], rms[1], rms[2]);
    for (ours, theirs) in rms.into_iter().zip([28.6, 85.1, 36.3]) {
        assert!((ours - theirs).abs() < 0.15, "{ours} against {theirs}");
    }
    let qs = table_7_path(&machine, &full_turn(720));
    let loop_rows = factor_rows(&machine, &qs, &from_centre(ORIGIN), &[ORIGIN]);
    let variation = loop_rows * &x * 1e6;
    // F exp(d) with F = inv(E): E exp(-Ad(E⁻¹) d).
    let deviations = machine.dyads().iter().enumerate().map(|(j, dyad)| {
        let d = Twist::from_array(std::array::from_fn(|k| x[6 * j + k]));
        let workpiece = j < machine.workpiece_count();
        if workpiece { -dyad.placement.pose().inverse().carry_twist(d) } else { d }
    });
    let chain = Chain::new(&machine, &deviations.collect::<Vec<_>>());
    let exact = qs.iter().map(|q| (chain.w_from_t(q).translation.norm() - 0.1) * 1e6);
    let apart = exact.zip(variation.iter()).map(|(e, l)| (e - l).abs()).fold(0.0, f64::max);
    println!("exact and linear distance differ by up to {apart:.2} um (facts: 0.43)");
    assert!((apart - 0.43).abs() < 0.02, "{apart}");
    println!("distance variation {:.0} to {:+.0} um (facts: -218 to +112)", variation.min(), variation.max());
    close("lowest", variation.min(), -218.0, 0.01);
    close("highest", variation.max(), 112.0, 0.01);
}
