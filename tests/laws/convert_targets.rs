//! Tables of deviations at targets (ISO 230-2) and of R-tests become recordings.

use crate::common::machine;
use kincal::convert::{Converted, Request, read};
use kincal::identify::{CalibrateOptions, calibrate};
use kincal::lie::Vec3;
use kincal::machine::JointKind;
use kincal::recording::Recording;
use kincal::simulate::random_deviations;
use kincal::{Chain, Machine};

/// Play, slope and scatter of the table, um.
const PLAY: f64 = 12.0;

/// Deviation at target `i` (mm) in run `j`, um.
fn deviation(i: usize, j: usize, from_below: bool) -> f64 {
    let way = if from_below { -0.5 } else { 0.5 };
    let scatter = [0.3, -0.4, 0.1, 0.5, -0.5][j] * (1.0 + 0.1 * i as f64);
    way * PLAY + 0.2 * i as f64 + scatter
}

fn targets() -> Vec<f64> {
    (0..11).map(|i| 40.0 * i as f64 + [0.0, 0.3, 0.7][i % 3]).collect()
}

fn runs() -> impl Iterator<Item = (usize, bool)> {
    (0..5).flat_map(|j| [(j, true), (j, false)])
}

/// A target a row, in the form of a spreadsheet with decimal commas.
fn a_target_a_row() -> String {
    let mut text = String::from("Prüfbericht;Achse X;\nTarget [mm]");
    runs().for_each(|(j, way)| text += &format!(";{}{}", j + 1, if way { '+' } else { '-' }));
    text += "\nmm";
    runs().for_each(|_| text += ";um");
    for (i, at) in targets().into_iter().enumerate() {
        text += &format!("\n{at}").replace('.', ",");
        for (j, way) in runs() {
            text += &format!(";{:.4}", deviation(i, j, way)).replace('.', ",");
        }
    }
    text
}

/// A run a row.
fn a_run_a_row() -> String {
    let mut text = String::from("Run");
    targets().iter().for_each(|at| text += &format!(",{at}"));
    for (j, way) in runs() {
        text += &format!("\n{} {}", j + 1, if way { "up" } else { "down" });
        for i in 0..targets().len() {
            text += &format!(",{:.4}", deviation(i, j, way));
        }
    }
    text
}

/// A reading a row.
fn a_reading_a_row() -> String {
    let mut text = String::from("run\tdirection\ttarget (mm)\tdeviation (um)");
    for (j, way) in runs() {
        for (i, at) in targets().iter().enumerate() {
            text += &format!(
                "\n{}\t{}\t{at}\t{:.4}",
                j + 1,
                if way { "forward" } else { "reverse" },
                deviation(i, j, way)
            );
        }
    }
    text
}

fn of_x() -> Request {
    Request::default().with_head("fixed y[mm]: 0").with_head("fixed z[mm]: 0").with_joint("x")
}

fn converted(text: &str, machine: &Machine, request: &Request) -> Converted {
    read("x.csv", text.as_bytes(), Some(machine), request).unwrap_or_else(|e| panic!("{e}\n  = {}", e.mend()))
}

#[test]
fn three_forms_of_one_table_are_one_recording() {
    let mill = machine("xyz_mill");
    let told = of_x().with_unit("target", "mm").with_unit("deviation", "um");
    let wide = converted(&a_target_a_row(), &mill, &of_x());
    let across = converted(&a_run_a_row(), &mill, &told);
    let long = converted(&a_reading_a_row(), &mill, &of_x());
    assert_eq!(wide.recordings[0].text, across.recordings[0].text);
    assert_eq!(wide.recordings[0].text, long.recordings[0].text);
    assert_eq!((&wide.positioning, &wide.positioning), (&across.positioning, &long.positioning));
    let text = &wide.recordings[0].text;
    let begins = "# machine: xyz_mill\n# measurement: joint\n# fixed y[mm]: 0\n# fixed z[mm]: 0\nx[mm],x_direction[1],x_meas[mm]\n\
                  0.0,1,-0.0057\n40.3,1,40.29453\n";
    assert!(text.starts_with(begins), "{text}");
    // Back from the far end after it was reached.
    let rows: Vec<&str> = text.lines().skip(5).collect();
    assert_eq!(rows.len(), 110);
    assert!(
        rows[10].starts_with("400.3,1,")
            && rows[11].starts_with("400.3,-1,")
            && rows[21].starts_with("0.0,-1,")
    );
}

/// The figures of ISO 230-2 once more, from their definitions.
#[test]
fn figures_are_those_of_their_definitions() {
    let found =
        converted(&a_target_a_row(), &machine("xyz_mill"), &of_x()).positioning.expect("a table of targets");
    assert_eq!(
        (found.targets, found.runs, found.unit.as_str(), found.joint.as_str()),
        (11, [5, 5], "m", "x")
    );
    let of = |i: usize, way: bool| -> Vec<f64> {
        (0..5).map(|j| (deviation(i, j, way) * 1e4).round() * 1e-10).collect()
    };
    let mean = |i: usize, way: bool| of(i, way).iter().sum::<f64>() / 5.0;
    let s = |i: usize, way: bool| {
        (of(i, way).iter().map(|x| (x - mean(i, way)).powi(2)).sum::<f64>() / 4.0).sqrt()
    };
    let most = |f: &dyn Fn(usize) -> f64| (0..11).map(f).fold(f64::NEG_INFINITY, f64::max);
    let least = |f: &dyn Fn(usize) -> f64| (0..11).map(f).fold(f64::INFINITY, f64::min);
    let same = |a: f64, b: f64| assert!((a - b).abs() < 1e-14, "{a} {b}");
    let both = found.both.expect("both senses");
    same(both.reversal, PLAY * 1e-6);
    same(both.mean_reversal, -PLAY * 1e-6);
    let mid = |i: usize| 0.5 * (mean(i, true) + mean(i, false));
    same(both.mean_deviation, most(&mid) - least(&mid));
    let up = |i: usize| mean(i, true).max(mean(i, false));
    let down = |i: usize| mean(i, true).min(mean(i, false));
    same(both.systematic, most(&up) - least(&down));
    let high = |i: usize| (mean(i, true) + 2.0 * s(i, true)).max(mean(i, false) + 2.0 * s(i, false));
    let low = |i: usize| (mean(i, true) - 2.0 * s(i, true)).min(mean(i, false) - 2.0 * s(i, false));
    same(both.accuracy.expect("five runs"), most(&high) - least(&low));
    let repeatability = |i: usize| {
        let reversal = (mean(i, true) - mean(i, false)).abs();
        (2.0 * s(i, true) + 2.0 * s(i, false) + reversal).max(4.0 * s(i, true)).max(4.0 * s(i, false))
    };
    same(both.repeatability.expect("five runs"), most(&repeatability));
    let forward = found.forward.expect("forward");
    same(forward.systematic, most(&|i| mean(i, true)) - least(&|i| mean(i, true)));
    same(forward.repeatability.expect("five runs"), most(&|i| 4.0 * s(i, true)));
}

#[test]
fn what_a_table_of_targets_does_not_say_is_asked() {
    let mill = machine("xyz_mill");
    let refused = |text: &str, request: &Request| {
        let error = read("x.csv", text.as_bytes(), Some(&mill), request).expect_err("not told");
        format!("{error}\n  = {}", error.mend())
    };
    assert_eq!(
        refused(&a_run_a_row(), &of_x()),
        "x.csv:1: a table of deviations at targets; two things have to be told before it is a recording\n  \
         - unit of the targets\n    tell: --unit target=mm|m|in|deg|rad\n  \
         - unit of the deviations\n    tell: --unit deviation=um|mm|arcsec|urad|mrad|deg\n  \
         = say it by these flags, or in the headings: `target [mm]`, `1+ [um]`"
    );
    assert!(refused(&a_target_a_row(), &Request::default()).ends_with("= --joint y|x|z"));
    // Runs without a sense.
    let plain = "target [mm],run 1 [um],run 2 [um]\n0,1,2\n10,1,3\n20,2,4\n";
    assert!(
        refused(plain, &of_x())
            .contains("from which side the targets of 2 runs were approached\n  = --approach")
    );
    let alternating = of_x().with_approach("alternating");
    let text = &converted(plain, &mill, &alternating).recordings[0].text;
    assert!(text.ends_with("20.0,1,20.002\n20.0,-1,20.004\n10.0,-1,10.003\n0.0,-1,0.002\n"), "{text}");
    // mm in place of um.
    let wrong = "target [mm],1+ [mm],1- [mm]\n0,1,2\n10,1,3\n20,2,4\n";
    let said = refused(wrong, &of_x());
    assert!(said.starts_with("x.csv:4:3: a deviation of 20.000 % of the stretch of the targets"), "{said}");
    // Positions are near the targets.
    let positions = "target [mm],1+ [mm],1- [mm]\n0,0.001,0.004\n10,10.001,10.003\n20,20.002,20.004\n";
    let found = converted(positions, &mill, &of_x());
    assert!(found.recordings[0].text.contains("\n10.0,1,10.001\n"));
    assert!(found.told[0].contains("positions"), "{:?}", found.told);
    // An axis that turns.
    let rotary = "target [deg];1 up [arcsec];1 down [arcsec]\n0;1;2\n90;-1;3\n180;2;4\n";
    let found = read("c.csv", rotary.as_bytes(), Some(&machine("rotary_axis")), &Request::default())
        .expect("one axis");
    let positioning = found.positioning.expect("figures");
    assert_eq!((positioning.unit.as_str(), positioning.runs), ("rad", [1, 1]));
    let both = positioning.both.expect("both senses");
    assert!((both.reversal - (4.0f64 / 3600.0).to_radians()).abs() < 1e-15 && both.accuracy.is_none());
}

/// A log with joints is none of these tables.
#[test]
fn a_log_of_a_machine_is_no_table_of_targets() {
    let scara = machine("scara");
    let log =
        "pos;q1 [deg];q2 [deg];q3 [mm];q4 [deg];x [mm];y [mm];z [mm]\n1;1;2;3;4;5;6;7\n2;2;3;4;5;6;7;8\n";
    let found =
        read("log.csv", log.as_bytes(), Some(&scara), &Request::default()).unwrap_or_else(|e| panic!("{e}"));
    assert!(found.positioning.is_none() && found.recordings[0].text.contains("measurement: position"));
}

/// A machine with errors, seen by an R-test, is found through the table that the R-test leaves.
#[test]
fn an_r_test_says_where_the_tool_stood() {
    let machine = machine("ac_table_tilting");
    let dh = random_deviations(&machine, 1.0, 7);
    let (nominal, actual) = (Chain::nominal(&machine), Chain::new(&machine, &dh));
    let ball = Vec3([0.12, 0.02, 0.05]);
    let commands = machine.commands();
    let at = |name: &str| commands.iter().position(|own| own == name).expect("a joint");
    let mut table = String::from("A (deg),C (deg),dX (um),dY (um),dZ (um)\n");
    let mut truth = Vec::new();
    for k in 0..40 {
        let (a, c) = (f64::from((k * 37) % 120 - 60), f64::from((k * 71) % 360));
        let mut q = vec![0.0; commands.len()];
        (q[at("a")], q[at("c")]) = (a.to_radians(), c.to_radians());
        // The linear axes carry the tool to the ball: each moves along an axis of the machine.
        let gap = ball - nominal.w_from_t(&q).translation;
        let in_t = nominal.w_from_t(&q).rotation.transpose() * gap;
        for (name, along) in [("x", 0), ("y", 1), ("z", 2)] {
            q[at(name)] = in_t.0[along];
        }
        assert!((ball - nominal.w_from_t(&q).translation).norm() < 1e-12);
        let p = actual.w_from_t(&q).translation;
        let e = nominal.w_from_t(&q).rotation.transpose() * (ball - p);
        table += &format!("{a},{c},{:.7},{:.7},{:.7}\n", e.0[0] * 1e6, e.0[1] * 1e6, e.0[2] * 1e6);
        truth.push((q, p));
    }
    let request = Request::default()
        .with_measurement("r-test")
        .with_deviation("ball-minus-tool")
        .with_axes("tool")
        .with_head("workpiece_point[mm]: 120, 20, 50");
    let found = converted(&table, &machine, &request);
    let text = &found.recordings[0].text;
    let recording =
        Recording::from_bytes("r.csv", text.clone().into_bytes(), &machine).unwrap_or_else(|e| panic!("{e}"));
    let mut rows = Vec::new();
    for chunk in recording.chunks().expect("sound") {
        let chunk = chunk.expect("sound");
        let both = chunk.commands.chunks(commands.len()).zip(chunk.values.chunks(3));
        rows.extend(both.map(|(q, p)| (q.to_vec(), p.to_vec())));
    }
    assert_eq!(rows.len(), truth.len());
    for ((q, p), (q_true, p_true)) in rows.iter().zip(&truth) {
        q.iter().zip(q_true).for_each(|(a, b)| assert!((a - b).abs() < 2e-9, "{a} {b}"));
        p.iter().zip(p_true.0).for_each(|(a, b)| assert!((a - b).abs() < 2e-10, "{a} {b}"));
    }
    let (_, fit) = calibrate(&machine, &[recording], CalibrateOptions::default()).expect("sound");
    let rms = fit.rms.m.expect("positions");
    assert!(rms.geometric < 1e-7 && rms.nominal > 1e-5, "{rms:?}");
    // The other sense, and what has to be told.
    let other = request.clone().with_deviation("tool-minus-ball");
    assert_ne!(&converted(&table, &machine, &other).recordings[0].text, text);
    let asked = Request::default().with_measurement("r-test");
    let error = read("r.csv", table.as_bytes(), Some(&machine), &asked).expect_err("not told");
    let said = error.to_string();
    for what in [
        "3 things have",
        "along which axes the deviations were read",
        "--axes tool|machine|workpiece",
        "where the ball stands",
        "--head 'workpiece_point[mm]: X,Y,Z'",
        "--deviation ball-minus-tool|tool-minus-ball",
    ] {
        assert!(said.contains(what), "{said}");
    }
}

/// What a nest reads is one displacement, along whichever axes it is written: on a table that turns, and on a head that does.
#[test]
fn an_r_test_along_the_axes_of_the_workpiece_is_the_same_test() {
    for name in ["ac_table_tilting", "bc_head_table"] {
        let machine = machine(name);
        let dh = random_deviations(&machine, 1.0, 8);
        let (nominal, actual) = (Chain::nominal(&machine), Chain::new(&machine, &dh));
        let ball = Vec3([0.12, 0.02, 0.05]);
        let commands = machine.commands();
        let rotary: Vec<usize> =
            (0..commands.len()).filter(|c| machine.command_joint(*c).kind == JointKind::Revolute).collect();
        let linear: Vec<usize> = (0..commands.len()).filter(|c| !rotary.contains(c)).collect();
        let names: Vec<String> = rotary.iter().map(|c| format!("{} (deg)", commands[*c])).collect();
        let mut tables = [(); 3].map(|()| format!("{},dX (um),dY (um),dZ (um)\n", names.join(",")));
        for k in 0..40 {
            let mut q = vec![0.0; commands.len()];
            q[rotary[0]] = f64::from((k * 37) % 80 - 40).to_radians();
            q[rotary[1]] = f64::from((k * 53) % 80 - 40).to_radians();
            follow(&nominal, &linear, ball, &mut q);
            let sweep = nominal.sweep(&q);
            let e_w = ball - actual.w_from_t(&q).translation;
            let e_t = sweep.w_from_t().rotation.transpose() * e_w;
            let e_b = sweep.b_from_w().rotation * e_w;
            for (table, e) in tables.iter_mut().zip([e_t, e_b, e_w]) {
                let turned = rotary.iter().map(|c| format!("{:.9}", q[*c].to_degrees()));
                let read = e.0.iter().map(|x| format!("{:.7}", x * 1e6));
                *table += &format!("{}\n", turned.chain(read).collect::<Vec<_>>().join(","));
            }
        }
        let told = Request::default()
            .with_measurement("r-test")
            .with_deviation("ball-minus-tool")
            .with_head("workpiece_point[mm]: 120, 20, 50");
        let found = tables.iter().zip(["tool", "machine", "workpiece"]).map(|(table, axes)| {
            let found = converted(table, &machine, &told.clone().with_axes(axes));
            let text = found.recordings[0].text.clone().into_bytes();
            let recording = Recording::from_bytes("r.csv", text, &machine).expect("a recording");
            calibrate(&machine, &[recording], CalibrateOptions::default()).expect("sound")
        });
        let found: Vec<_> = found.collect();
        let rms = |k: usize| found[k].1.rms.m.expect("positions");
        assert!(rms(0).geometric < 1e-7 && rms(0).nominal > 1e-5, "{name} {:?}", rms(0));
        for k in [1, 2] {
            let both = found[0].0.deviations().iter().zip(found[k].0.deviations());
            let apart =
                both.flat_map(|(a, b)| (0..6).map(move |i| (a.to_array()[i] - b.to_array()[i]).abs()));
            // Recordings are written to a tenth of a nanometre.
            assert!(apart.fold(0.0, f64::max) < 1e-8, "{name} {k}");
        }
        // Taken along other axes it is no such machine.
        let wrong = converted(&tables[2], &machine, &told.clone().with_axes("tool"));
        let text = wrong.recordings[0].text.clone().into_bytes();
        let recording = Recording::from_bytes("r.csv", text, &machine).expect("a recording");
        let (_, fit) = calibrate(&machine, &[recording], CalibrateOptions::default()).expect("sound");
        assert!(fit.rms.m.expect("positions").geometric > 1e-6, "{name}");
    }
}

/// Moves linear axes until the tool point is at `ball`: each moves along one line, so that one step is exact.
fn follow(chain: &Chain<f64>, linear: &[usize], ball: Vec3<f64>, q: &mut [f64]) {
    let gap = ball - chain.w_from_t(q).translation;
    let at = |q: &[f64]| chain.w_from_t(q).translation;
    let zero = at(q);
    let column = |c: &usize| {
        let mut moved = q.to_vec();
        moved[*c] += 1.0;
        (at(&moved) - zero).0
    };
    let columns: Vec<[f64; 3]> = linear.iter().map(column).collect();
    let m = kincal::nalgebra::Matrix3::from_fn(|i, j| columns[j][i]);
    let step = m.try_inverse().expect("three axes") * kincal::nalgebra::Vector3::from(gap.0);
    linear.iter().zip(step.iter()).for_each(|(c, x)| q[*c] += x);
}

/// A dynamic capture: `readings` behind a head.
fn capture(rate: &str, interval: &str, readings: &[f64]) -> Vec<u8> {
    let mut bytes = format!(
        "HEADER::\r\nOwner: CARTO-Dynamic\r\nVersion no: 1\r\nSample rate: {rate}\r\nSample no: {}\r\nTrigger interval: {interval}\r\nData:\r\n",
        readings.len()
    )
    .into_bytes();
    readings.iter().for_each(|x| bytes.extend(x.to_le_bytes()));
    bytes.extend(b"EOF::\r\n");
    bytes
}

#[test]
fn a_dynamic_capture_is_time_and_readings() {
    let axis = machine("linear_axis");
    let name = axis.commands()[0].clone();
    let request = Request::default().with_unit("length", "mm").with_head(format!("fixed {name}[mm]: 0"));
    let readings = [0.0, 0.0010, -0.5, 1e-9];
    for (rate, interval) in [("50000", "2e-5"), ("50", "2e-5"), ("50 kHz", "?"), ("50000 Hz", "")] {
        let found = read("x.rtx", &capture(rate, interval, &readings), Some(&axis), &request)
            .unwrap_or_else(|e| panic!("{e}\n  = {}", e.mend()));
        let text = &found.recordings[0].text;
        let expected = format!("t[s],{name}_meas[mm]\n0.0,0.0\n2e-5,0.001\n4e-5,-0.5\n6e-5,1e-9\n");
        assert!(text.ends_with(&expected), "{text}");
    }
    // A bare number that no interval explains is no rate.
    let found = read("x.rtx", &capture("50", "1", &readings), Some(&axis), &request)
        .unwrap_or_else(|e| panic!("{e}"));
    assert!(found.recordings[0].text.contains(&format!("\n{name}_meas[mm]\n0.0\n")));
    let whole = capture("50", "2e-5", &readings);
    let refused = |bytes: &[u8], request: &Request| {
        let error = read("x.rtx", bytes, Some(&axis), request).expect_err("refused");
        assert!(!error.mend().is_empty());
        error.to_string()
    };
    assert!(refused(&whole, &Request::default()).contains("unit of column `reading`"));
    assert_eq!(
        refused(&whole[..whole.len() - 16], &request),
        "x.rtx:5: 4 readings are announced, the file holds 2"
    );
    let mut hole = whole.clone();
    hole.drain(whole.len() - 20..whole.len() - 17);
    assert!(
        refused(&hole, &request).ends_with("behind 4 readings stands something else than `EOF::`"),
        "{}",
        refused(&hole, &request)
    );
    for end in 0..whole.len() - 7 {
        refused(&whole[..end], &request);
    }
}

/// No gap in a table makes a reader panic.
#[test]
fn gaps_in_tables_of_deviations_are_told() {
    let (mill, five) = (machine("xyz_mill"), machine("ac_table_tilting"));
    let wide = "Target [mm];1+ [um];1- [um];2+ [um];2- [um]\n0;-1,2;8,1;-1,0;8,4\n100;0,3;9,9;0,1;9,7\n200;1,8;11,2;2,1;11,0\n";
    let across = "Run,0,100,200\n1 up,1,2,3\n1 down,4,5,6\n";
    let r_test = "A [deg],C [deg],dX [um],dY [um],dZ [um]\n0,0,1,2,3\n10,90,2,-,4\n";
    let told = of_x().with_unit("target", "mm").with_unit("deviation", "um");
    let ball = Request::default()
        .with_measurement("r-test")
        .with_deviation("ball-minus-tool")
        .with_axes("tool")
        .with_head("workpiece_point[mm]: 120, 20, 50");
    for (table, machine, request) in [(wide, &mill, &of_x()), (across, &mill, &told), (r_test, &five, &ball)]
    {
        assert!(read("t.csv", table.as_bytes(), Some(machine), request).is_ok(), "{table}");
        for at in 0..table.len() {
            let gap = format!("{}{}", &table[..at], &table[(at + 4).min(table.len())..]);
            for text in [&table[..at], &gap] {
                if let Err(error) = read("t.csv", text.as_bytes(), Some(machine), request) {
                    assert!(!error.mend().is_empty(), "{error}");
                }
            }
        }
    }
    // A reading of the ball that is missing stays missing.
    let found = read("t.csv", r_test.as_bytes(), Some(&five), &ball).expect("sound");
    assert!(
        found.recordings[0].with_gaps == 1 && found.recordings[0].text.ends_with(",,,\n"),
        "{}",
        found.recordings[0].text
    );
}
