//! A machine as a control sees it: X, Y, Z, and rotary axes on the part's and on the tool's side, in machine coordinates.

use super::known::{Known, Verdict};
use super::lines::{Line, Lines, aligned};
use super::travel::poses;
use super::{ExportOptions, Exported, Remainder, refused};
use crate::calibration::CalibratedMachine;
use crate::chain::Chain;
use crate::error::Result;
use crate::lie::{Mat3, Pose, Twist, Vec3};
use crate::machine::{JointKind, Machine};

/// An axis may lie this far off its coordinate direction and still be that axis (sine).
const NEAR: f64 = 0.05;
/// Poses over which errors are told.
const POSES: usize = 200;

/// Where the axes of a machine stand among its lines.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Layout {
    /// Lines of X, Y, Z.
    pub linear: [usize; 3],
    /// Rotary lines that carry the part, from the part inwards to the base, with 0, 1, 2 for A, B, C.
    pub part: Vec<(usize, usize)>,
    /// Rotary lines that carry the tool, from the base outwards to the tool.
    pub tool: Vec<(usize, usize)>,
    /// Names of commands by line.
    pub names: Vec<String>,
    /// By line, the sign that takes the program's number to the displacement.
    pub signs: Vec<f64>,
}

/// A calibrated machine as a control sees it.
pub(super) struct Seen<'a> {
    pub calibrated: &'a CalibratedMachine,
    pub layout: Layout,
    tool_length: f64,
}

impl<'a> Seen<'a> {
    /// # Errors
    /// Where the machine is none with X, Y and Z between the rotary axes of the part and those of the tool.
    pub fn new(calibrated: &'a CalibratedMachine, options: &ExportOptions, form: &str) -> Result<Self> {
        let machine = calibrated.machine();
        let layout = layout(machine).map_err(|why| {
            refused(
                format!("machine \"{}\" is none that {form} knows: {why}", machine.name()),
                "controls know machines with X, Y, Z and one or two rotary axes; try --to urdf, mjcf, dh or mdh, and iso230 where two axes are linear",
            )
        })?;
        Ok(Seen { calibrated, layout, tool_length: options.tool_length })
    }

    /// The lines of these deviations in machine coordinates: X along the actual X axis, the plane X Y spanned by X and Y, the origin where
    /// the gauge line is with all axes at zero.
    pub fn lines(&self, dh: &[Twist<f64>]) -> Lines {
        let machine = self.calibrated.machine();
        self.lines_of(&Chain::new(machine, dh))
    }

    fn lines_of(&self, chain: &Chain<f64>) -> Lines {
        let machine = self.calibrated.machine();
        let home = vec![0.0; machine.commands().len()];
        let tip_b = chain.sweep(&home).b_from_t().translation;
        let seen_b = Lines::new(machine, chain, Pose::identity(0.0));
        let along = |k: usize| {
            let line = self.layout.linear[k];
            seen_b.lines[line].u.times(self.layout.signs[line])
        };
        let x = along(0);
        let z = x.cross(along(1));
        let z = z.times(1.0 / z.norm());
        let rotation = Mat3([x.0, z.cross(x).0, z.0]);
        let tip_m = Vec3([0.0, 0.0, -self.tool_length]);
        let m_from_b = Pose { rotation, translation: tip_m - rotation * tip_b };
        Lines::new(machine, chain, m_from_b)
    }

    pub fn calibrated_lines(&self) -> Lines {
        self.lines(self.calibrated.deviations())
    }

    pub fn declared_lines(&self) -> Lines {
        self.lines_of(&Chain::nominal(self.calibrated.machine()))
    }

    /// How sure numbers are that follow from the lines.
    pub fn judge(&self, numbers: impl Fn(&Lines) -> Vec<f64>) -> Vec<Verdict> {
        Known::new(self.calibrated).judge(|dh| numbers(&self.lines(dh)))
    }

    /// The point of a rotary line at the height along its own axis where the machine file declares its frame.
    pub fn point(&self, lines: &Lines, line: usize, axis: usize) -> Vec3<f64> {
        let (own, declared) = (&lines.lines[line], self.declared_lines().lines[line].p);
        own.p + own.u.times((declared.0[axis] - own.p.0[axis]) / own.u.0[axis])
    }

    /// The direction of a rotary line that lies on the positive side of its coordinate direction.
    pub fn direction(&self, lines: &Lines, line: usize, axis: usize) -> Vec3<f64> {
        let u = lines.lines[line].u;
        u.times(u.0[axis].signum())
    }

    /// What a control that moves by `held` leaves of the calibrated machine: all of it, then each kind of deviation alone.
    pub fn remainders(&self, held: &Lines, because: &str) -> Vec<Remainder> {
        let full = self.calibrated_lines();
        let mut found = Vec::new();
        let mut add = |what: String, lines: &Lines| {
            let (max, rms) = self.apart(&full, lines);
            if max > 1e-9 {
                let because = because.to_string();
                found.push(Remainder { what, max_m: Some(max), rms_m: Some(rms), because });
            }
        };
        add("all constant geometry that it cannot hold".into(), held);
        for (i, own) in full.lines.iter().enumerate() {
            let mut without = full.clone();
            let turned = own.kind == JointKind::Revolute;
            let slot = &mut without.lines[i];
            slot.u = held.lines[i].u;
            if (slot.u - own.u).norm() > 0.0 {
                let kind = if turned { "tilt" } else { "squareness" };
                add(format!("of this, {kind} of {}", self.layout.names[i]), &without);
            }
            if turned {
                let mut without = full.clone();
                without.lines[i].p = held.lines[i].p;
                add(format!("of this, place of {}", self.layout.names[i]), &without);
            }
        }
        found
    }

    /// What entering the numbers is worth: `before` and `after` as the control moves the machine.
    pub fn gain(&self, before: &Lines, after: &Lines) -> String {
        let full = self.calibrated_lines();
        let um = |lines: &Lines| format!("{:.1} um", 1e6 * self.apart(&full, lines).0);
        format!(
            "constant geometry at the tool tip, part set up anew: the declared numbers leave up to {}, these {}",
            um(before),
            um(after)
        )
    }

    /// How far the tips of two machines are apart over the travel once the part is set up anew.
    pub fn apart(&self, one: &Lines, other: &Lines) -> (f64, f64) {
        let poses = poses(self.calibrated, POSES);
        let tips = |lines: &Lines| poses.iter().map(|q| lines.tip(q)).collect::<Vec<_>>();
        aligned(&tips(one), &tips(other))
    }

    /// The tool length that the numbers go with.
    pub fn tool_sentence(&self) -> String {
        let mm = super::numbers::exact((self.tool_length * 1e6).round() / 1e3);
        format!(
            "places are counted from the gauge line with all axes at zero; the tip t is {mm} mm below it (--tool-length), as the tool table must have it"
        )
    }
}

impl Layout {
    /// Letters of the rotary axes, those of the part from the part inwards, then those of the tool outwards.
    pub fn pattern(&self) -> (Vec<char>, Vec<char>) {
        let letters = |list: &[(usize, usize)]| list.iter().map(|(_, axis)| ['A', 'B', 'C'][*axis]).collect();
        (letters(&self.part), letters(&self.tool))
    }
}

fn layout(machine: &Machine) -> std::result::Result<Layout, String> {
    let lines = Lines::from_w(machine, &Chain::nominal(machine)).lines;
    let mut linear = [None; 3];
    let (mut part, mut tool) = (Vec::new(), Vec::new());
    let (mut names, mut signs) = (Vec::new(), Vec::new());
    for (i, line) in lines.iter().enumerate() {
        let Some(joint) = &machine.dyads()[line.dyad].joint else { continue };
        match line.terms[..] {
            [(c, 1.0)] if machine.commands()[c] == joint.name => {}
            _ => return Err(format!("joint {} follows others", joint.name)),
        }
        let word = joint.nc_word();
        let letter = word.address.chars().next().unwrap_or(' ');
        names.push(joint.name.clone());
        signs.push(f64::from(word.sign));
        let slot = |letters: &str| letters.find(letter);
        match (joint.kind, slot("XYZ"), slot("ABC")) {
            (JointKind::Prismatic, Some(k), _) if linear[k].is_none() => linear[k] = Some(i),
            (JointKind::Revolute, _, Some(k)) if line.on_part => part.push((i, k)),
            (JointKind::Revolute, _, Some(k)) => tool.push((i, k)),
            _ => return Err(format!("joint {} is none of X, Y, Z, A, B, C, each once", joint.name)),
        }
    }
    let [Some(x), Some(y), Some(z)] = linear else { return Err("it has not all of X, Y and Z".into()) };
    let layout = Layout { linear: [x, y, z], part, tool, names, signs };
    let inner = |i: &usize| layout.part.iter().all(|(p, _)| p < i) && layout.tool.iter().all(|(t, _)| t > i);
    if !layout.linear.iter().all(inner) {
        return Err("a linear axis stands beyond a rotary one".into());
    }
    // In its own machine coordinates every axis must lie near the direction that its letter says.
    let along = |k: usize| lines[layout.linear[k]].u.times(layout.signs[layout.linear[k]]);
    let triad = [along(0), along(1), along(2)];
    let square = |a: usize, b: usize| triad[a].dot(triad[b]).abs() < NEAR;
    if !(square(0, 1) && square(1, 2) && square(0, 2) && triad[0].cross(triad[1]).dot(triad[2]) > 0.0) {
        return Err("X, Y, Z are no right-handed square axes".into());
    }
    for (i, k) in layout.part.iter().chain(&layout.tool) {
        if lines[*i].u.cross(triad[*k]).norm() > NEAR {
            return Err(format!("axis {} is slanted", layout.names[*i]));
        }
    }
    Ok(layout)
}

/// Lines whose linear axes are exactly X, Y and Z, as every control has them.
pub(super) fn square(layout: &Layout, lines: &Lines) -> Lines {
    let mut held = lines.clone();
    for (k, i) in layout.linear.iter().enumerate() {
        held.lines[*i].u = unit(k).times(layout.signs[*i]);
    }
    held
}

/// The same with rotary axes exactly along their coordinate directions.
pub(super) fn upright(layout: &Layout, lines: &Lines) -> Lines {
    let mut held = square(layout, lines);
    for (i, k) in layout.part.iter().chain(&layout.tool) {
        let own: &mut Line = &mut held.lines[*i];
        own.u = unit(*k).times(own.u.0[*k].signum());
    }
    held
}

pub(super) fn unit(k: usize) -> Vec3<f64> {
    Vec3(std::array::from_fn(|i| f64::from(u8::from(i == k))))
}

/// What is told of every control, and what varies.
pub(super) fn common(seen: &Seen, because: &str) -> Result<Exported> {
    let mut told = vec![
        "machine coordinates: X along the actual X axis, the plane X Y spanned by X and Y".to_string(),
        seen.tool_sentence(),
    ];
    told.extend(Known::new(seen.calibrated).sentence());
    Ok(Exported { told, left_out: super::varying::varying(seen.calibrated, because)?, ..Exported::default() })
}
