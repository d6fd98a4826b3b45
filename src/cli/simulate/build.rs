//! From options to a plant and its runs.

use crate::calibration::CalibratedMachine;
use crate::lie::{Pose, Twist, Vec3};
use crate::machine::{JointKind, Machine};
use crate::sensor::Sensor;
use crate::simulate::{
    Balls, Claims, CommandTable, Course, Drive, Family, Faults, Figure, Instrument, Pace, PartProgram, Plant,
    Pointing, RandomPoses, Rounding, Run, Sense as Turn, Standard, Turning, Turns, plane_across,
    plane_of_axes, rest, usual_range,
};
use crate::units::{Quantity, amount};

use super::amounts::Rate;
use super::args::{Args, BarDirection, Measure, OnOff, Sense, Sort, Test};
use crate::cli::output::{Failure, Outcome};

/// What one call runs.
pub(super) struct Built {
    pub plant: Plant,
    pub runs: Vec<Run>,
    /// Nominal length of each recording that has one, m.
    pub lengths: Vec<Option<f64>>,
}

/// A mistake in the options that clap does not see.
pub(super) fn usage(what: impl Into<String>, mend: impl Into<String>) -> Failure {
    Failure::Told { what: what.into(), mend: mend.into() }
}

pub(super) fn build(args: &Args, machine: &CalibratedMachine) -> Outcome<Built> {
    let mut plant = Plant::new(machine);
    if let Some(size) = args.random {
        plant = plant.with_random(size, args.seed);
    }
    if let Some(path) = &args.faults {
        plant = plant.with_faults(&Faults::open(path, machine.machine())?);
    }
    if args.frame_at.is_some() || args.frame_turn.is_some() {
        let nothing = Vec3([0.0; 3]);
        let turn = Pose::exp(Twist::new(nothing, args.frame_turn.unwrap_or(nothing)));
        plant = plant.with_instrument_frame(Pose { translation: args.frame_at.unwrap_or(nothing), ..turn });
    }
    let machine = plant.machine();
    let measure = measure(args)?;
    let (mut runs, mut lengths) = (Vec::new(), Vec::new());
    let all_lengths = if args.length.is_empty() { vec![0.1] } else { args.length.clone() };
    let all_heights = if args.height.is_empty() { vec![0.0] } else { args.height.clone() };
    for length in &all_lengths {
        for height in &all_heights {
            let mut ball = args.ball.unwrap_or(Vec3([0.0; 3]));
            let up = match args.test {
                Test::Circle => circle_plane(args, machine, &held(args, machine)?)?.1,
                _ => Vec3([0.0, 0.0, 1.0]),
            };
            ball = ball + up.times(*height);
            let balls = Balls {
                workpiece_point_w: ball,
                tool_point_t: args.tool_point.unwrap_or(Vec3([0.0; 3])),
                length: *length,
            };
            let relative = measure == Measure::Distance;
            let (instrument, claims) = instrument(args, machine, measure, &balls)?;
            let (course, directions) = course(args, machine, balls)?;
            runs.push(Run { course, instrument, claims, directions });
            lengths.push(
                (relative || matches!(args.test.sort(), Sort::Cone | Sort::Rotary | Sort::Circle))
                    .then_some(*length),
            );
        }
    }
    Ok(Built { plant, runs, lengths })
}

/// What is measured, and whether the options for it are there.
fn measure(args: &Args) -> Outcome<Measure> {
    let free = matches!(args.test.sort(), Sort::Poses | Sort::Program | Sort::Path);
    let measure = args.measure.unwrap_or(if free { Measure::Position } else { Measure::Distance });
    let need = |is: bool, option: &str, given: bool| -> Outcome {
        if is && !given {
            return Err(usage(format!("this measurement needs `{option}`"), format!("add {option} ...")));
        }
        if !is && given {
            return Err(usage(
                format!("`{option}` means nothing to this measurement"),
                "leave it out, or choose another --measure",
            ));
        }
        Ok(())
    };
    need(measure == Measure::Joint, "--joint", args.joint.is_some())?;
    need(measure == Measure::Displacement, "--direction", args.direction.is_some())?;
    if free {
        need(measure == Measure::Distance, "--length", !args.length.is_empty())?;
    }
    if args.length.len() > 1 && free {
        return Err(usage("`--length` takes one length here", "give one, or run a test that turns"));
    }
    let zero = matches!(measure, Measure::Joint | Measure::Displacement);
    if args.zero.is_some() && !zero {
        need(false, "--zero", true)?;
    }
    for (option, given) in
        [("--length-unknown", args.length_unknown), ("--length-error", args.length_error.is_some())]
    {
        if given && measure != Measure::Distance {
            need(false, option, true)?;
        }
    }
    Ok(measure)
}

fn joint_kind(args: &Args, machine: &Machine) -> Outcome<Option<(usize, JointKind)>> {
    let Some(name) = &args.joint else { return Ok(None) };
    let found = machine.joints().find(|(_, joint)| joint.name == *name);
    match found {
        Some((j, joint)) => Ok(Some((j, joint.kind))),
        None => {
            let known: Vec<&str> = machine.joints().map(|(_, j)| j.name.as_str()).collect();
            Err(usage(
                format!("`--joint {name}`: no such joint"),
                format!("joints of this machine: {}", known.join(", ")),
            ))
        }
    }
}

fn instrument(
    args: &Args,
    machine: &Machine,
    measure: Measure,
    balls: &Balls,
) -> Outcome<(Instrument, Claims)> {
    let joint = joint_kind(args, machine)?;
    let sensor = match measure {
        Measure::Distance => Sensor::Distance { absolute: false },
        Measure::AbsoluteDistance => Sensor::Distance { absolute: true },
        Measure::Position => Sensor::Position,
        Measure::Pose => Sensor::Pose,
        Measure::Displacement => {
            Sensor::Displacement { direction_w: args.direction.unwrap_or(Vec3([1.0, 0.0, 0.0])) }
        }
        Measure::Joint => Sensor::Joint { dyad: joint.map_or(0, |(j, _)| j) },
    };
    let angle = matches!(joint, Some((_, JointKind::Revolute)));
    let quantity = if angle { Quantity::Angle } else { Quantity::Length };
    let of = |option: &str, text: &Option<String>| -> Outcome<Option<f64>> {
        let Some(text) = text else { return Ok(None) };
        let told = |what: String| usage(format!("{option}: {what}"), "write a number with its unit");
        amount(text, quantity).map(Some).map_err(told)
    };
    let (scatter, noise_m) = args.noise.unwrap_or_default();
    let (scatter_angle, noise_rad) = args.noise_angle.unwrap_or((scatter, 0.0));
    if scatter_angle != scatter && args.noise.is_some() {
        return Err(usage(
            "`--noise` and `--noise-angle` are distributed differently",
            "give both the same distribution",
        ));
    }
    let mut instrument = Instrument::new(sensor, noise_m, noise_rad);
    instrument.scatter = if args.noise.is_some() { scatter } else { scatter_angle };
    instrument.state.tool_point_t = balls.tool_point_t;
    instrument.state.workpiece_point_w = balls.workpiece_point_w;
    instrument.state.length = balls.length + args.length_error.unwrap_or(0.0);
    instrument.state.zero = of("--zero", &args.zero)?.unwrap_or(0.0);
    instrument.resolution.m = args.resolution.unwrap_or(0.0);
    instrument.resolution.rad = args.resolution_angle.unwrap_or(0.0);
    instrument.drop_outs = args.drop_outs.unwrap_or(0.0);
    instrument.outliers = args.outliers.unwrap_or(0.0);
    instrument.outlier.m = args.outlier_size.unwrap_or(0.0);
    instrument.outlier.rad = instrument.outlier.m / 0.1;
    let claims = Claims {
        setup: args.setup.clone(),
        frame_unknown: args.frame_unknown,
        tool_point_unknown: args.tool_point_unknown.clone(),
        length_unknown: args.length_unknown,
        zero_unknown: args.zero.is_some(),
        length: Some(balls.length),
        sigma: of("--sigma", &args.sigma)?,
        lines: Vec::new(),
    };
    Ok((instrument, claims))
}

/// Where axes stand that the test does not move.
fn held(args: &Args, machine: &Machine) -> Outcome<Vec<f64>> {
    let mut q = rest(machine);
    for held in &args.hold {
        let Some(c) = machine.commands().iter().position(|name| *name == held.joint) else {
            let known = machine.commands().join(", ");
            return Err(usage(
                format!("`--hold {}`: no such joint", held.joint),
                format!("joints of this machine: {known}"),
            ));
        };
        let quantity = machine.command_joint(c).kind.quantity();
        let told =
            |what: String| usage(format!("`--hold {}`: {what}", held.joint), "write JOINT=AMOUNT, c=30deg");
        q[c] = amount(&held.amount, quantity).map_err(told)?;
    }
    Ok(q)
}

/// Plane of a circle and its normal.
fn circle_plane(args: &Args, machine: &Machine, held: &[f64]) -> Outcome<([Vec3<f64>; 2], Vec3<f64>)> {
    let plane = match &args.plane[..] {
        [] => plane_across(args.normal.unwrap_or(Vec3([0.0, 0.0, 1.0]))),
        [a, b] => plane_of_axes(machine, [a, b], held)?,
        more => {
            let what = format!("`--plane` names {} axes", more.len());
            return Err(usage(what, "name two linear axes: --plane x,y"));
        }
    };
    Ok((plane, plane[0].cross(plane[1])))
}

fn figure(args: &Args, machine: &Machine, held: &[f64]) -> Outcome<Figure> {
    let standard = |family, number| Standard { family, number };
    let test = match args.test {
        Test::Ak1 => Some(standard(Family::Head, 1)),
        Test::Ak2 => Some(standard(Family::Head, 2)),
        Test::Ak4 => Some(standard(Family::Head, 4)),
        Test::Bk1 => Some(standard(Family::Table, 1)),
        Test::Bk2 => Some(standard(Family::Table, 2)),
        Test::Bk4 => Some(standard(Family::Table, 4)),
        Test::Ck1 => Some(standard(Family::Mixed, 1)),
        Test::Ck2 => Some(standard(Family::Mixed, 2)),
        Test::Ck4 => Some(standard(Family::Mixed, 4)),
        _ => None,
    };
    let axis = test.map(|test| test.axis(machine)).transpose()?.flatten();
    Ok(match args.test.sort() {
        Sort::Cone => Figure::Cone {
            half_apex: args.half_apex.unwrap_or(std::f64::consts::FRAC_PI_4),
            inclination: args.inclination.unwrap_or(std::f64::consts::FRAC_PI_6),
            lead: args.lead.unwrap_or(0.0),
            tool_centre_point: args.tcp != Some(OnOff::Off),
            reversed: args.reverse_rotary,
        },
        Sort::Circle => Figure::Circle {
            plane_w: circle_plane(args, machine, held)?.0,
            tool_axis_w: args.tool_axis.unwrap_or(Vec3([0.0, 0.0, -1.0])),
        },
        _ => Figure::Rotary {
            command: match axis {
                Some(command) => command,
                None => rotary_axis(args, machine)?,
            },
            pointing: match args.bar {
                Some(BarDirection::Tangential) => Pointing::Tangential,
                Some(BarDirection::Axial) => Pointing::Axial,
                _ => Pointing::Radial,
            },
            turns: !args.bar_stands,
        },
    })
}

fn rotary_axis(args: &Args, machine: &Machine) -> Outcome<usize> {
    let rotary: Vec<usize> = (0..machine.commands().len())
        .filter(|c| machine.command_joint(*c).kind == JointKind::Revolute)
        .collect();
    let known = rotary.iter().map(|c| machine.commands()[*c].as_str()).collect::<Vec<_>>().join(", ");
    let known = if known.is_empty() {
        "this machine has no rotary axis".into()
    } else {
        format!("rotary axes: {known}")
    };
    match (&args.axis, &rotary[..]) {
        (None, [only]) => Ok(*only),
        (None, _) => Err(usage("the test `rotary` needs an axis", format!("add --axis NAME; {known}"))),
        (Some(name), _) => rotary
            .iter()
            .copied()
            .find(|c| machine.commands()[*c] == *name)
            .ok_or_else(|| usage(format!("`--axis {name}`: no such rotary axis"), known)),
    }
}

/// Samples a second.
fn rate(args: &Args) -> f64 {
    args.rate.unwrap_or(if args.test == Test::Poses { 1.0 } else { 100.0 })
}

/// The motion, and whether it has directions of approach.
fn course(args: &Args, machine: &Machine, balls: Balls) -> Outcome<(Box<dyn Course>, bool)> {
    match args.test.sort() {
        Sort::Rotary | Sort::Cone | Sort::Circle => {
            let held = held(args, machine)?;
            let figure = figure(args, machine, &held)?;
            let legs = turns(args, machine, &figure, &balls)?.legs();
            let rounding = Rounding { direction_decimals: args.bar_decimals, rotary_step: args.rotary_step };
            Ok((Box::new(Turning::new(machine, figure, balls, &held, legs, rate(args), rounding)?), false))
        }
        Sort::Poses => {
            let (count, seed) = (args.count.unwrap_or(200), args.seed.wrapping_add(0x706f_7365));
            Ok((Box::new(RandomPoses { machine: machine.clone(), count, seed, rate: rate(args) }), true))
        }
        Sort::Program => {
            let held = held(args, machine)?;
            Ok((Box::new(PartProgram::new(input(args)?, machine, drive(args, &balls)?, held)), false))
        }
        Sort::Path => {
            let table = CommandTable::open(input(args)?, machine, rate(args))?;
            let directions = table.has_directions();
            Ok((Box::new(table), directions))
        }
    }
}

fn input(args: &Args) -> Outcome<&std::path::Path> {
    let needs = || {
        let what = if args.test == Test::Program { "an NC program" } else { "a table of commands" };
        usage(format!("the test `{}` needs {what}", args.test.word()), "add --input FILE")
    };
    args.input.as_deref().ok_or_else(needs)
}

fn drive(args: &Args, balls: &Balls) -> Outcome<Drive> {
    let length = |option: &str, rate: Option<Rate>, default: f64| match rate {
        None => Ok(default),
        Some(rate) if rate.quantity == Quantity::Length => Ok(rate.si),
        Some(_) => Err(usage(
            format!("`{option}` of a program is a length over a time"),
            "write 1000mm/min, 0.5m/s^2",
        )),
    };
    if args.feed.len() > 1 {
        return Err(usage("`--feed` takes one feed for a program", "give one"));
    }
    Ok(Drive {
        tool_centre_point: args.tcp.map(|tcp| tcp == OnOff::On),
        tool_point_t: balls.tool_point_t,
        feed: length("--feed", args.feed.first().copied(), 1.0 / 60.0)?,
        rapid: length("--rapid", args.rapid, 20.0 / 60.0)?,
        rapid_rotary: 180f64.to_radians(),
        acceleration: length("--acceleration", args.acceleration, 0.5)?,
        rotary_acceleration: 1000f64.to_radians(),
        corner: args.corner.unwrap_or(5f64.to_radians()),
        rate: rate(args),
        without_approach: args.without_approach,
    })
}

fn turns(args: &Args, machine: &Machine, figure: &Figure, balls: &Balls) -> Outcome<Turns> {
    let (from, to) = match figure {
        Figure::Rotary { command, .. } => usual_range(machine, *command),
        _ => (0.0, std::f64::consts::TAU),
    };
    let turns = Turns {
        from: args.from.unwrap_or(from),
        to: args.to.unwrap_or(to),
        senses: match args.sense {
            None | Some(Sense::Both) => vec![Turn::Positive, Turn::Negative],
            Some(Sense::Positive) => vec![Turn::Positive],
            Some(Sense::Negative) => vec![Turn::Negative],
        },
        parts: args.parts.unwrap_or(1),
        repeat: args.repeat.unwrap_or(1),
        overshoot: args.overshoot.unwrap_or(0.0),
        dwell: args.dwell.unwrap_or(0.0),
        paces: paces(args, figure, balls)?,
    };
    if turns.from == turns.to {
        return Err(usage("the turn starts where it ends", "give --from and --to different angles"));
    }
    Ok(turns)
}

fn paces(args: &Args, figure: &Figure, balls: &Balls) -> Outcome<Vec<Pace>> {
    if let Some(step) = args.step {
        return Ok(vec![Pace::Steps(step)]);
    }
    // What the tool ball goes along the workpiece in a turn of one radian.
    let radius = match figure {
        Figure::Rotary { .. } => None,
        Figure::Cone { half_apex, .. } | Figure::Waves { half_apex, .. } => {
            Some(balls.length * half_apex.cos())
        }
        Figure::Circle { .. } => Some(balls.length),
    };
    let turned = |option: &str, rate: Rate| -> Outcome<f64> {
        match (rate.quantity, radius) {
            (Quantity::Angle, _) => Ok(rate.si),
            (_, Some(radius)) => Ok(rate.si / radius),
            _ => Err(usage(format!("`{option}` of a rotary axis is an angle over a time"), "write 20deg/s")),
        }
    };
    let defaults = match radius {
        None => (
            Rate { quantity: Quantity::Angle, si: 20f64.to_radians() },
            Rate { quantity: Quantity::Angle, si: 100f64.to_radians() },
        ),
        Some(_) => (
            Rate { quantity: Quantity::Length, si: 1.0 / 60.0 },
            Rate { quantity: Quantity::Length, si: 0.5 },
        ),
    };
    let acceleration = turned("--acceleration", args.acceleration.unwrap_or(defaults.1))?;
    let jerk = args.jerk.map(|rate| turned("--jerk", rate)).transpose()?;
    let feeds = if args.feed.is_empty() { vec![defaults.0] } else { args.feed.clone() };
    feeds
        .into_iter()
        .map(|feed| Ok(Pace::Feed { speed: turned("--feed", feed)?, acceleration, jerk }))
        .collect()
}
