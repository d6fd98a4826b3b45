//! What a machine is: its topology, its model equation in symbols, its parameters, and what each instrument could identify.

use nalgebra::{DMatrix, SVD};
use rand::SeedableRng;
use rand::rngs::StdRng;
use rayon::iter::{IntoParallelIterator, ParallelIterator};
use serde::{Deserialize, Serialize};

use crate::chain::Chain;
use crate::check::random_command;
use crate::identify::COMPONENTS;
use crate::lie::{Mat3, Vec3};
use crate::machine::{Branch, Dyad, Joint, JointKind, Machine};
use crate::sensor::{Sensor, SensorState};

/// Everything that `describe` prints. Numbers in SI.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Description {
    /// Name of the machine.
    pub machine: String,
    /// What it is, if the file says so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub about: Option<String>,
    /// Branches as one line each, from the base outwards, then side branches from what carries them.
    pub topology: Vec<String>,
    /// The model equation in symbols, one line each.
    pub equation: Vec<String>,
    /// Names of the commands in machine order.
    pub commands: Vec<String>,
    /// One entry per dyad.
    pub dyads: Vec<DyadDescription>,
    /// How many components of deviations there are.
    pub parameters: usize,
    /// What each kind of measurement identifies on general poses.
    pub identifiable: Vec<Identifiable>,
    /// Why that is not counted, where the machine has too many frames.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub uncounted: Option<String>,
}

/// One dyad.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct DyadDescription {
    /// Frame.
    pub frame: String,
    /// `workpiece` or `tool`.
    pub branch: String,
    /// Origin in the frame before, m.
    pub at_m: [f64; 3],
    /// Rotation vector in the frame before, rad.
    pub rotation_rad: [f64; 3],
    /// Joint in words, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint: Option<String>,
    /// Tolerances of translations (m) and rotations (rad).
    pub tolerance: [f64; 2],
}

/// What an instrument identifies.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Identifiable {
    /// `pose`, `position`, `distance`, `distance, length unknown`, `displacement`.
    pub measurement: String,
    /// Independent combinations that it sees on general poses.
    pub rank: usize,
    /// Unknowns in all.
    pub of: usize,
    /// Smallest singular value that counts and largest that does not, relative to the largest of all.
    pub gap: [f64; 2],
    /// A sparse basis of what it does not see, each with the shifts (m, rad) that leave every reading as it is.
    pub unseen: Vec<Vec<(String, f64)>>,
}

/// Singular values below this part of the largest are rounding.
const SEEN: f64 = 1e-9;

/// Most frames with which [`describe`] counts what measurements identify. The time grows with their third power; this is half a second.
const QUICKLY: usize = 64;
/// Most frames with which [`describe_whole`] does: some 40 s and 300 MB.
pub const MOST_FRAMES: usize = 256;

/// Describes a machine; poses for the ranks come from a fixed seed. What measurements identify is left out of a machine with more than
/// 64 frames, and [`Description::uncounted`] says so.
pub fn describe(machine: &Machine) -> Description {
    described(machine, QUICKLY)
}

/// The same, with what measurements identify up to 256 frames, which takes up to a minute.
pub fn describe_whole(machine: &Machine) -> Description {
    described(machine, MOST_FRAMES)
}

fn described(machine: &Machine, most: usize) -> Description {
    let frames = machine.dyads().len();
    let uncounted = (frames > most).then(|| {
        format!("what measurements identify is not counted with more than {most} frames (here {frames})")
    });
    let branch = |branch: Branch| {
        let own = (0..machine.dyads().len()).filter(move |j| machine.branch(*j) == branch);
        own.map(|j| &machine.dyads()[j])
    };
    let line = |from: &str, dyads: &mut dyn Iterator<Item = &Dyad>| {
        let name = |d: &Dyad| match &d.joint {
            Some(joint) => format!("{} [{}]", d.frame, joint_symbol(joint)),
            None => d.frame.clone(),
        };
        let names: Vec<String> = std::iter::once(from.to_string()).chain(dyads.map(name)).collect();
        names.join(" -> ")
    };
    let branches = [Branch::Workpiece, Branch::Tool].map(|b| line("base", &mut branch(b)));
    let sides = machine.side_branches().iter().map(|side| line(&side.on, &mut side.dyads.iter()));
    let topology = branches.into_iter().chain(sides).collect();
    let product = |b: Branch| {
        let factors: Vec<String> = branch(b)
            .map(|d| {
                let f = &d.frame;
                let fixed = if d.placement == Default::default() {
                    format!("exp(dh_{f})")
                } else {
                    format!("M_{f} exp(dh_{f})")
                };
                match &d.joint {
                    Some(joint) => format!("{fixed} {}", exponential(joint, machine)),
                    None => fixed,
                }
            })
            .collect();
        factors.join(" ")
    };
    Description {
        machine: machine.name().into(),
        about: machine.about().map(Into::into),
        topology,
        equation: vec![
            format!("b_from_w = {}", product(Branch::Workpiece)),
            format!("b_from_t = {}", product(Branch::Tool)),
            "w_from_t = inverse(b_from_w) b_from_t".into(),
        ],
        commands: machine.commands().to_vec(),
        dyads: (0..machine.dyads().len()).map(|j| dyad(machine, j)).collect(),
        parameters: 6 * machine.dyads().len(),
        identifiable: if uncounted.is_none() { identifiable(machine) } else { Vec::new() },
        uncounted,
    }
}

fn dyad(machine: &Machine, j: usize) -> DyadDescription {
    let dyad = &machine.dyads()[j];
    let tolerance = machine.tolerance(j);
    DyadDescription {
        frame: dyad.frame.clone(),
        branch: machine.branch(j).field().into(),
        at_m: dyad.placement.at.0,
        rotation_rad: dyad.placement.rotation.0,
        joint: dyad.joint.as_ref().map(joint_symbol),
        tolerance: [tolerance.translation, tolerance.rotation],
    }
}

/// `R z`, `P -y`, `R (0, 0.707, 0.707)`.
fn joint_symbol(joint: &Joint) -> String {
    let kind = match joint.kind {
        JointKind::Prismatic => "P",
        JointKind::Revolute => "R",
    };
    format!("{kind} {}", axis_symbol(joint.axis))
}

fn axis_symbol(axis: Vec3<f64>) -> String {
    for (k, word) in ["x", "y", "z"].into_iter().enumerate() {
        for (sign, prefix) in [(1.0, ""), (-1.0, "-")] {
            if (0..3).all(|i| axis.0[i] == if i == k { sign } else { 0.0 }) {
                return format!("{prefix}{word}");
            }
        }
    }
    let [x, y, z] = axis.0;
    format!("({x:.4}, {y:.4}, {z:.4})")
}

/// `Rot(x, a)`, `Trans(-y, y)`, `Rot(z, -(torso2 + torso3))`.
fn exponential(joint: &Joint, machine: &Machine) -> String {
    let (j, _) = machine.joints().find(|(_, own)| own.name == joint.name).expect("a joint of this machine");
    let terms = &machine.drive(j).expect("every joint has a drive").terms;
    let mut sum = String::new();
    for (command, factor) in terms {
        let name = &machine.commands()[*command];
        let sign = match (sum.is_empty(), *factor < 0.0) {
            (true, true) => "-",
            (true, false) => "",
            (false, true) => " - ",
            (false, false) => " + ",
        };
        let size = if factor.abs() == 1.0 { String::new() } else { format!("{} ", factor.abs()) };
        sum.push_str(&format!("{sign}{size}{name}"));
    }
    let axis = axis_symbol(joint.axis);
    match joint.kind {
        JointKind::Prismatic => format!("Trans({axis}, {sum})"),
        JointKind::Revolute => format!("Rot({axis}, {sum})"),
    }
}

/// Ranks of every kind of measurement on general poses.
fn identifiable(machine: &Machine) -> Vec<Identifiable> {
    let distance = Sensor::Distance { absolute: false };
    let direction_w = Vec3([0.48, 0.6, 0.64]);
    [
        ("pose", Sensor::Pose, false),
        ("position", Sensor::Position, false),
        ("distance", distance.clone(), false),
        ("distance, length unknown", distance, true),
        ("displacement", Sensor::Displacement { direction_w }, false),
    ]
    .into_par_iter()
    .map(|(name, sensor, length)| one_kind(machine, name, &sensor, length))
    .collect()
}

fn one_kind(machine: &Machine, name: &str, sensor: &Sensor, length: bool) -> Identifiable {
    let dyads = machine.dyads().len();
    let columns = 6 * dyads + usize::from(length);
    let samples = (3 * columns).div_ceil(sensor.reading_count());
    let mut rng = StdRng::seed_from_u64(20_260_104);
    let chain = Chain::nominal(machine);
    // Points off every axis: a ball on the last axis or a bar centre on the first one would see less.
    let state = SensorState {
        tool_point_t: Vec3([0.031, -0.023, 0.047]),
        tool_rotation_t: Mat3::identity(0.0),
        workpiece_point_w: Vec3([0.029, 0.037, -0.017]),
        length: 0.0,
        zero: 0.0,
    };
    let mut rows = Vec::with_capacity(samples * sensor.reading_count() * columns);
    let mut row = vec![0.0; 6 * dyads];
    for _ in 0..samples {
        let q: Vec<f64> =
            (0..machine.commands().len()).map(|c| random_command(machine, c, &mut rng)).collect();
        let sweep = chain.sweep(&q);
        let rotation: Mat3<f64> = sweep.w_from_t().rotation;
        let (readings, count) = sensor.readings(&sweep, &state, rotation);
        for reading in readings.iter().take(count) {
            sweep.error_row(reading.by_twist_w, &mut row);
            rows.extend_from_slice(&row);
            if length {
                rows.push(-1.0);
            }
        }
    }
    let mut matrix = DMatrix::from_row_slice(rows.len() / columns, columns, &rows);
    let mut scales = vec![1e-4; columns];
    for j in 0..dyads {
        scales[6 * j..6 * j + 6].copy_from_slice(&machine.tolerance(j).to_array());
    }
    for (mut column, scale) in matrix.column_iter_mut().zip(&scales) {
        column *= *scale;
    }
    let svd = SVD::new(matrix, false, true);
    let values = &svd.singular_values;
    let largest = values.max();
    let mut sorted: Vec<f64> = values.iter().map(|v| v / largest).collect();
    sorted.sort_by(|a, b| b.total_cmp(a));
    let rank = sorted.iter().filter(|v| **v > SEEN).count();
    let v_t = svd.v_t.expect("asked for");
    let unseen_rows: Vec<usize> = (0..values.len()).filter(|i| values[*i] <= SEEN * largest).collect();
    let mut basis = DMatrix::from_fn(unseen_rows.len(), columns, |a, b| v_t[(unseen_rows[a], b)] * scales[b]);
    echelon(&mut basis);
    let label = |b: usize| {
        if b == 6 * dyads {
            "length".to_string()
        } else {
            format!("{}.{}", machine.dyads()[b / 6].frame, COMPONENTS[b % 6])
        }
    };
    let unseen = basis
        .row_iter()
        .map(|row| {
            let parts = row.iter().enumerate().filter(|(_, x)| x.abs() > 1e-6);
            parts.map(|(b, x)| (label(b), *x)).collect()
        })
        .collect();
    Identifiable {
        measurement: name.into(),
        rank,
        of: columns,
        gap: [
            sorted.get(rank.saturating_sub(1)).copied().unwrap_or(0.0),
            sorted.get(rank).copied().unwrap_or(0.0),
        ],
        unseen,
    }
}

/// Reduced row echelon form with full pivoting: a sparse basis of the same space, leading entries 1.
fn echelon(basis: &mut DMatrix<f64>) {
    let (rows, columns) = basis.shape();
    let mut used = vec![false; columns];
    for r in 0..rows {
        let mut best = (r, 0, 0.0);
        for i in r..rows {
            for (j, used) in used.iter().enumerate() {
                let size = basis[(i, j)].abs();
                if !used && size > best.2 {
                    best = (i, j, size);
                }
            }
        }
        let (i, j, size) = best;
        if size == 0.0 {
            return;
        }
        used[j] = true;
        basis.swap_rows(r, i);
        let lead = basis[(r, j)];
        basis.row_mut(r).iter_mut().for_each(|x| *x /= lead);
        for other in (0..rows).filter(|o| *o != r) {
            let factor = basis[(other, j)];
            for k in 0..columns {
                let x = basis[(r, k)];
                basis[(other, k)] -= factor * x;
            }
        }
    }
}
