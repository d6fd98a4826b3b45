//! Denavit-Hartenberg parameters, standard and modified, with Hayati's second turn where axes are nearly parallel.

use std::fmt::Write;

use super::lines::{Line, Lines};
use super::numbers::{exact, heading};
use super::varying::varying;
use super::{Exported, Number};
use crate::calibration::CalibratedMachine;
use crate::chain::Chain;
use crate::error::Result;
use crate::lie::{Mat3, Pose, Vec3};
use crate::machine::{JointKind, Machine};

/// Sine of the angle between two axes below which they have no common normal that can be relied on.
const PARALLEL: f64 = 0.05;

const X: Vec3<f64> = Vec3([1.0, 0.0, 0.0]);
const Y: Vec3<f64> = Vec3([0.0, 1.0, 0.0]);
const Z: Vec3<f64> = Vec3([0.0, 0.0, 1.0]);

/// One joint: Rz(theta) Tz(d) Tx(a) Rx(alpha) Ry(beta), m and rad; the displacement is added to theta or d.
#[derive(Clone, Copy, Debug, Default)]
struct Row {
    theta: f64,
    d: f64,
    a: f64,
    alpha: f64,
    beta: f64,
}

impl Row {
    fn pose(self) -> Pose<f64> {
        let slide = Pose::translation(Vec3([0.0, 0.0, self.d]));
        let normal = Pose::translation(Vec3([self.a, 0.0, 0.0]));
        Pose::turn(Z, self.theta) * slide * normal * Pose::turn(X, self.alpha) * Pose::turn(Y, self.beta)
    }
}

/// A table with what stands before and behind it.
struct Table {
    w_from_first: Pose<f64>,
    rows: Vec<Row>,
    last_from_t: Pose<f64>,
}

impl Table {
    fn new(lines: &Lines) -> Table {
        let w_from_first = lines
            .lines
            .first()
            .map_or(Pose::identity(0.0), |line| Pose { rotation: turned_z(line.u), translation: line.p });
        let mut here = w_from_first;
        let mut rows: Vec<Row> = Vec::new();
        for (i, _) in lines.lines.iter().enumerate() {
            let row = lines.lines.get(i + 1).map_or(Row::default(), |next| between(here, next));
            here = here * row.pose();
            rows.push(row);
        }
        let last_from_t = here.inverse() * lines.w_from_t(&vec![0.0; commands(lines)]);
        Table { w_from_first, rows, last_from_t }
    }
}

fn commands(lines: &Lines) -> usize {
    lines.lines.iter().flat_map(|line| &line.terms).map(|(c, _)| c + 1).max().unwrap_or(1)
}

/// A rotation that takes z to this direction.
fn turned_z(z: Vec3<f64>) -> Mat3<f64> {
    let [x, _] = z.across();
    Mat3([x.0, z.cross(x).0, z.0]).transpose()
}

/// From a frame whose z lies on one axis to one whose z lies on the next.
fn between(w_from_here: Pose<f64>, next: &Line) -> Row {
    let here_from_w = w_from_here.inverse();
    let u = here_from_w.rotation * next.u;
    let p = match next.kind {
        JointKind::Revolute => here_from_w.transform(next.p),
        // A slide has a direction and no place.
        JointKind::Prismatic => Vec3([0.0; 3]),
    };
    let sine = u.0[0].hypot(u.0[1]);
    if sine < PARALLEL {
        // Where the next axis crosses the plane x y of this frame.
        let at = p - u.times(p.0[2] / u.0[2]);
        let a = at.0[0].hypot(at.0[1]);
        let theta = at.0[1].atan2(at.0[0]);
        let v = Pose::turn(Z, -theta).rotation * u;
        // Rx(alpha) Ry(beta) z = (sin beta, -sin alpha cos beta, cos alpha cos beta)
        let beta = v.0[0].atan2(v.0[1].hypot(v.0[2]));
        let alpha = (-v.0[1]).atan2(v.0[2]);
        return Row { theta, d: 0.0, a, alpha, beta };
    }
    // The common normal n, from this axis to the next: p + s u = d z + a n.
    let n = Vec3([-u.0[1] / sine, u.0[0] / sine, 0.0]);
    let a = p.dot(n);
    // Along u as it is seen in the plane x y: what is left of p there is taken back along u.
    let along = Vec3([u.0[0] / sine, u.0[1] / sine, 0.0]);
    let d = p.0[2] - u.0[2] * p.dot(along) / sine;
    let theta = n.0[1].atan2(n.0[0]);
    // Rx(alpha) z = (0, -sin alpha, cos alpha)
    let v = Pose::turn(Z, -theta).rotation * u;
    Row { theta, d, a, alpha: (-v.0[1]).atan2(v.0[2]), beta: 0.0 }
}

/// The sign of the displacement and the joints' names with their factors.
fn drive(machine: &Machine, line: &Line) -> String {
    let term = |(c, factor): &(usize, f64)| {
        let name = &machine.commands()[*c];
        if *factor == 1.0 { name.clone() } else { format!("{} {name}", exact(*factor)) }
    };
    line.terms.iter().map(term).collect::<Vec<_>>().join(" + ")
}

/// Which kinds of joints have a travel: each has columns of its own, in its unit.
struct Limited {
    kinds: Vec<JointKind>,
}

impl Limited {
    fn of(machine: &Machine, lines: &Lines) -> Limited {
        let limited = |kind: &JointKind| {
            lines.lines.iter().any(|line| line.kind == *kind && travel(machine, line).is_some())
        };
        let kinds = [JointKind::Revolute, JointKind::Prismatic].into_iter().filter(limited).collect();
        Limited { kinds }
    }

    fn headings(&self) -> String {
        let both = |kind: &JointKind| match kind {
            JointKind::Revolute => ",lower[rad],upper[rad]",
            JointKind::Prismatic => ",lower[m],upper[m]",
        };
        self.kinds.iter().map(both).collect()
    }

    fn fields(&self, machine: &Machine, line: &Line) -> String {
        let both = |kind: &JointKind| match travel(machine, line).filter(|_| *kind == line.kind) {
            Some((lower, upper)) => format!(",{},{}", exact(lower), exact(upper)),
            None => ",,".to_string(),
        };
        self.kinds.iter().map(both).collect()
    }
}

fn travel(machine: &Machine, line: &Line) -> Option<(f64, f64)> {
    machine.dyads()[line.dyad].joint.as_ref()?.travel
}

/// The table; `modified` after Craig, where a row begins with what lies before its joint.
pub(super) fn write(calibrated: &CalibratedMachine, modified: bool) -> Result<Exported> {
    let machine = calibrated.machine();
    let lines = Lines::from_w(machine, &calibrated.chain());
    let table = Table::new(&lines);
    let declared = Table::new(&Lines::from_w(machine, &Chain::nominal(machine)));
    let convention = if modified {
        "modified convention (Craig), from joint to joint: Tx(a) Rx(alpha) Ry(beta) Rz(theta) Tz(d)"
    } else {
        "standard convention, from joint to joint: Rz(theta) Tz(d) Tx(a) Rx(alpha) Ry(beta)"
    };
    let mut told = vec![
        convention.to_string(),
        "the displacement of a rotary joint is added to theta, that of a linear joint to d; joints run from the workpiece w to the tool t, and those that carry the workpiece move it the other way".to_string(),
        "beta is Hayati's second turn: it stands where an axis is nearly parallel to the one before, and d is 0 there".to_string(),
        "base: w to the first joint, tool: the last joint to t, as x y z (m) and rotation vector (rad)".to_string(),
        "the numbers belong together: take all or none, since small turns of an axis move parameters a long way".to_string(),
    ];
    told.extend(super::known::Known::new(calibrated).sentence());
    told.extend(super::known::open_at_tool(calibrated));
    let form =
        if modified { "modified Denavit-Hartenberg parameters" } else { "Denavit-Hartenberg parameters" };
    let mut text = format!("# {}\n", heading(machine.name(), form));
    told.iter().for_each(|line| text.push_str(&format!("# {line}\n")));
    let placed = |pose: Pose<f64>| {
        let six = pose.translation.0.into_iter().chain(pose.rotation_vector().0);
        six.map(exact).collect::<Vec<_>>().join(",")
    };
    let _ = writeln!(text, "# machine: {}", machine.name());
    let _ = writeln!(text, "# base[m,rad]: {}", placed(table.w_from_first));
    let _ = writeln!(text, "# tool[m,rad]: {}", placed(table.last_from_t));
    let limited = Limited::of(machine, &lines);
    let _ = writeln!(
        text,
        "joint,kind,displacement,theta[rad],d[m],a[m],alpha[rad],beta[rad]{}",
        limited.headings()
    );
    let mut numbers = Vec::new();
    for (i, line) in lines.lines.iter().enumerate() {
        let name = machine.dyads()[line.dyad].joint.as_ref().map_or("", |joint| &joint.name);
        let row = |rows: &[Row]| {
            let own = rows[i];
            if !modified {
                return own;
            }
            let before = i.checked_sub(1).map(|i| rows[i]).unwrap_or_default();
            Row { theta: own.theta, d: own.d, a: before.a, alpha: before.alpha, beta: before.beta }
        };
        let (own, was) = (row(&table.rows), row(&declared.rows));
        let kind = if line.kind == JointKind::Revolute { "revolute" } else { "prismatic" };
        let values = [own.theta, own.d, own.a, own.alpha, own.beta];
        let before = [was.theta, was.d, was.a, was.alpha, was.beta];
        let _ = writeln!(
            text,
            "{name},{kind},{},{}{}",
            drive(machine, line),
            values.map(exact).join(","),
            limited.fields(machine, line)
        );
        for ((parameter, unit), (value, declared)) in
            [("theta", "rad"), ("d", "m"), ("a", "m"), ("alpha", "rad"), ("beta", "rad")]
                .into_iter()
                .zip(values.into_iter().zip(before))
        {
            let name = format!("{parameter} {name}");
            numbers.push(Number { name, value: Some(value), declared, unit: unit.into(), because: None });
        }
    }
    let left_out = varying(calibrated, "DH parameters are constant")?;
    Ok(Exported { text, numbers, left_out, told })
}
