//! What belongs to one effect is told as one: orders of an error motion, waves that swell, a sample that is off among others.

use std::f64::consts::TAU;

use crate::common;
use crate::common::random::normals;
use kincal::diagnose::{DiagnoseOptions, Diagnosis, diagnose};
use kincal::effects::Library;
use kincal::recording::Recording;

fn said_of(text: String) -> Diagnosis {
    let machine = common::machine("rotary_axis");
    let recording = Recording::from_bytes("c.csv", text.into_bytes(), &machine).expect("a recording");
    diagnose(&machine, &[recording], &Library::standard(), &DiagnoseOptions::default(), &|_| {})
        .unwrap_or_else(|e| panic!("{e}"))
}

fn names(said: &Diagnosis) -> Vec<(&str, &str)> {
    said.findings.iter().map(|f| (f.effect.as_str(), f.at.as_str())).collect()
}

/// Seen is a point 100 mm off the axis and 80 mm above its zero; the axis tilts by two and by five waves a turn.
#[test]
fn orders_of_one_error_motion_are_one_finding() {
    let mut noise = normals(5);
    let mut text = String::from(
        "# measurement: position\n# tool_point[mm]: 100,0,80\nt[s],c[deg],px[mm],py[mm],pz[mm]\n",
    );
    for k in 0..3000 {
        let t = 0.02 * f64::from(k);
        let c = (400.0 * (0.1 * t).sin()).to_radians();
        let waves = |n: f64, size: f64| (size * (n * c).sin(), size * (n * c).cos());
        let ((ax, ay), (bx, by)) = (waves(2.0, 8e-5), waves(5.0, 6e-5));
        let (wx, wy) = (ax + bx, ay - by);
        let (x, y, z) = (100.0 * c.cos(), 100.0 * c.sin(), 80.0);
        // p + w x p.
        let p = [x + wy * z, y - wx * z, z + wx * y - wy * x].map(|p| p + 3e-4 * noise());
        text += &format!("{t:.2},{:.6},{:.6},{:.6},{:.6}\n", c.to_degrees(), p[0], p[1], p[2]);
    }
    let said = said_of(text);
    assert_eq!(names(&said), [("axis_wobble", "c")]);
    let size = |name: &str| said.findings[0].coefficients.iter().find(|c| c.name == name).map(|c| c.value);
    let mut orders =
        [size("per_rev").expect("the first order"), size("per_rev_2").expect("the second order")];
    orders.sort_by(f64::total_cmp);
    assert_eq!(orders, [2.0, 5.0]);
    assert!(
        said.findings[0].explanation.contains("per turn; axis c wobbles"),
        "{}",
        said.findings[0].explanation
    );
    assert!(said.findings[0].share > 0.98, "share {}", said.findings[0].share);
}

/// A worm of 40 teeth that meshes harder on one side.
#[test]
fn waves_that_swell_are_one_cyclic_error() {
    let mut noise = normals(6);
    let mut text = String::from("# measurement: joint\n# zero: unknown\nt[s],c[deg],c_meas[deg]\n");
    for k in 0..3000 {
        let t = 0.02 * f64::from(k);
        let c = 100.0 * (0.2 * t).sin();
        let swell = 1.0 + 0.25 * (-((c - 40.0) / 30.0f64).powi(2)).exp();
        let error = 2e-3 * swell * (40.0 * c.to_radians()).sin();
        text += &format!("{t:.2},{c:.6},{:.6}\n", c + error + 2e-4 * noise());
    }
    assert_eq!(names(&said_of(text)), [("cyclic_error", "c")]);
}

/// One reading in four hundred of settled positions is off by as much as a wave that is there too hides.
#[test]
fn a_sample_that_is_off_beside_an_effect_is_told_as_such() {
    let mut noise = normals(7);
    let mut text = String::from("# measurement: joint\n# zero: unknown\nt[s],c[deg],c_meas[deg]\n");
    for k in 0..400 {
        // No order among them.
        let c = 160.0 * ((0.618_033_988_75 * f64::from(k)).fract() - 0.5);
        let off = if k == 50 { 5e-3 } else { 0.0 };
        let error = 4e-3 * (TAU * c / 9.0).sin();
        text += &format!("{:.1},{c:.6},{:.6}\n", 7.0 * f64::from(k), c + error + off + 2e-4 * noise());
    }
    let said = said_of(text);
    assert_eq!(names(&said), [("cyclic_error", "c")]);
    let lines: Vec<u64> = said.outliers.iter().flat_map(|o| o.lines.clone()).collect();
    assert_eq!(lines, [54]);
}

/// Workpiece and tool of a mill that does not turn them: a bar between the two cannot tell which of them has jumped.
#[test]
fn a_slip_that_may_be_of_either_frame_is_told_at_both() {
    let machine = common::machine("xyz_mill");
    let mut noise = normals(8);
    let mut text =
        String::from("# measurement: distance\n# nominal_length[mm]: 100\nt[s],x[mm],y[mm],z[mm],d[mm]\n");
    for k in 0..1500 {
        let t = 0.1 * f64::from(k);
        let (turn, rise) = (0.3 * t, 0.9 * (0.11 * t).sin());
        let q = [turn.cos() * rise.cos(), turn.sin() * rise.cos(), rise.sin()].map(|q| 100.0 * q);
        let jump = if k < 800 { [0.0; 3] } else { [0.02, -0.012, 0.009] };
        let length = (0..3).map(|i| (q[i] + jump[i]).powi(2)).sum::<f64>().sqrt() + 1e-3 * noise();
        text += &format!("{t:.1},{:.5},{:.5},{:.5},{:.5}\n", q[0], q[1], q[2], length - 100.0);
    }
    let recording = Recording::from_bytes("c.csv", text.into_bytes(), &machine).expect("a recording");
    let options = DiagnoseOptions::default();
    let said = diagnose(&machine, &[recording], &Library::standard(), &options, &|_| {});
    let said = said.unwrap_or_else(|e| panic!("{e}"));
    let [slip] = said.findings.as_slice() else { panic!("{:?}", names(&said)) };
    assert_eq!(slip.effect, "setup_slip");
    let places = [slip.at.as_str(), slip.also_at.first().map_or("", |other| other.at.as_str())];
    assert!(places.contains(&"w") && places.contains(&"t"), "{places:?}");
    assert!(slip.probability > 0.9, "{}", slip.probability);
    let others: f64 = slip.confusable_with.iter().map(|other| other.probability).sum();
    assert!(slip.probability + others <= 1.0 + 1e-12);
}
