//! Sums over lanes against sums over samples one by one, and the square of a block by strips.

use rand::RngExt;

use super::*;
use crate::recording::Recording;
use crate::variation::CONSTANT;

/// Samples of the reference machine with deviations, many enough for a basis, some of them far off.
fn of_lanes_and_one_by_one(head: &str, columns: &str, values: usize, samples: usize) {
    let text = include_str!("../../../machines/ac_table_tilting.ron");
    let machine = Machine::parse("ac_table_tilting.ron", text).expect("a machine");
    let mut random = StdRng::seed_from_u64(5);
    let mut text = format!("{head}a[rad],c[rad],y[m],x[m],z[m],{columns}\n");
    for k in 0..samples {
        let row: Vec<String> = (0..5 + values)
            .map(|c| if c < 2 { 2.0 } else { 0.2 } * random.random_range(-1.0..1.0f64))
            .map(|x| (x + if k % 97 == 0 { 0.3 } else { 0.0 }).to_string())
            .collect();
        text.push_str(&(row.join(",") + "\n"));
    }
    let recordings = [Recording::from_bytes("drawn.csv", text.into_bytes(), &machine).expect("a recording")];
    let sources = Sources::new(&recordings, &machine, &CONSTANT, &[], &|_| {}).expect("sources");
    let layout = Layout::new(&machine, &sources, &CONSTANT, 1.0);
    let mut unknowns = Unknowns::nominal(&machine, &sources, &CONSTANT);
    for dh in &mut unknowns.dh {
        *dh = Twist::from_array(std::array::from_fn(|_| random.random_range(-1e-3..1e-3)));
    }
    let (source, none) = (&sources.all[0], Motions::default());
    let evaluator = Evaluator::new(&machine, &unknowns, source);
    let lanes = on_lanes(&evaluator, &layout, source, &unknowns, &none).expect("a way over lanes");
    let sigmas = vec![0.1; source.sensor.reading_count()];
    let (mut one_by_one, mut over_lanes) = (Vec::new(), Vec::new());
    for (sums, on_lanes) in [(&mut one_by_one, false), (&mut over_lanes, true)] {
        let work = |_: usize, stretch: &Stretch| match on_lanes {
            true => part_on_lanes(&evaluator, &lanes, stretch, &sigmas, Loss::default()),
            false => {
                let room = Room { motions: &none, values: &[] };
                part(&evaluator, source, stretch, &sigmas, Loss::default(), room)
            }
        };
        sources.pass(work, |_, part| sums.push(part)).expect("a pass");
    }
    for (one, lanes_part) in one_by_one.iter().zip(&over_lanes) {
        let (Some(one_piece), Some(piece)) = (&one.pieces[0], &lanes_part.pieces[0]) else {
            unreachable!("one piece")
        };
        let (matrix, gradient) = lanes[0].1.widened(&piece.matrix, &piece.gradient);
        // What counts nowhere stays out over lanes.
        let counts: Vec<bool> = places(&evaluator, &layout, source, &[], gradient.len())
            .iter()
            .map(|place| !place.is_empty())
            .collect();
        // Columns that are zero but for rounding are nothing to compare with.
        let size_of =
            |a: usize| one_piece.matrix[(a, a)].max(1e-6 * one_piece.matrix.diagonal().amax()).sqrt();
        for a in (0..counts.len()).filter(|a| counts[*a]) {
            let bound = 1e-9 * size_of(a);
            let size = 1e-9 * one_piece.gradient.amax();
            assert!((one_piece.gradient[a] - gradient[a]).abs() <= size, "gradient {a}");
            for b in (0..counts.len()).filter(|b| counts[*b]) {
                let bound = bound * size_of(b);
                assert!((one_piece.matrix[(a, b)] - matrix[(a, b)]).abs() <= bound, "{a}, {b}");
            }
        }
        assert!((one.loss / lanes_part.loss - 1.0).abs() < 1e-12);
        let (sums, other) = (one.tally.residuals.m, lanes_part.tally.residuals.m);
        assert_eq!((sums.rows, sums.inliers), (other.rows, other.inliers));
        assert_eq!(one.tally.down_weighted, lanes_part.tally.down_weighted);
        assert!((sums.squares / other.squares - 1.0).abs() < 1e-12);
        assert!((sums.inlier_squares / other.inlier_squares - 1.0).abs() < 1e-12);
    }
    let all: Vec<f64> = evaluator_residuals(&sources, &evaluator, true);
    let exact = evaluator_residuals(&sources, &evaluator, false);
    assert!(all.iter().zip(&exact).all(|(a, b)| (a - b).abs() < 1e-14));
}

fn evaluator_residuals(sources: &Sources, evaluator: &Evaluator, at_once: bool) -> Vec<f64> {
    let mut all = Vec::new();
    let work = |_: usize, stretch: &Stretch| {
        if at_once {
            return evaluator.all_residuals(stretch);
        }
        let (mut work, count) = (evaluator.workspace(), evaluator.sensor.reading_count());
        let one = |k: usize, work: &mut _| {
            let measured = &stretch.chunk.values[k * count..(k + 1) * count];
            evaluator.residuals(stretch.q(k), measured, Moment::At(stretch, k), work, None)
        };
        (0..stretch.chunk.len).flat_map(|k| one(k, &mut work)[..count].to_vec()).collect()
    };
    sources.pass(work, |_, own| all.extend(own)).expect("a pass");
    all
}

#[test]
fn sums_over_lanes_are_those_over_samples_one_by_one() {
    let head = "# measurement: distance\n# nominal_length: unknown\n# tool_point: unknown ball\n";
    for samples in [130, 5001] {
        of_lanes_and_one_by_one(head, "d[m]", 1, samples);
        of_lanes_and_one_by_one("# measurement: position\n", "px[m],py[m],pz[m]", 3, samples);
        let head = "# measurement: displacement\n# direction: 0.6,0,0.8\n# zero: unknown\n";
        of_lanes_and_one_by_one(head, "s[m]", 1, samples);
    }
}

#[test]
fn strips_of_a_square_make_the_whole() {
    for width in [1, STRIP, 2 * STRIP + 7] {
        let rows = DMatrix::from_fn(width, 30, |i, j| (0.3 * (i as f64 + 1.0) * (j as f64 + 2.0)).sin());
        let mut square = DMatrix::zeros(width, width);
        add_square(&rows.as_view(), &mut square);
        square.fill_upper_triangle_with_lower_triangle();
        assert!((square - &rows * rows.transpose()).amax() < 1e-12);
    }
}
