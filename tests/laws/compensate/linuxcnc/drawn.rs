//! Programs drawn at random in what both controls and compensation follow of RS-274, and what is known of each of their moves.

use kincal::Machine;
use kincal::machine::JointKind;

use super::client::{LETTERS, OFFSETS, Tables};
use super::draw::Draw;
use crate::common::random::Random;

/// A move of a program, in the order in which they run.
#[derive(Clone, Debug)]
pub struct Planned {
    /// Line of the program, from 1.
    pub line: usize,
    pub sort: Sort,
    /// Whether every axis stands at a place that the program has named.
    pub known: bool,
    /// Unit of lengths, mm.
    pub unit: f64,
    /// Whether the block has its time for a feed.
    pub inverse_time: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sort {
    Straight,
    Arc,
    Cycle,
    /// G53, G28: places of the machine.
    Machine,
}

/// A program with its control.
pub struct Drawn {
    pub text: String,
    pub planned: Vec<Planned>,
    pub tables: Tables,
    /// By axis: the machine's own frame less the joint, mm and deg.
    pub zero: Vec<f64>,
    pub reference_length: f64,
    /// The set-up that says the same.
    pub setup: String,
    /// By axis: where it stands before the first move, as a joint, mm and deg.
    pub start: Vec<f64>,
}

/// What programs are drawn.
#[derive(Clone, Copy, Debug)]
pub struct Kind {
    /// Arcs among the moves.
    pub arcs: bool,
    /// Every way is known: no tool, no place of the machine.
    pub known_ways: bool,
    /// Moves between marks.
    pub marked: bool,
    pub moves: usize,
}

pub struct AxisOf {
    pub letter: &'static str,
    /// Among X Y Z A B C.
    pub index: usize,
    pub rotary: bool,
    /// Of the joint, mm or deg.
    pub range: (f64, f64),
}

/// The axes of a machine whose axes are X, Y, Z and two of A, B, C, by command.
pub fn axes_of(machine: &Machine) -> Option<Vec<AxisOf>> {
    let axes: Option<Vec<AxisOf>> = (0..machine.commands().len())
        .map(|c| {
            let joint = machine.command_joint(c);
            let word = joint.nc_word();
            let index = LETTERS.iter().position(|letter| *letter == word.address)?;
            let rotary = joint.kind == JointKind::Revolute;
            let (from, to) = machine.travel(c);
            let unit = if rotary { 180.0 / std::f64::consts::PI } else { 1e3 };
            let (middle, half) = (0.5 * (from + to) * unit, 0.5 * (to - from) * unit);
            let half = (0.8 * half).min(if rotary { 170.0 } else { 180.0 });
            let fits = word.sign == 1 && joint.follows.is_none() && rotary == (index > 2);
            let range = (middle - half, middle + half);
            fits.then_some(AxisOf { letter: LETTERS[index], index, rotary, range })
        })
        .collect();
    axes.filter(|axes| axes.len() == 5 && (0..3).all(|i| axes.iter().any(|a| a.index == i)))
}

/// A program for a machine with these axes.
pub fn drawn(random: &mut Random, axes: &[AxisOf], kind: Kind) -> Drawn {
    let mut tables = Tables::default();
    let fits = |i: usize| axes.iter().any(|axis| axis.index == i);
    let round = |value: f64| (value * 1e3).round() / 1e3;
    for offset in &mut tables.offsets {
        for (i, value) in offset.iter_mut().enumerate().filter(|(i, _)| fits(*i)) {
            *value = round(random.between(-60.0, 60.0)) * if i > 2 { 0.5 } else { 1.0 };
        }
    }
    tables.tools = (0..4).map(|_| round(random.between(20.0, 160.0))).collect();
    let zero: Vec<f64> =
        axes.iter().map(|axis| if axis.rotary { 0.0 } else { round(random.between(-80.0, 80.0)) }).collect();
    let z = axes.iter().position(|axis| axis.index == 2).expect("Z");
    tables.reference[2] = round(axes[z].range.1 - random.between(1.0, 30.0) + zero[z]);
    let start: Vec<f64> = axes.iter().map(|axis| round(random.between(axis.range.0, axis.range.1))).collect();
    let reference_length = round(random.between(0.0, 120.0));
    let named = random.between(0.0, 1.0) < 0.5;
    let mut draw = Draw {
        axes,
        kind,
        zero: zero.clone(),
        at: start.clone(),
        lost: vec![false; 5],
        preset: vec![0.0; 5],
        local: false,
        offset: 0,
        counted: 0.0,
        inch: false,
        incremental: false,
        absolute_centre: false,
        inverse_time: false,
        feed: false,
        plane: 0,
        motion: None,
        decimals: (3 + random.between(0.0, 2.0) as usize, 3 + random.between(0.0, 3.0) as usize),
        lower_case: random.between(0.0, 1.0) < 0.15,
        blanks: random.between(0.0, 1.0) < 0.3,
        numbered: random.between(0.0, 1.0) < 0.4,
        block: 0,
        subs: 0,
        lines: Vec::new(),
        sub_lines: Vec::new(),
        inside: false,
        planned: Vec::new(),
        tables,
        random,
    };
    if !named {
        draw.put(vec!["G54".into()]);
    }
    draw.begin();
    draw.body(kind.moves);
    draw.put(vec!["M2".into()]);
    let before = draw.sub_lines.len();
    let place = |(inside, planned): (bool, Planned)| {
        let line = if inside { planned.line } else { planned.line + before };
        Planned { line, ..planned }
    };
    let planned: Vec<Planned> = std::mem::take(&mut draw.planned).into_iter().map(place).collect();
    let lines: Vec<String> = draw.sub_lines.iter().chain(&draw.lines).cloned().collect();
    let text = lines.join("\n") + "\n";
    let tables = draw.tables;
    let map = |values: &dyn Fn(&AxisOf, usize) -> f64| {
        let words: Vec<String> = axes
            .iter()
            .enumerate()
            .map(|(c, axis)| format!("\"{}\": {:.4}", axis.letter, values(axis, c)))
            .collect();
        format!("{{{}}}", words.join(", "))
    };
    let offsets: Vec<String> = OFFSETS
        .iter()
        .zip(&tables.offsets)
        .map(|(name, offset)| format!("\"{name}\": {}", map(&|axis, _| offset[axis.index])))
        .collect();
    let tools: Vec<String> =
        tables.tools.iter().enumerate().map(|(k, length)| format!("\"{}\": {length:.4}", k + 1)).collect();
    let at_start = if named { "offset_at_start: \"G54\", " } else { "" };
    let start_of = |axis: &AxisOf, c: usize| {
        start[c] + zero[c] - if named { tables.offsets[0][axis.index] } else { 0.0 }
    };
    let setup = format!(
        "Setup(units: (length: mm, angle: deg), zero: {}, work_offsets: {{{}}}, {at_start}tools: {{{}}}, reference_length: {reference_length}, start: {}, reference: {{\"Z\": {:.4}}})",
        map(&|_, c| zero[c]),
        offsets.join(", "),
        tools.join(", "),
        map(&start_of),
        tables.reference[2],
    );
    Drawn { text, planned, tables, zero, reference_length, setup, start }
}
