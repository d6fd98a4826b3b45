//! Vectors between the rotary axes and from the gauge line, which controls keep under names of their own.

use std::fmt::Write;

use super::control::{Seen, common, square, upright};
use super::lines::Lines;
use super::numbers::{MM, fixed, heading, left_open};
use super::{ExportOptions, Exported, Number, Remainder, refused};
use crate::calibration::CalibratedMachine;
use crate::error::Result;
use crate::lie::Vec3;

/// A vector as a sum of places of axes: factor and number of the axis, those of the part from the part inwards, then those of the tool
/// outwards. The gauge line is the origin.
type Sum = &'static [(f64, usize)];

/// Three numbers to be entered.
struct Vector {
    name: &'static str,
    /// Every place where it must be typed, the first of them with the number of its first component.
    first: &'static str,
    number: usize,
    also: &'static str,
    is: &'static str,
    sum: Sum,
}

/// The vectors of a kind of machine: how many rotary axes carry the part, and how many the tool.
struct Kind {
    part: usize,
    tool: usize,
    name: &'static str,
    vectors: &'static [Vector],
}

/// A control.
struct Control {
    name: &'static str,
    title: &'static str,
    comment: &'static str,
    kinds: &'static [Kind],
    /// Whether directions of rotary axes are entered as vectors.
    directions: bool,
    says: &'static [&'static str],
    /// Places that no vector holds, and what takes them.
    rest: &'static str,
}

const fn vector(
    name: &'static str,
    first: &'static str,
    number: usize,
    also: &'static str,
    is: &'static str,
    sum: Sum,
) -> Vector {
    Vector { name, first, number, also, is, sum }
}

const TC: &str = "$TC_CARR";

/// docs/export.md names the sources. Axis 1 is the one nearer to the base.
const SIEMENS: Control = Control {
    name: "SINUMERIK",
    title: "SINUMERIK tool carrier and five-axis transformation",
    comment: ";",
    kinds: &[
        Kind {
            part: 0,
            tool: 2,
            name: "T (both rotary axes in the head), $TC_CARR23[n]=\"T\", MD24100 = 24",
            vectors: &[
                vector("I1", TC, 1, "MD24500 PART_OFFSET", "closes the chain: -(I2 + I3)", &[(-1.0, 0)]),
                vector("I2", TC, 4, "MD24560 JOINT_OFFSET", "axis 2 to axis 1", &[(1.0, 0), (-1.0, 1)]),
                vector("I3", TC, 15, "MD24550 BASE_TOOL", "tool adapter to axis 2", &[(1.0, 1)]),
            ],
        },
        Kind {
            part: 2,
            tool: 0,
            name: "P (both rotary axes in the table), $TC_CARR23[n]=\"P\", MD24100 = 40",
            vectors: &[
                vector("I2", TC, 4, "MD24550 BASE_TOOL", "machine reference to axis 1", &[(1.0, 1)]),
                vector("I3", TC, 15, "MD24558 JOINT_OFFSET", "axis 1 to axis 2", &[(1.0, 0), (-1.0, 1)]),
                vector("I4", TC, 18, "MD24500 PART_OFFSET", "closes the chain: -(I2 + I3)", &[(-1.0, 0)]),
            ],
        },
        Kind {
            part: 1,
            tool: 1,
            name: "M (one rotary axis in the head, one in the table), $TC_CARR23[n]=\"M\", MD24100 = 56",
            vectors: &[
                vector("I1", TC, 1, "MD24560 JOINT_OFFSET", "closes the chain: -I2", &[(-1.0, 1)]),
                vector("I2", TC, 4, "MD24550 BASE_TOOL", "tool adapter to axis 1", &[(1.0, 1)]),
                vector("I3", TC, 15, "MD24558 JOINT_OFFSET_PART", "machine reference to axis 2", &[(1.0, 0)]),
                vector("I4", TC, 18, "MD24500 PART_OFFSET", "closes the chain: -I3", &[(-1.0, 0)]),
            ],
        },
    ],
    directions: true,
    says: &[
        "directions V1 (axis 1) and V2 (axis 2) are given on the positive side of X, Y, Z; where the control holds the opposite sense, reverse all three components",
        "type each vector at every place that stands beside it: where MD24100 is 72 the transformation takes the vectors of the tool carrier of MD24582, else both places hold them",
        "along its own axis the place of a rotary axis is free: that component is as the machine file declares it",
    ],
    rest: "",
};

const FANUC: Control = Control {
    name: "FANUC",
    title: "FANUC tool centre point control",
    comment: "#",
    kinds: &[
        Kind {
            part: 0,
            tool: 2,
            name: "19680 = 2 (two rotary axes of the tool)",
            vectors: &[
                vector("19709..19711", "", 19709, "", "tool axis to tool rotary axis", &[(1.0, 1)]),
                vector(
                    "19712..19714",
                    "",
                    19712,
                    "",
                    "second to first tool rotary axis",
                    &[(1.0, 0), (-1.0, 1)],
                ),
            ],
        },
        Kind {
            part: 2,
            tool: 0,
            name: "19680 = 12 (two rotary axes of the table)",
            vectors: &[vector(
                "19703..19705",
                "",
                19703,
                "",
                "first to second table rotary axis",
                &[(1.0, 0), (-1.0, 1)],
            )],
        },
        Kind {
            part: 1,
            tool: 1,
            name: "19680 = 21 (one rotary axis of the tool, one of the table)",
            vectors: &[vector("19709..19711", "", 19709, "", "tool axis to tool rotary axis", &[(1.0, 1)])],
        },
    ],
    directions: false,
    says: &[
        "radius values, mm, in machine coordinates with the rotary axes at zero",
        "the third number of 19709..19711 and the tool holder offset 19666 are counted together: here 19666 is taken as 0",
        "the sense of rotary axes is 19684 and 19689 (0 right-hand, usual for a tool; 1 left-hand, usual for a table) and no matter of calibration",
    ],
    rest: "the parameters for the place of the table are not confirmed, and not written; --to iso230 has its offsets",
};

pub(super) fn siemens(calibrated: &CalibratedMachine, options: &ExportOptions) -> Result<Exported> {
    write(&SIEMENS, calibrated, options)
}

pub(super) fn fanuc(calibrated: &CalibratedMachine, options: &ExportOptions) -> Result<Exported> {
    write(&FANUC, calibrated, options)
}

fn write(control: &Control, calibrated: &CalibratedMachine, options: &ExportOptions) -> Result<Exported> {
    let seen = Seen::new(calibrated, options, control.name)?;
    let layout = &seen.layout;
    let Some(kind) =
        control.kinds.iter().find(|k| (k.part, k.tool) == (layout.part.len(), layout.tool.len()))
    else {
        return Err(refused(
            format!(
                "machine \"{}\" has rotary axes: {} in the table, {} in the head; {} holds two in all",
                calibrated.machine().name(),
                layout.part.len(),
                layout.tool.len(),
                control.name
            ),
            "export it by --to iso230, urdf, dh or mdh",
        ));
    };
    let axes: Vec<(usize, usize)> = layout.part.iter().chain(&layout.tool).copied().collect();
    let place = |lines: &Lines, n: usize| seen.point(lines, axes[n].0, axes[n].1);
    let sum = |lines: &Lines, of: Sum| {
        of.iter().fold(Vec3([0.0; 3]), |sum, (factor, n)| sum + place(lines, *n).times(*factor))
    };
    // Axis 1 is nearer to the base: of the part's axes the last, of the tool's the first.
    let order = if kind.part > 0 { [1, 0] } else { [0, 1] };
    let direction = |lines: &Lines, n: usize| seen.direction(lines, axes[n].0, axes[n].1);
    let all = |lines: &Lines| -> Vec<f64> {
        let vectors = kind.vectors.iter().flat_map(|v| sum(lines, v.sum).times(MM.per_si).0);
        let directions = order.iter().filter(|_| control.directions).flat_map(|n| direction(lines, *n).0);
        vectors.chain(directions).collect()
    };
    let (full, declared) = (seen.calibrated_lines(), seen.declared_lines());
    let (values, before, verdicts) = (all(&full), all(&declared), seen.judge(all));
    let mut exported = common(
        &seen,
        "this file holds constant geometry; `compensate` takes it, and --to enc-comp a part of it",
    )?;
    exported.told.insert(0, format!("kind of machine: {}", kind.name));
    exported.told.extend(control.says.iter().map(|s| s.to_string()));
    let names: Vec<&str> = order.iter().map(|n| layout.names[axes[*n].0].as_str()).collect();
    exported.told.push(format!("axis 1 is {}, axis 2 is {}", names[0], names[1]));
    let limits = if control.directions { square } else { upright };
    let held = limits(layout, &full);
    exported.told.push(seen.gain(&limits(layout, &declared), &held));
    let mut text = format!("{} {}\n", control.comment, heading(calibrated.machine().name(), control.title));
    exported.told.iter().for_each(|line| text.push_str(&format!("{} {line}\n", control.comment)));
    let mut i = 0;
    let mut rows = |name: &str, first: &str, number: usize, also: &str, is: &str, unit: &str| {
        let _ = writeln!(
            text,
            "{} {name}: {is}, {unit}{}{also}",
            control.comment,
            if also.is_empty() { "" } else { "; also " }
        );
        for k in 0..3 {
            let (value, was, verdict) = (values[i], before[i], verdicts[i]);
            i += 1;
            let place = match first {
                "" => format!("{}", number + k),
                _ => format!("{first}{}[1]", number + k),
            };
            let because = (!verdict.is_determined()).then(|| left_open(verdict.open, unit));
            let axis = ["x", "y", "z"][k];
            // Directions take what lengths of a metre show as nanometres.
            let shown = |x: f64| if unit == "1" { format!("{x:.9}") } else { fixed(x) };
            let _ = match &because {
                None => writeln!(
                    text,
                    "{place}={} {} {axis}, declared {}",
                    shown(value),
                    control.comment,
                    shown(was)
                ),
                Some(because) => {
                    writeln!(text, "{} {place} ({axis}) is not entered: {because}", control.comment)
                }
            };
            exported.numbers.push(Number {
                name: format!("{place} {name}.{axis}"),
                value: because.is_none().then_some(value),
                declared: was,
                unit: unit.into(),
                because,
            });
        }
    };
    for v in kind.vectors {
        rows(v.name, v.first, v.number, v.also, v.is, "mm");
    }
    if control.directions {
        rows("V1", TC, 7, "MD24570 AXIS1", "direction of axis 1", "1");
        rows("V2", TC, 10, "MD24572 AXIS2", "direction of axis 2", "1");
    }
    let mut constant = seen.remainders(&held, "the control has no number for it; `compensate` takes it");
    if !control.rest.is_empty() && kind.part > 0 {
        let mut without = full.clone();
        layout.part.iter().for_each(|(i, _)| without.lines[*i].p = declared.lines[*i].p);
        let (max, rms) = seen.apart(&full, &without);
        constant.push(Remainder {
            what: "place of the table's rotary axes".into(),
            max_m: Some(max),
            rms_m: Some(rms),
            because: control.rest.into(),
        });
    }
    exported.left_out.splice(0..0, constant);
    exported.text = text;
    Ok(exported)
}
