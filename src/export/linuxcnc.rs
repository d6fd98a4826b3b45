//! LinuxCNC: pins of its kinematics modules, and INI lines.

use std::fmt::Write;

use nalgebra::{DMatrix, DVector};

use super::control::{Seen, common, unit};
use super::curve::Curve;
use super::lines::Lines;
use super::numbers::{DEG, MM, fine, fixed, heading, left_open};
use super::table::POINTS;
use super::travel::poses;
use super::{ExportOptions, Exported, Number, refused};
use crate::calibration::CalibratedMachine;
use crate::error::Result;
use crate::lie::{Mat3, Vec3};
use crate::machine::JointKind;

/// A rotary axis of a module: its letter, and the sense in which the tool turns, as the part sees it, when the number grows.
struct Axis {
    letter: char,
    sense: f64,
}

/// A pin that takes a length.
struct Pin {
    name: &'static str,
    /// Which coordinates of which axes it moves.
    moves: &'static [(usize, usize)],
    /// Only its sum with another pin has an effect: it stays what the machine file declares between these two axes along z.
    held: Option<(usize, usize)>,
    /// Whether the tool's length is part of it.
    with_tool: bool,
    /// The module has no such pin: it takes this coordinate as 0, and the zero of the machine has to be moved there.
    is_zero: bool,
}

/// A kinematics module. Axes of the part come first, from the part inwards; then those of the tool, outwards.
struct Module {
    name: &'static str,
    part: &'static [Axis],
    tool: &'static [Axis],
    pins: &'static [Pin],
}

const fn axis(letter: char, sense: f64) -> Axis {
    Axis { letter, sense }
}

const fn pin(name: &'static str, moves: &'static [(usize, usize)]) -> Pin {
    Pin { name, moves, held: None, with_tool: false, is_zero: false }
}

const fn zero(name: &'static str, moves: &'static [(usize, usize)]) -> Pin {
    Pin { name, moves, held: None, with_tool: false, is_zero: true }
}

const X: usize = 0;
const Y: usize = 1;
const Z: usize = 2;

/// In machine coordinates with the origin at the gauge line; coordinates that no pin moves are 0.
const MODULES: [Module; 5] = [
    // W = P + Rz(-C) (o + Rx(-A) (J - P - o)), o = (0, y-offset, z-offset)
    Module {
        name: "xyzac-trt-kins",
        part: &[axis('C', -1.0), axis('A', -1.0)],
        tool: &[],
        pins: &[
            pin("x-rot-point", &[(0, X)]),
            pin("y-rot-point", &[(0, Y), (1, Y)]),
            pin("z-rot-point", &[(1, Z)]),
            pin("y-offset", &[(1, Y)]),
            Pin { name: "z-offset", moves: &[(1, Z)], held: Some((1, 0)), with_tool: false, is_zero: false },
        ],
    },
    // W = P + Rz(-C) (o + Ry(-B) (J - P - o)), o = (x-offset, 0, z-offset)
    Module {
        name: "xyzbc-trt-kins",
        part: &[axis('C', -1.0), axis('B', -1.0)],
        tool: &[],
        pins: &[
            pin("x-rot-point", &[(0, X), (1, X)]),
            pin("y-rot-point", &[(0, Y)]),
            pin("z-rot-point", &[(1, Z)]),
            pin("x-offset", &[(1, X)]),
            Pin { name: "z-offset", moves: &[(1, Z)], held: Some((1, 0)), with_tool: false, is_zero: false },
        ],
    },
    // W = P + Rx(A) (Ry(B) (J - P) - z-offset ez) + z-offset ez
    Module {
        name: "xyzab_tdr_kins",
        part: &[axis('A', 1.0), axis('B', 1.0)],
        tool: &[],
        pins: &[
            pin("x-rot-point", &[(1, X)]),
            pin("y-rot-point", &[(0, Y)]),
            pin("z-rot-point", &[(0, Z), (1, Z)]),
            pin("z-offset", &[(0, Z)]),
        ],
    },
    // W = J + L ez + Rz(C) Ry(-B) (0, 0, -L)
    Module {
        name: "5axiskins",
        part: &[],
        tool: &[axis('C', 1.0), axis('B', -1.0)],
        pins: &[Pin { name: "pivot-length", moves: &[(1, Z)], held: None, with_tool: true, is_zero: false }],
    },
    // Wxy = Rz(C) (Jxy + (L sin B, 0)), Wz = Jz + L - L cos B
    Module {
        name: "maxkins",
        part: &[axis('C', 1.0)],
        tool: &[axis('B', -1.0)],
        pins: &[
            zero("machine zero of X", &[(0, X)]),
            zero("machine zero of Y", &[(0, Y)]),
            Pin { name: "pivot-length", moves: &[(1, Z)], held: None, with_tool: true, is_zero: false },
        ],
    },
];

/// Poses over which pins are fitted.
const POSES: usize = 40;

/// A module on a machine.
struct Fitted<'a> {
    module: &'static Module,
    seen: &'a Seen<'a>,
    axes: Vec<(usize, usize)>,
    /// Declared values of the pins that are held, m.
    held: Vec<f64>,
    commands: Vec<Vec<f64>>,
}

impl<'a> Fitted<'a> {
    fn new(module: &'static Module, seen: &'a Seen<'a>) -> Self {
        let axes: Vec<(usize, usize)> = seen.layout.part.iter().chain(&seen.layout.tool).copied().collect();
        let declared = seen.declared_lines();
        let between = |pin: &Pin| {
            let (a, b) = pin.held?;
            Some(declared.lines[axes[a].0].p.0[2] - declared.lines[axes[b].0].p.0[2])
        };
        let held = module.pins.iter().map(|pin| between(pin).unwrap_or(0.0)).collect();
        let commands = poses(seen.calibrated, POSES);
        Fitted { module, seen, axes, held, commands }
    }

    /// Pins that are found.
    fn free(&self) -> Vec<usize> {
        (0..self.module.pins.len()).filter(|i| self.module.pins[*i].held.is_none()).collect()
    }

    /// The machine that the module takes it for, with these pins (m).
    fn lines(&self, pins: &[f64], like: &Lines) -> Lines {
        let mut lines = super::control::upright(&self.seen.layout, like);
        for (n, (line, letter)) in self.axes.iter().enumerate() {
            let mut p = Vec3([0.0; 3]);
            for (value, pin) in pins.iter().zip(self.module.pins) {
                pin.moves.iter().filter(|(axis, _)| *axis == n).for_each(|(_, k)| p.0[*k] += value);
            }
            lines.lines[*line].p = p;
            lines.lines[*line].u = unit(*letter).times(lines.lines[*line].u.0[*letter].signum());
        }
        lines
    }

    /// Pins (m) that bring the module's tool tip nearest to that of these lines, by least squares over the travel; where the part stands
    /// is found with them.
    fn fit(&self, lines: &Lines) -> Vec<f64> {
        let free = self.free();
        let mut pins = self.start(lines);
        let goal: Vec<Vec3<f64>> = self.commands.iter().map(|q| lines.tip(q)).collect();
        let tips = |pins: &[f64]| -> Vec<Vec3<f64>> {
            let own = self.lines(pins, lines);
            self.commands.iter().map(|q| own.tip(q)).collect()
        };
        let rows = 3 * goal.len();
        for _ in 0..6 {
            let here = tips(&pins);
            // Columns: the free pins, then six of where the part stands.
            let mut jacobian = DMatrix::zeros(rows, free.len() + 6);
            for (column, i) in free.iter().enumerate() {
                // A metre is no large step: tips are linear in the pins.
                let mut moved = pins.clone();
                moved[*i] += 1.0;
                for (k, (a, b)) in tips(&moved).iter().zip(&here).enumerate() {
                    (0..3).for_each(|x| jacobian[(3 * k + x, column)] = a.0[x] - b.0[x]);
                }
            }
            let mut right = DVector::zeros(rows);
            for (k, (goal, p)) in goal.iter().zip(&here).enumerate() {
                let hat = Mat3::hat(*p).0;
                for x in 0..3 {
                    jacobian[(3 * k + x, free.len() + x)] = 1.0;
                    (0..3).for_each(|y| jacobian[(3 * k + x, free.len() + 3 + y)] = -hat[x][y]);
                    right[3 * k + x] = goal.0[x] - p.0[x];
                }
            }
            let Ok(step) = jacobian.svd(true, true).solve(&right, 1e-9) else { break };
            free.iter().enumerate().for_each(|(column, i)| pins[*i] += step[column]);
            if free.iter().enumerate().all(|(column, _)| step[column].abs() < 1e-14) {
                break;
            }
        }
        pins
    }

    /// Pins from the places of the axes.
    fn start(&self, lines: &Lines) -> Vec<f64> {
        let free = self.free();
        let places: Vec<(usize, usize)> = (0..self.axes.len())
            .flat_map(|n| (0..3).filter(move |k| *k != self.axes[n].1).map(move |k| (n, k)))
            .collect();
        let matrix = DMatrix::from_fn(places.len(), free.len(), |row, column| {
            f64::from(u8::from(self.module.pins[free[column]].moves.contains(&places[row])))
        });
        let right = DVector::from_fn(places.len(), |row, _| {
            let (n, k) = places[row];
            let held: f64 = (self.module.pins.iter().zip(&self.held))
                .filter(|(pin, _)| pin.held.is_some() && pin.moves.contains(&places[row]))
                .map(|(_, value)| value)
                .sum();
            self.seen.point(lines, self.axes[n].0, self.axes[n].1).0[k] - held
        });
        let mut pins = self.held.clone();
        if let Ok(found) = matrix.svd(true, true).solve(&right, 1e-9) {
            free.iter().enumerate().for_each(|(column, i)| pins[*i] = found[column]);
        }
        pins
    }
}

pub(super) fn write(calibrated: &CalibratedMachine, options: &ExportOptions) -> Result<Exported> {
    let seen = Seen::new(calibrated, options, "LinuxCNC")?;
    let (part, tool) = seen.layout.pattern();
    let letters = |axes: &[Axis]| axes.iter().map(|axis| axis.letter).collect::<Vec<_>>();
    let Some(module) = MODULES.iter().find(|m| letters(m.part) == part && letters(m.tool) == tool) else {
        let known = MODULES.map(|m| m.name).join(", ");
        return Err(refused(
            format!(
                "no kinematics module of LinuxCNC has the axes of machine \"{}\"",
                calibrated.machine().name()
            ),
            format!(
                "known are {known}; position errors of axes go by --to linuxcnc-comp, all else by `compensate`"
            ),
        ));
    };
    let fitted = Fitted::new(module, &seen);
    let full = seen.calibrated_lines();
    let pins = fitted.fit(&full);
    let declared = fitted.fit(&seen.declared_lines());
    let verdicts = seen.judge(|lines| fitted.fit(lines));
    let held = fitted.lines(&pins, &full);
    let before = fitted.lines(&declared, &full);

    let mut exported = common(&seen, "a kinematics module has no number for it; `compensate` takes it")?;
    exported
        .told
        .insert(0, format!("kinematics module {}; the part is set up anew after the change", module.name));
    exported.told.push("pins are found by least squares of the tool tip over the travel".into());
    exported.told.push(seen.gain(&before, &held));
    senses(&seen, module, &fitted.axes, &full, &mut exported.told);
    for pin in module.pins.iter().filter(|pin| pin.held.is_some()) {
        exported.told.push(format!(
            "{} stays as declared: only its sum with z-rot-point has an effect, and z-rot-point takes the correction",
            pin.name
        ));
    }
    let mut text = format!("# {}\n", heading(calibrated.machine().name(), "LinuxCNC parameters"));
    exported.told.iter().for_each(|line| text.push_str(&format!("# {line}\n")));
    text.push_str("\n# HAL, mm\n");
    for (i, pin) in module.pins.iter().enumerate() {
        let tool = if pin.with_tool { options.tool_length } else { 0.0 };
        let (value, was) = ((pins[i] + tool) * MM.per_si, (declared[i] + tool) * MM.per_si);
        let name = format!("{}.{}", module.name, pin.name);
        let is_open = pin.held.is_none() && !verdicts[i].is_determined();
        let because = is_open.then(|| left_open(verdicts[i].open * MM.per_si, MM.symbol));
        let note = if pin.with_tool { ", the tool's length included" } else { "" };
        let _ = match &because {
            None if pin.is_zero => writeln!(
                text,
                "# {} must lie at {} of today, where the module takes its first axis to be; declared {}",
                pin.name,
                fixed(value),
                fixed(was)
            ),
            None => writeln!(text, "setp {name} {} # declared {}{note}", fine(value), fixed(was)),
            Some(because) => writeln!(text, "# {name} is not entered: {because}"),
        };
        exported.numbers.push(Number {
            name,
            value: because.is_none().then_some(value),
            declared: was,
            unit: "mm".into(),
            because,
        });
    }
    backlash(calibrated, &mut text)?;
    let constant = seen.remainders(&held, "the module has no pin for it; `compensate` takes it");
    exported.left_out.splice(0..0, constant);
    exported.text = text;
    Ok(exported)
}

/// Axes that turn against the module's default sense.
fn senses(seen: &Seen, module: &Module, axes: &[(usize, usize)], lines: &Lines, told: &mut Vec<String>) {
    for ((line, letter), axis) in axes.iter().zip(module.part.iter().chain(module.tool)) {
        let sense = lines.lines[*line].u.0[*letter] * seen.layout.signs[*line];
        if sense * axis.sense < 0.0 {
            told.push(format!(
                "axis {} turns against the default of this module: set the pin conventional-directions where the version has it, or reverse the sign of the joint's SCALE",
                seen.layout.names[*line]
            ));
        }
    }
}

/// INI lines for play.
fn backlash(calibrated: &CalibratedMachine, text: &mut String) -> Result<()> {
    let machine = calibrated.machine();
    let mut lines = String::new();
    for command in 0..machine.commands().len() {
        let curve = Curve::new(calibrated, command, POINTS)?;
        if curve.is_zero() {
            continue;
        }
        let joint = machine.command_joint(command);
        let unit = if joint.kind == JointKind::Revolute { DEG } else { MM };
        let _ = writeln!(
            lines,
            "# joint of axis {}, {}: BACKLASH here, or a COMP_FILE by --to linuxcnc-comp, not both",
            joint.name, unit.symbol
        );
        let play = curve.backlash() * unit.per_si;
        let _ = match play > 0.0 {
            true => writeln!(lines, "BACKLASH = {}", fixed(play)),
            false => writeln!(lines, "# no BACKLASH: its error does not look like play"),
        };
    }
    if !lines.is_empty() {
        let _ = write!(text, "\n# INI, section [JOINT_n] of each\n{lines}");
    }
    Ok(())
}
