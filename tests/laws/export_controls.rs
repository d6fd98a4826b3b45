//! Controls that are given our numbers bring the tool where the calibrated machine has it, as far as they can.

use std::path::Path;

use crate::common::random::Random;
use kincal::export::{ExportOptions, Exported, Format, export};
use kincal::import::{Beside, ImportOptions, read_with};
use kincal::lie::{Pose, Twist, Vec3};
use kincal::{CalibratedMachine, Chain, Machine};

const TOOL: f64 = 0.0931037;

fn shipped(name: &str) -> Machine {
    Machine::open(Path::new(env!("CARGO_MANIFEST_DIR")).join("machines").join(name)).expect("a machine")
}

/// B turns the table and carries A, as xyzab_tdr_kins has it.
fn table_b_a() -> Machine {
    Machine::parse(
        "ba.ron",
        r#"Machine(
    name: "ba_table", units: (length: mm, angle: deg), tolerance: (translation: 0.03, rotation: 0.004),
    workpiece: [
        (frame: "b", at: (20, -10, -90), joint: Revolute(axis: "-y", travel: (-120, 120))),
        (frame: "a", at: (0, 3, 45), joint: Revolute(axis: "-x", travel: (-120, 120))),
        (frame: "w", at: (0, 0, 30)),
    ],
    tool: [
        (frame: "x", joint: Prismatic(axis: "x", travel: (-300, 300))),
        (frame: "y", joint: Prismatic(axis: "y", travel: (-300, 300))),
        (frame: "z", joint: Prismatic(axis: "z", travel: (-300, 300))),
        (frame: "t"),
    ],
)"#,
    )
    .expect("a machine")
}

fn options() -> ExportOptions {
    let mut options = ExportOptions::default();
    options.tool_length = TOOL;
    options
}

fn value(exported: &Exported, name: &str) -> f64 {
    let number = exported.numbers.iter().find(|n| n.name.ends_with(name)).expect(name);
    number.value.expect("determined")
}

fn turned(axis: usize, deg: f64, v: [f64; 3]) -> [f64; 3] {
    let (s, c) = deg.to_radians().sin_cos();
    let (i, k) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut out = v;
    out[i] = c * v[i] - s * v[k];
    out[k] = s * v[i] + c * v[k];
    out
}

fn plus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// W = P + Rz(-C) (o + R(-first) (J - P - o)), mm and deg; `axis` of the first: 0 for A, 1 for B.
fn trt(axis: usize, p: [f64; 3], o: [f64; 3], j: [f64; 3], first: f64, c: f64) -> [f64; 3] {
    let inner = plus(o, turned(axis, -first, minus(minus(j, p), o)));
    plus(p, turned(2, -c, inner))
}

/// W = P + Rx(A) (Ry(B) (J - P - dt ez) - dz ez) + (dz + dt) ez.
fn tdr(p: [f64; 3], dz: f64, dt: f64, j: [f64; 3], a: f64, b: f64) -> [f64; 3] {
    let inner = turned(1, b, minus(minus(j, p), [0.0, 0.0, dt]));
    plus(plus(p, turned(0, a, minus(inner, [0.0, 0.0, dz]))), [0.0, 0.0, dz + dt])
}

/// W = J + L ez + Rz(C) Ry(-B) (0, 0, -L).
fn head(l: f64, j: [f64; 3], b: f64, c: f64) -> [f64; 3] {
    plus(plus(j, [0.0, 0.0, l]), turned(2, c, turned(1, -b, [0.0, 0.0, -l])))
}

/// Wxy = Rz(C) (Jxy + (L sin B, 0)), Wz = Jz + L - L cos B.
fn bifurcated(l: f64, j: [f64; 3], b: f64, c: f64) -> [f64; 3] {
    let (s, k) = b.to_radians().sin_cos();
    turned(2, c, plus(j, [l * s, 0.0, l - l * k]))
}

/// Rows that LinuxCNC's own modules have computed (docs/export.md); they say that the formulas of this file are theirs.
#[test]
fn the_formulas_are_those_of_linuxcnc() {
    let same = |is: [f64; 3], expected: [f64; 3]| {
        (0..3).for_each(|k| assert!((is[k] - expected[k]).abs() < 1e-9, "{is:?} {expected:?}"));
    };
    let (p, o) = ([13.8039, -38.7102, -22.6735], [0.0, -31.8068, 6.8595 + 93.1037]);
    let j = [1.096579, -191.382412, -156.235885];
    same(trt(0, p, o, j, 69.634, 192.791153), [91.02062043063322, 244.00769490289753, 109.32906316348355]);
    let (p, o) = ([-31.951, -24.8131, -0.8498], [35.2441, 0.0, 52.0764 + 165.5842]);
    let j = [167.682078, -193.92573, 186.971709];
    same(trt(1, p, o, j, 71.795193, -167.2981), [-106.90082741414594, 165.43529040731792, 363.6492582156822]);
    let (p, j) = ([15.914, 50.2569, -7.8851], [-108.744361, -214.54834, -276.159214]);
    let w = tdr(p, 39.6147, 109.6511, j, -117.965677, 212.771701);
    same(w, [325.2992604134891, 360.5148396514744, 276.4669972652997]);
    // With W at 8.749275 the pivot is that much longer, and stands where it was.
    let w = head(187.3456 + 8.749275, [-13.209319, -275.501427, 77.615565], -33.186132, -177.442897);
    same(minus(w, [0.0, 0.0, 8.749275]), [94.01842601853178, -270.71268717111525, 100.849987226036]);
    // The same with U and V, which move the head: U turns with B.
    let (u, v, w, b) = (-12.883807, -16.763323, -23.229832, -4.071289_f64);
    let head_moved = [u * b.to_radians().cos(), v, u * b.to_radians().sin()];
    let j = minus([286.4829203319224, 67.46567622485475, 99.02009601255025], head_moved);
    let tip = minus(bifurcated(187.3456 + w, j, b, 94.897253), [0.0, 0.0, w]);
    same(tip, [-108.480714, 279.441612, 121.749357]);
}

/// A machine whose deviations are shifts only: those that a module can take, besides those that no module need take.
fn shifted(machine: Machine, shifts: &[(&str, [f64; 3])]) -> CalibratedMachine {
    let mut dh = vec![Twist::zero(0.0); machine.dyads().len()];
    for (frame, v) in shifts {
        dh[machine.frame_index(frame).expect("a frame")].v = Vec3(v.map(|x| x * 1e-3));
    }
    // How the part lies on the table is found again.
    dh[machine.w_index()] = Twist::from_array([1e-4, -2e-4, 3e-4, 2e-4, -1e-4, 4e-4]);
    CalibratedMachine::nominal(machine).with_deviations(dh)
}

/// Largest distance of the model's tip from that of `world` (J in mm, the two angles in deg, as the module has them) over random
/// commands, mm.
fn apart(
    calibrated: &CalibratedMachine,
    rotary: [(&str, f64); 2],
    world: impl Fn([f64; 3], [f64; 2]) -> [f64; 3],
) -> f64 {
    let machine = calibrated.machine();
    let at = |name: &str| machine.commands().iter().position(|c| c == name).expect("a command");
    let chain = calibrated.chain();
    let mut rng = Random::new(2);
    let home = vec![0.0; machine.commands().len()];
    // Where the tip is at home the program's zero is put, and its axes along the machine's: what an operator does with a part.
    let w_from_world = chain.w_from_t(&home);
    let zero = world([0.0, 0.0, 0.0], [0.0; 2]);
    let mut largest: f64 = 0.0;
    for _ in 0..200 {
        let q: Vec<f64> = machine.commands().iter().map(|_| rng.between(-1.5, 1.5)).collect();
        let linear = ["x", "y", "z"].map(|name| 1e3 * q[at(name)]);
        let angles = rotary.map(|(name, sense)| sense * q[at(name)].to_degrees());
        let w = minus(world(linear, angles), zero).map(|x| 1e-3 * x);
        let gap = w_from_world.transform(Vec3(w)) - chain.w_from_t(&q).translation;
        largest = largest.max(1e3 * gap.norm());
    }
    largest
}

/// The machine that `import` makes of a configuration with an exported file.
fn reimported(out: &Exported) -> Machine {
    let module = out.told[0].split([' ', ';']).nth(2).expect("a module");
    let ini = format!("[KINS]\nKINEMATICS = {module}\n[TRAJ]\nLINEAR_UNITS = mm\n");
    let mut options = ImportOptions::default();
    options.tool_length = TOOL;
    options.hal = vec!["machine.hal".into()];
    options.beside = vec![Beside::new("machine.hal", out.text.clone())];
    read_with("machine.ini", &ini, &options).expect("sound").machine
}

/// Its tip as the module has it, mm and deg.
fn world(machine: &Machine, rotary: [&'static str; 2]) -> impl Fn([f64; 3], [f64; 2]) -> [f64; 3] {
    move |j, angles| {
        let of = |name: &String| match rotary.iter().position(|own| own == name) {
            Some(k) => angles[k].to_radians(),
            None => ["x", "y", "z"].iter().position(|own| own == name).map_or(0.0, |k| j[k] * 1e-3),
        };
        let q: Vec<f64> = machine.commands().iter().map(of).collect();
        Chain::nominal(machine).w_from_t(&q).translation.0.map(|x| 1e3 * x)
    }
}

#[test]
fn linuxcnc_with_our_numbers_has_the_tool_tip_of_the_model_where_it_can() {
    // Rounding of metres in double precision, a thousandth of a nanometre.
    const SAME: f64 = 1e-9;
    let dt = TOOL * 1e3;
    let shifts = [("a", [0.05, -0.03, 0.02]), ("c", [0.04, 0.06, -0.03]), ("y", [0.01, 0.02, 0.03])];
    let ac = shifted(shipped("ac_table_tilting.ron"), &shifts);
    let out = export(&ac, Format::LinuxCnc, &options()).expect("a module");
    assert!(out.told[0].contains("xyzac-trt-kins"), "{:?}", out.told);
    let p = ["x-rot-point", "y-rot-point", "z-rot-point"].map(|pin| value(&out, pin));
    let o = [0.0, value(&out, "y-offset"), value(&out, "z-offset") + dt];
    let gap = apart(&ac, [("a", 1.0), ("c", 1.0)], |j, [a, c]| trt(0, p, o, j, a, c));
    assert!(gap < SAME, "{gap:e}");
    let gap = apart(&ac, [("a", 1.0), ("c", 1.0)], world(&reimported(&out), ["a", "c"]));
    assert!(gap < SAME, "{gap:e}");
    assert!(out.left_out.is_empty(), "{:?}", out.left_out);

    let shifts = [("b", [0.05, -0.03, 0.02]), ("c", [0.04, 0.06, -0.03]), ("t", [0.01, 0.02, 0.03])];
    let bc = shifted(shipped("bc_table_tilting.ron"), &shifts);
    let out = export(&bc, Format::LinuxCnc, &options()).expect("a module");
    let p = ["x-rot-point", "y-rot-point", "z-rot-point"].map(|pin| value(&out, pin));
    let o = [value(&out, "x-offset"), 0.0, value(&out, "z-offset") + dt];
    let gap = apart(&bc, [("b", 1.0), ("c", 1.0)], |j, [b, c]| trt(1, p, o, j, b, c));
    assert!(gap < SAME, "{gap:e}");
    let gap = apart(&bc, [("b", 1.0), ("c", 1.0)], world(&reimported(&out), ["b", "c"]));
    assert!(gap < SAME, "{gap:e}");

    let ba = shifted(table_b_a(), &[("b", [0.05, -0.03, 0.02]), ("a", [0.04, 0.06, -0.03])]);
    let out = export(&ba, Format::LinuxCnc, &options()).expect("a module");
    let p = ["x-rot-point", "y-rot-point", "z-rot-point"].map(|pin| value(&out, pin));
    let dz = value(&out, "z-offset");
    let gap = apart(&ba, [("a", 1.0), ("b", 1.0)], |j, [a, b]| tdr(p, dz, dt, j, a, b));
    assert!(gap < SAME, "{gap:e}");
    let gap = apart(&ba, [("a", 1.0), ("b", 1.0)], world(&reimported(&out), ["a", "b"]));
    assert!(gap < SAME, "{gap:e}");

    let shifts = [("b", [0.02, 0.01, 0.04]), ("t", [0.0, 0.03, 0.01]), ("c", [0.03, -0.05, 0.02])];
    let bc = shifted(shipped("bc_head_table.ron"), &shifts);
    let out = export(&bc, Format::LinuxCnc, &options()).expect("a module");
    let l = value(&out, "pivot-length");
    let zero = [value(&out, "machine zero of X"), value(&out, "machine zero of Y"), 0.0];
    let gap = apart(&bc, [("b", -1.0), ("c", 1.0)], |j, [b, c]| bifurcated(l, minus(j, zero), b, c));
    assert!(gap < SAME, "{gap:e}");
    let back = reimported(&out);
    let tip = world(&back, ["b", "c"]);
    let gap = apart(&bc, [("b", -1.0), ("c", 1.0)], |j, angles| tip(minus(j, zero), angles));
    assert!(gap < SAME, "{gap:e}");

    // The head turns against the module, which is told.
    let bc = shifted(shipped("bc_head_head.ron"), &[("b", [-0.05, 0.02, 0.04]), ("t", [0.05, -0.02, 0.01])]);
    let out = export(&bc, Format::LinuxCnc, &options()).expect("a module");
    let l = value(&out, "pivot-length");
    let gap = apart(&bc, [("b", -1.0), ("c", 1.0)], |j, [b, c]| head(l, j, b, c));
    assert!(gap < SAME, "{gap:e}");
    let gap = apart(&bc, [("b", -1.0), ("c", 1.0)], world(&reimported(&out), ["b", "c"]));
    assert!(gap < SAME, "{gap:e}");
    assert!(out.told.iter().any(|line| line.starts_with("axis b turns against")), "{:?}", out.told);
}

#[test]
fn what_a_module_cannot_take_is_listed_with_its_size() {
    let machine = shipped("ac_table_tilting.ron");
    let mut dh = vec![Twist::zero(0.0); machine.dyads().len()];
    // 100 urad between Y and X: over half a travel of 450 mm some 20 um either way.
    dh[machine.frame_index("x").expect("a frame")].w.0[2] = 1e-4;
    let tilted = CalibratedMachine::nominal(machine).with_deviations(dh);
    let out = export(&tilted, Format::LinuxCnc, &options()).expect("a module");
    let left = out.left_out.first().expect("something is left");
    let max = left.max_m.expect("a size");
    assert!((5e-6..9e-5).contains(&max), "{max:e}");
    assert!(out.left_out.iter().any(|left| left.what == "of this, squareness of y"), "{:?}", out.left_out);
}

#[test]
fn what_recordings_left_open_is_not_entered() {
    let machine = shipped("ac_table_tilting.ron");
    let mut calibrated = CalibratedMachine::nominal(machine).to_ron();
    // Nothing has shown where A lies along y.
    calibrated = calibrated.replace(
        "calibration: (",
        "calibration: (unseen: [[(frame: \"a\", v: (0, 0.03, 0), w: (0, 0, 0))]], ",
    );
    let calibrated = CalibratedMachine::parse("open.ron", &calibrated).expect("sound");
    for (format, open) in [
        (Format::LinuxCnc, vec!["xyzac-trt-kins.y-rot-point"]),
        (Format::Siemens, vec!["$TC_CARR5[1] I2.y", "$TC_CARR19[1] I4.y"]),
        (Format::Heidenhain, vec!["c.Y", "a.Y", "EY0A", "EY0C"]),
        (Format::Iso230, vec!["EY0A", "EY0C"]),
    ] {
        let out = export(&calibrated, format, &options()).expect("a form");
        let missing: Vec<&str> =
            out.numbers.iter().filter(|n| n.value.is_none()).map(|n| n.name.as_str()).collect();
        assert_eq!(missing, open, "{format}");
        assert!(out.numbers.iter().all(|n| n.value.is_none() == n.because.is_some()));
        for name in open {
            let entered = name.split(' ').next().unwrap_or_default();
            let begins = |line: &str| {
                line.starts_with(&format!("setp {entered} ")) || line.starts_with(&format!("{entered}="))
            };
            assert!(!out.text.lines().any(begins), "{format}: {name} is in the file");
        }
    }
}

/// The vectors of a control put together are its tool tip: linear axes exactly square, rotary axes anywhere.
#[test]
fn siemens_with_our_vectors_has_the_tool_tip_of_the_model() {
    let machine = shipped("ac_table_tilting.ron");
    let mut dh = vec![Twist::zero(0.0); machine.dyads().len()];
    for (frame, six) in
        [("a", [5e-5, -3e-5, 2e-5, 1e-4, 2e-4, -1e-4]), ("c", [4e-5, 6e-5, 1e-5, -2e-4, 1e-4, 0.0])]
    {
        dh[machine.frame_index(frame).expect("a frame")] = Twist::from_array(six);
    }
    let calibrated = CalibratedMachine::nominal(machine).with_deviations(dh);
    let out = export(&calibrated, Format::Siemens, &options()).expect("vectors");
    let vector = |name: &str, first: usize, unit: f64| {
        Vec3(
            [0, 1, 2].map(|k| unit * value(&out, &format!("{}[1] {name}.{}", first + k, ["x", "y", "z"][k]))),
        )
    };
    let (i2, i3, i4) = (vector("I2", 4, 1e-3), vector("I3", 15, 1e-3), vector("I4", 18, 1e-3));
    let (v1, v2) = (vector("V1", 7, 1.0), vector("V2", 10, 1.0));
    assert!((i2 + i3 + i4).norm() < 1e-12);
    let chain = calibrated.chain();
    let home = chain.w_from_t(&[0.0; 5]);
    let mut rng = Random::new(8);
    let names = calibrated.machine().commands().to_vec();
    for _ in 0..100 {
        let q: Vec<f64> = names.iter().map(|_| rng.between(-1.5, 1.5)).collect();
        let of = |name: &str| q[names.iter().position(|n| n == name).expect("a command")];
        // The table carries the part: it turns by A about V1 through I2, and by C about V2 through I2 + I3.
        let tip = Vec3([of("x"), of("y"), of("z") - TOOL]);
        let back = |axis: Vec3<f64>, at: Vec3<f64>, angle: f64, p: Vec3<f64>| {
            Pose::turn(axis, -angle).rotation * (p - at) + at
        };
        let turned = back(v2, i2 + i3, of("c"), back(v1, i2, of("a"), tip));
        let gap = home.transform(turned + Vec3([0.0, 0.0, TOOL])) - chain.w_from_t(&q).translation;
        assert!(gap.norm() < 1e-12, "{:e}", gap.norm());
    }
    assert!(out.left_out.is_empty(), "{:?}", out.left_out);
}
