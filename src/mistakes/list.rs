//! The mistakes that are tried.

use std::f64::consts::{FRAC_PI_2, PI};

use super::change::{Change, turns};
use super::thinned::{SHIFTS, Thinned};
use crate::machine::Machine;
use crate::recording::{Header, Measurement, ToolPoint};
use crate::units::{Quantity, UNITS, Unit};

/// What they are, for a message that none of them fits.
pub(super) const TRIED: &str = "signs of joints, swapped columns, units, zeros off by 90 or 180 deg, axes of the measured frame, \
                                sense and order of measured turns, place and rotation of the target, order of rows, \
                                rows shifted by up to 3, branches exchanged, other machines that come with the program";

/// Every mistake that these recordings may have.
pub(super) fn changes(machine: &Machine, recordings: &[Thinned]) -> Vec<Change> {
    let commands = machine.commands().len();
    // What nobody wrote cannot be wrong; what never differs from zero has no sign.
    let used: Vec<usize> = (0..commands)
        .filter(|c| recordings.iter().any(|r| r.samples.iter().any(|s| s.commands[*c] != 0.0)))
        .collect();
    let moving: Vec<usize> = (used.iter().copied())
        .filter(|c| {
            let all = || recordings.iter().flat_map(|r| &r.samples).map(|s| s.commands[*c]);
            all().fold(f64::NEG_INFINITY, f64::max) > all().fold(f64::INFINITY, f64::min)
        })
        .collect();
    let unit = |c: usize| recordings.iter().find_map(|r| r.units[c]);
    let mut all: Vec<Change> = used.iter().map(|c| Change::Sign(*c)).collect();
    for (a, b) in pairs(&(0..commands).collect::<Vec<_>>()) {
        if turns(machine, a) == turns(machine, b) && (moving.contains(&a) || moving.contains(&b)) {
            all.push(Change::Swapped(a, b));
        }
    }
    // All columns of a quantity in one unit, and one column alone.
    for written in UNITS {
        let own: Vec<usize> = used.iter().copied().filter(|c| unit(*c) == Some(written)).collect();
        for meant in others(written) {
            if own.len() > 1 {
                all.push(Change::Units(own.clone(), written, meant));
            }
            all.extend(own.iter().map(|c| Change::Units(vec![*c], written, meant)));
        }
        if recordings.iter().any(|r| r.value_units.contains(&written)) {
            all.extend(others(written).map(|meant| Change::ReadingUnits(written, meant)));
        }
    }
    for c in (0..commands).filter(|c| turns(machine, *c)) {
        all.extend([FRAC_PI_2, -FRAC_PI_2, PI].map(|by| Change::Zero(c, by)));
    }
    let is = |measurement: Measurement| recordings.iter().all(|r| r.measurement == measurement);
    let (position, pose) = (is(Measurement::Position), is(Measurement::Pose));
    if position || pose {
        all.extend(pairs(&[0, 1, 2]).map(|(a, b)| Change::AxesSwapped(a, b)));
        all.extend((0..3).map(Change::Mirrored));
    } else if recordings.iter().all(|r| r.samples.iter().all(|s| s.values.len() == 1)) {
        all.push(Change::Mirrored(0));
    }
    if pose {
        all.extend([Change::Turn, Change::Inverse]);
        all.extend([true, false].map(|scalar_last| Change::Quaternion { scalar_last }));
    }
    all.extend(targets(recordings));
    // Of a single set-up a first joint whose zero is wrong says the same.
    let known = recordings.iter().any(|r| !r.header.workpiece_frame_unknown);
    if known && recordings.iter().any(|r| r.header.setup != recordings[0].header.setup) {
        all.push(Change::Frame);
    }
    all.push(Change::Backwards);
    let shifts = || (1..=SHIFTS as isize).flat_map(|rows| [rows, -rows]);
    all.extend(shifts().map(Change::Rows));
    all.extend(moving.iter().flat_map(|c| shifts().map(|rows| Change::CommandRows(*c, rows))));
    all
}

/// What is said of the target on the tool, where it is not left open for each set-up already.
pub(super) fn targets(recordings: &[Thinned]) -> Vec<Change> {
    let is = |measurement: Measurement| recordings.iter().all(|r| r.measurement == measurement);
    let shared = |name: &dyn Fn(&Header) -> Option<String>| {
        let name = |r: &Thinned| name(&r.header);
        let elsewhere = |r: &Thinned| {
            let others = recordings.iter().filter(|o| o.header.setup != r.header.setup);
            others.map(name).any(|other| other == name(r))
        };
        recordings.iter().any(|r| name(r).is_none() || elsewhere(r))
    };
    let place = shared(&|header| match &header.tool_point {
        ToolPoint::Unknown(name) => Some(name.clone()),
        ToolPoint::Known(_) => None,
    });
    let rotation = is(Measurement::Pose) && shared(&|header| header.tool_rotation_unknown.clone());
    let place = place && (is(Measurement::Pose) || is(Measurement::Position));
    let all = [(false, true), (true, false), (true, true)];
    let fits = all.into_iter().filter(|(own, turned)| (place || !own) && (rotation || !turned));
    fits.map(|(place, rotation)| Change::Target { place, rotation }).collect()
}

fn pairs(of: &[usize]) -> impl Iterator<Item = (usize, usize)> + '_ {
    of.iter().enumerate().flat_map(|(i, a)| of[i + 1..].iter().map(|b| (*a, *b)))
}

/// Units of the same quantity that people take for this one.
fn others(written: Unit) -> impl Iterator<Item = Unit> {
    let fits = matches!(written.quantity, Quantity::Length | Quantity::Angle);
    UNITS.into_iter().filter(move |unit| fits && unit.quantity == written.quantity && *unit != written)
}
