//! Against others: the forward kinematics of LinuxCNC's modules, and an independent program's values for the paper's machine.
//!
//! Every convention of a peer becomes a chain of dyads through [`Machine::new`]; no closed formula of a peer is repeated here.

use std::collections::HashMap;
use std::path::Path;

use crate::common::{data, machine};
use kincal::lie::{Pose, Twist, Vec3, Wrench};
use kincal::machine::{Dyad, FileUnits, Joint, JointKind};
use kincal::{Chain, Machine};

/// A row by the names of its columns; `mm` columns come in m, `deg` columns in rad.
struct Row(HashMap<String, f64>);

impl Row {
    fn get(&self, name: &str) -> f64 {
        *self.0.get(name).unwrap_or_else(|| panic!("no column {name}"))
    }

    fn twist(&self, prefix: &str) -> [f64; 6] {
        ["vx", "vy", "vz", "wx", "wy", "wz"].map(|k| self.get(&format!("{prefix}_{k}")))
    }
}

fn rows(path: &Path) -> Vec<Row> {
    let mut reader = csv::Reader::from_path(path).expect("a readable table");
    let header: Vec<String> = reader.headers().expect("a header").iter().map(str::to_string).collect();
    let value = |name: &str, text: &str| {
        let value: f64 = text.parse().ok()?;
        Some(if name.ends_with("_mm") {
            value / 1e3
        } else if name.ends_with("_deg") {
            value.to_radians()
        } else {
            value
        })
    };
    let row = |record: csv::StringRecord| {
        let cells = header.iter().zip(&record);
        Row(cells.filter_map(|(name, text)| Some((name.clone(), value(name, text)?))).collect())
    };
    reader.records().map(|record| row(record.expect("a full row"))).collect()
}

const X: Vec3<f64> = Vec3([1.0, 0.0, 0.0]);
const Y: Vec3<f64> = Vec3([0.0, 1.0, 0.0]);
const Z: Vec3<f64> = Vec3([0.0, 0.0, 1.0]);
const ZERO: Vec3<f64> = Vec3([0.0; 3]);

fn fixed(frame: &str, at: Vec3<f64>) -> Dyad {
    Dyad::new(frame).at(at)
}

fn joint(frame: &str, at: Vec3<f64>, kind: JointKind, axis: Vec3<f64>) -> Dyad {
    fixed(frame, at).with_joint(Joint::new(frame, kind, axis))
}

fn turns(frame: &str, at: Vec3<f64>, axis: Vec3<f64>) -> Dyad {
    joint(frame, at, JointKind::Revolute, axis)
}

fn slides(frame: &str, axis: Vec3<f64>) -> Dyad {
    joint(frame, ZERO, JointKind::Prismatic, axis)
}

fn xyz() -> Vec<Dyad> {
    vec![slides("x", X), slides("y", Y), slides("z", Z)]
}

/// `w_from_t` of the chain at the row's joint columns, given as pairs of joint and column.
fn w_from_t(workpiece: Vec<Dyad>, tool: Vec<Dyad>, row: &Row, columns: &[(&str, &str)]) -> Pose<f64> {
    let machine = Machine::new("peer", FileUnits::si(), workpiece, tool).expect("a valid machine");
    let column = |command: &String| columns.iter().find(|(name, _)| name == command).expect("a column").1;
    let q: Vec<f64> = machine.commands().iter().map(|c| row.get(column(c))).collect();
    Chain::nominal(&machine).w_from_t(&q)
}

/// How far off, mm.
fn assert_at(row: &Row, p: Vec3<f64>, file: &str, line: usize) -> f64 {
    let world = Vec3([row.get("world_x_mm"), row.get("world_y_mm"), row.get("world_z_mm")]);
    let off = (p - world).norm() * 1e3;
    assert!(off < 1e-9, "{file}, row {line}: off by {off} mm");
    off
}

/// How far turned against `R = Rz(c) Ry(b) Rx(a)` of the world columns, deg.
fn assert_turned(row: &Row, pose: Pose<f64>, file: &str, line: usize) -> f64 {
    let turn = |axis, column| Pose::turn(axis, row.get(column));
    let world = turn(Z, "world_c_deg") * turn(Y, "world_b_deg") * turn(X, "world_a_deg");
    let between = Pose { translation: ZERO, ..world }.inverse() * Pose { translation: ZERO, ..pose };
    let off = between.rotation_vector().norm().to_degrees();
    assert!(off < 1e-9, "{file}, row {line}: turned by {off} deg");
    off
}

/// Runs over one table; `chain` makes the pose of a row, arms are compared in orientation too.
fn compare(file: &str, oriented: bool, chain: impl Fn(&Row) -> Pose<f64>) {
    let folder = data("peers/linuxcnc");
    let rows = rows(&folder.join(file));
    assert!(rows.len() >= 300, "{file} has only {} rows", rows.len());
    let (mut off_mm, mut off_deg) = (0.0f64, 0.0f64);
    for (i, row) in rows.iter().enumerate() {
        let pose = chain(row);
        off_mm = off_mm.max(assert_at(row, pose.translation, file, i + 2));
        if oriented {
            off_deg = off_deg.max(assert_turned(row, pose, file, i + 2));
        }
    }
    let turned = if oriented { format!(", {off_deg:.1e} deg") } else { String::new() };
    println!("{file:<16} {} rows: worst {off_mm:.1e} mm{turned}", rows.len());
}

fn rotary_point(row: &Row) -> Vec3<f64> {
    Vec3(["x", "y", "z"].map(|k| row.get(&format!("pin_{k}_rot_point_mm"))))
}

const XYZ: [(&str, &str); 3] = [("x", "joint_X_mm"), ("y", "joint_Y_mm"), ("z", "joint_Z_mm")];

fn with_xyz<'a>(more: &[(&'a str, &'a str)]) -> Vec<(&'a str, &'a str)> {
    XYZ.iter().chain(more).copied().collect()
}

fn tool_on_xyz() -> Vec<Dyad> {
    xyz().into_iter().chain([fixed("t", ZERO)]).collect()
}

#[test]
#[ignore = "needs the data sets"]
fn xyzac_trt() {
    compare("xyzac-trt.csv", false, |row| {
        let p = rotary_point(row);
        let o = Vec3([
            0.0,
            row.get("pin_y_offset_mm"),
            row.get("pin_z_offset_mm") + row.get("pin_tool_offset_mm"),
        ]);
        let table = vec![turns("a", p + o, X), turns("c", -o, Z), fixed("w", -p)];
        w_from_t(table, tool_on_xyz(), row, &with_xyz(&[("a", "joint_A_deg"), ("c", "joint_C_deg")]))
    });
}

#[test]
#[ignore = "needs the data sets"]
fn xyzbc_trt() {
    compare("xyzbc-trt.csv", false, |row| {
        let p = rotary_point(row);
        let o = Vec3([
            row.get("pin_x_offset_mm"),
            0.0,
            row.get("pin_z_offset_mm") + row.get("pin_tool_offset_mm"),
        ]);
        let table = vec![turns("b", p + o, Y), turns("c", -o, Z), fixed("w", -p)];
        w_from_t(table, tool_on_xyz(), row, &with_xyz(&[("b", "joint_B_deg"), ("c", "joint_C_deg")]))
    });
}

#[test]
#[ignore = "needs the data sets"]
fn xyzab_tdr() {
    compare("xyzab-tdr.csv", false, |row| {
        let p = rotary_point(row);
        let dz = Vec3([0.0, 0.0, row.get("pin_z_offset_mm")]);
        let dt = Vec3([0.0, 0.0, row.get("pin_tool_offset_z_mm")]);
        // B stands next to the base in the module's formula, and both turn against the usual sense.
        let table = vec![turns("b", p + dt, -Y), turns("a", dz, -X), fixed("w", -(p + dz + dt))];
        w_from_t(table, tool_on_xyz(), row, &with_xyz(&[("a", "joint_A_deg"), ("b", "joint_B_deg")]))
    });
}

#[test]
#[ignore = "needs the data sets"]
fn five_axis_bridge_mill() {
    compare("5axiskins.csv", false, |row| {
        let pivot = Vec3([0.0, 0.0, row.get("pin_pivot_length_mm")]);
        let mut tool = xyz();
        tool.extend([turns("c", pivot, Z), turns("b", ZERO, -Y), slides("along", -Z), fixed("t", -pivot)]);
        let columns = [("b", "joint_B_deg"), ("c", "joint_C_deg"), ("along", "joint_W_mm")];
        w_from_t(vec![fixed("w", ZERO)], tool, row, &with_xyz(&columns))
    });
}

#[test]
#[ignore = "needs the data sets"]
fn max_bifurcated_mill() {
    compare("maxkins.csv", false, |row| {
        let pivot = Vec3([0.0, 0.0, row.get("pin_pivot_length_mm")]);
        let mut tool = xyz();
        tool.extend([slides("v", -Y), turns("b", pivot, -Y), slides("u", -X), slides("along", -Z)]);
        tool.push(fixed("t", -pivot));
        let columns = [
            ("b", "joint_B_deg"),
            ("c", "joint_C_deg"),
            ("u", "joint_U_mm"),
            ("v", "joint_V_mm"),
            ("along", "joint_W_mm"),
        ];
        w_from_t(vec![turns("c", ZERO, -Z), fixed("w", ZERO)], tool, row, &with_xyz(&columns))
    });
}

/// Modified DH: Rx(alpha) Tx(a) Rz(q) Tz(d), lengths in m; the last element is the tool's.
fn modified_dh(links: [(f64, f64, f64); 6], row: &Row) -> Pose<f64> {
    let mut behind = ZERO;
    let mut tool: Vec<Dyad> = Vec::new();
    for (i, (alpha, a, d)) in links.into_iter().enumerate() {
        let place = Pose::translation(behind) * Pose::turn(X, alpha) * Pose::translation(Vec3([a, 0.0, 0.0]));
        let frame = format!("q{i}");
        tool.push(turns(&frame, ZERO, Z).placed(place));
        behind = Vec3([0.0, 0.0, d]);
    }
    tool.push(fixed("t", behind));
    let names: Vec<(String, String)> = (0..6).map(|i| (format!("q{i}"), format!("joint_J{i}_deg"))).collect();
    let columns: Vec<(&str, &str)> = names.iter().map(|(q, c)| (q.as_str(), c.as_str())).collect();
    w_from_t(vec![fixed("w", ZERO)], tool, row, &columns)
}

#[test]
#[ignore = "needs the data sets"]
fn generic_serial_arm() {
    compare("genserkins.csv", true, |row| {
        let link = |i: usize| {
            (
                row.get(&format!("pin_ALPHA_{i}_rad")),
                row.get(&format!("pin_A_{i}_mm")),
                row.get(&format!("pin_D_{i}_mm")),
            )
        };
        modified_dh(std::array::from_fn(link), row)
    });
}

#[test]
#[ignore = "needs the data sets"]
fn puma_arm() {
    use std::f64::consts::FRAC_PI_2;
    compare("pumakins.csv", true, |row| {
        let [a2, a3, d3, d4, d6] =
            ["A2", "A3", "D3", "D4", "D6"].map(|name| row.get(&format!("pin_{name}_mm")));
        let links = [
            (0.0, 0.0, 0.0),
            (-FRAC_PI_2, 0.0, 0.0),
            (0.0, a2, d3),
            (-FRAC_PI_2, a3, d4),
            (FRAC_PI_2, 0.0, 0.0),
            (-FRAC_PI_2, 0.0, d6),
        ];
        modified_dh(links, row)
    });
}

/// The joints of a golden row, in the order of the machine's commands.
fn golden_commands(machine: &Machine, row: &Row) -> Vec<f64> {
    let column = |command: &String| match command.as_str() {
        rotary @ ("a" | "c") => format!("{rotary}_rad"),
        linear => format!("{linear}_m"),
    };
    machine.commands().iter().map(|c| row.get(&column(c))).collect()
}

/// Increments of chain factors as in the paper's table 6, one per dyad in machine order: m and rad.
fn table_6(machine: &Machine, folder: &Path) -> Vec<Twist<f64>> {
    let text = std::fs::read_to_string(folder.join("table6.csv")).expect("table 6");
    let of = |frame: &str| {
        let line = text.lines().find(|line| line.split(',').next() == Some(frame)).expect("the frame's line");
        let cells: Vec<f64> = line.split(',').skip(1).map(|c| c.trim().parse().expect("a number")).collect();
        Twist::from_array(std::array::from_fn(|k| cells[k] * 1e-6))
    };
    machine.dyads().iter().map(|d| of(&d.frame)).collect()
}

/// Factor `F <- F exp(d)` with `F = inv(E)` on the workpiece branch: `E exp(dh) = exp(-d) E`, so `dh = -Ad(inv(E)) d`.
fn deviation_of_factor(machine: &Machine, j: usize, d: Twist<f64>) -> Twist<f64> {
    if j >= machine.workpiece_count() {
        return d;
    }
    -machine.dyads()[j].placement.pose().inverse().carry_twist(d)
}

/// The distance row over increments of chain factors, from our row over deviations.
fn factor_row(machine: &Machine, q: &[f64]) -> Vec<f64> {
    let sweep = Chain::nominal(machine).sweep(q);
    let p = sweep.w_from_t().translation;
    let along = p.times(p.norm().recip());
    let mut row = vec![0.0; 6 * machine.dyads().len()];
    sweep.error_row(Wrench::at_point(along, p), &mut row);
    for j in 0..machine.workpiece_count() {
        let block = &mut row[6 * j..6 * j + 6];
        let wrench =
            Wrench { f: Vec3([block[0], block[1], block[2]]), m: Vec3([block[3], block[4], block[5]]) };
        let carried = machine.dyads()[j].placement.pose().inverse().carry_wrench(wrench);
        block.copy_from_slice(&carried.to_array().map(|c| -c));
    }
    row
}

#[test]
#[ignore = "needs the data sets"]
fn golden_positions_of_the_paper_machine() {
    let folder = data("paper");
    let machine = machine("ac_table_tilting_paper");
    let increments = table_6(&machine, &folder);
    let deviations: Vec<_> =
        increments.iter().enumerate().map(|(j, d)| deviation_of_factor(&machine, j, *d)).collect();
    let (nominal, actual) = (Chain::nominal(&machine), Chain::new(&machine, &deviations));
    let rows = rows(&folder.join("golden_fk.csv"));
    assert!(!rows.is_empty());
    let mut worst = 0.0f64;
    for row in &rows {
        let q = golden_commands(&machine, row);
        let golden = |name: &str| Vec3(["x", "y", "z"].map(|k| row.get(&format!("{name}_{k}_m"))));
        let (p, p_6) = (nominal.w_from_t(&q).translation, actual.w_from_t(&q).translation);
        assert!((p - golden("pw")).norm() < 1e-12, "{p:?}");
        assert!((p_6 - golden("pw6")).norm() < 1e-12, "{p_6:?}");
        assert!((p_6.norm() - 0.1 - row.get("dist6_minus_L_m")).abs() < 1e-12);
        let by_increment = factor_row(&machine, &q);
        let linear: f64 =
            (increments.iter().flat_map(|d| d.to_array()).zip(by_increment)).map(|(d, r)| d * r).sum();
        assert!((linear - row.get("linear_Jd_phi6_m")).abs() < 1e-12, "{linear}");
        worst = worst.max((p - golden("pw")).norm()).max((p_6 - golden("pw6")).norm());
    }
    println!("golden positions {} rows: worst {worst:.1e} m", rows.len());
}

#[test]
#[ignore = "needs the data sets"]
fn golden_distance_rows_of_the_paper_machine() {
    let folder = data("paper");
    let machine = machine("ac_table_tilting_paper");
    let positions = rows(&folder.join("golden_fk.csv"));
    let golden = rows(&folder.join("golden_jacobian.csv"));
    assert_eq!(golden.len(), 4);
    let mut worst = 0.0f64;
    for row in golden {
        let phi = row.get("phi_deg");
        let at = positions.iter().find(|p| (p.get("phi_deg") - phi).abs() < 1e-9).expect("the same phi");
        let ours = factor_row(&machine, &golden_commands(&machine, at));
        for (j, dyad) in machine.dyads().iter().enumerate() {
            for (k, theirs) in row.twist(&dyad.frame).into_iter().enumerate() {
                let difference = (ours[6 * j + k] - theirs).abs();
                assert!(difference < 1e-12, "frame {}, component {k}: {difference}", dyad.frame);
                worst = worst.max(difference);
            }
        }
    }
    println!("golden Jacobian rows: worst {worst:.1e} (m per m, m per rad)");
}
