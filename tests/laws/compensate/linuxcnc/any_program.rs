//! Programs drawn at random, as LinuxCNC's interpreter reads them before and after: where the nominal machine takes the tip by the one, the
//! calibrated machine takes it by the other.

use std::collections::BTreeMap;

use super::by_hand::{ByHand, Tip, dot, norm, sub};
use super::client::{self, Axes, Sent};
use super::drawn::{AxisOf, Drawn, Kind, Planned, Sort, axes_of, drawn};
use super::*;
use crate::common::random::Random;

/// How far the tip may be from where it is meant at the end of a move, rounding aside, m; and the tool axis, rad.
const TIP: f64 = 0.5e-6;
const AXIS: f64 = 10e-6;
/// Tolerance of arcs, m.
const ARCS: f64 = 5e-6;

/// What a program may be refused for: an axis that it has left somewhere, a line that two calls would need otherwise, a place out of reach.
const LEGITIMATE: [&str; 6] = [
    "where it stands is not known here",
    "counts from a place that the program has not said",
    "the program has not placed",
    "calls need different corrections",
    "beyond its travel",
    "are taken for a correction",
];

/// What has been seen of programs.
#[derive(Default, Debug)]
struct Seen {
    programs: usize,
    moves: usize,
    judged: usize,
    axes: usize,
    arcs: usize,
    lines: usize,
    told: usize,
    cycles: usize,
    timed: usize,
    tip: f64,
    axis: f64,
    arc: f64,
    /// Refusals by what is said, without numbers.
    refused: BTreeMap<String, usize>,
}

impl Seen {
    /// As in the table of `docs/reliability.md`.
    fn row(&self, name: &str) -> String {
        let refused: usize = self.refused.values().sum();
        let over = |value: f64, unit: f64| format!("{:.2}", value * unit);
        let cells = [
            self.programs.to_string(),
            refused.to_string(),
            self.judged.to_string(),
            over(self.tip, 1e6),
            over(self.axis, 1e6),
            format!("{} ({})", self.arcs, self.lines),
            over(self.arc, 1e6),
            self.told.to_string(),
            self.timed.to_string(),
            self.cycles.to_string(),
        ];
        format!("| `{name}` | {} |", cells.join(" | "))
    }
}

/// A machine with its errors.
struct Case {
    calibrated: CalibratedMachine,
    axes: Vec<AxisOf>,
    nominal: ByHand,
    /// Command whose direction of travel counts.
    play: Option<(usize, f64)>,
    by_direction: [ByHand; 3],
}

impl Case {
    fn new(machine: &Machine, random: &mut Random, with_play: bool) -> Case {
        let axes = axes_of(machine).expect("one of the five-axis machines");
        let size = random.between(0.3, 1.5);
        let deviations = random_deviations(machine, size, random.between(0.0, 1e9) as u64);
        let mut calibrated = CalibratedMachine::nominal(machine.clone()).with_deviations(deviations.clone());
        let nominal = ByHand::new(machine, &vec![Twist::zero(0.0); deviations.len()]);
        let mut parts = vec![Twist::zero(0.0); deviations.len()];
        let mut play = None;
        if with_play {
            let c = random.between(0.0, 4.999) as usize;
            let name = machine.commands()[c].clone();
            let frame = machine.dyads().iter().position(|d| d.joint.as_ref().is_some_and(|j| j.name == name));
            let j = frame.expect("its own");
            let joint = machine.command_joint(c);
            let half = if axes[c].rotary { 5e-5 } else { 6e-6 } * random.between(-1.0, 1.0);
            let along = joint.axis.times(half);
            if axes[c].rotary {
                parts[j].w = along
            } else {
                parts[j].v = along
            }
            let (unit, kind) = if axes[c].rotary { (180.0 / std::f64::consts::PI, "w") } else { (1e3, "v") };
            let other = if axes[c].rotary { "v" } else { "w" };
            let [x, y, z] = along.0.map(|a| a * unit);
            let pieces = format!(
                "pieces: (axes: [(joint: \"{name}\", dead_band: 0)], parts: [(with_direction_of: [\"{name}\"], deviations: [(frame: \"{}\", {kind}: ({x:e}, {y:e}, {z:e}), {other}: (0, 0, 0))])], seen: []), deviations: [",
                machine.dyads()[j].frame,
            );
            let text = calibrated.to_ron().replacen("deviations: [", &pieces, 1);
            calibrated =
                CalibratedMachine::parse("play.ron", &text).unwrap_or_else(|e| panic!("{e}\n{text}"));
            play = Some((c, half));
        }
        let of = |direction: f64| {
            let sums: Vec<Twist<f64>> = (deviations.iter().zip(&parts))
                .map(|(dh, part)| {
                    let (a, b) = (dh.to_array(), part.to_array());
                    Twist::from_array(std::array::from_fn(|k| a[k] + direction * b[k]))
                })
                .collect();
            ByHand::new(machine, &sums)
        };
        Case { axes, nominal, play, by_direction: [of(-1.0), of(0.0), of(1.0)], calibrated }
    }

    /// Joints, m and rad, of places in the machine's own frame.
    fn joints(&self, drawn: &Drawn, place: &Axes) -> Vec<f64> {
        let of = |(c, axis): (usize, &AxisOf)| {
            let joint = place[axis.index] - drawn.zero[c];
            if axis.rotary { joint.to_radians() } else { joint / 1e3 }
        };
        self.axes.iter().enumerate().map(of).collect()
    }

    /// The tip of the nominal machine where a move of the original is after a part of its way.
    fn meant(&self, drawn: &Drawn, sent: &Sent, s: f64) -> Tip {
        self.nominal.tip(&self.joints(drawn, &sent.at(s)), beyond(drawn, sent))
    }

    /// That of the calibrated machine, an axis with play having gone in this direction.
    fn actual(&self, drawn: &Drawn, sent: &Sent, s: f64, direction: i8) -> Tip {
        let machine = &self.by_direction[(direction + 1) as usize];
        machine.tip(&self.joints(drawn, &sent.at(s)), beyond(drawn, sent))
    }
}

/// The tip beyond frame `t`, m.
fn beyond(drawn: &Drawn, sent: &Sent) -> f64 {
    sent.tool.map_or(0.0, |length| (drawn.reference_length - length) / 1e3)
}

fn without_numbers(text: &str) -> String {
    let words =
        text.split_whitespace().map(|w| if w.contains(|c: char| c.is_ascii_digit()) { "#" } else { w });
    words.collect::<Vec<_>>().join(" ")
}

/// Draws a program and asks all questions of it; what is wrong in words.
fn ask(case: &Case, kind: Kind, random: &mut Random, seen: &mut Seen) -> Result<(), String> {
    let drawn = drawn(random, &case.axes, kind);
    let decimals = (random.between(0.0, 1.0) < 0.6).then(|| random.between(5.0, 6.99) as usize);
    let mut options = CompensateOptions::default().with_arcs(ARCS);
    options.decimals = decimals;
    let setup = Setup::parse("setup.ron", &drawn.setup).unwrap_or_else(|e| panic!("{e}"));
    seen.programs += 1;
    let (out, report) = match compensate_text(&case.calibrated, "part.nc", &drawn.text, &setup, &options) {
        Ok(both) => both,
        Err(error) => {
            let before = client::moves(&drawn.text, &drawn.tables);
            let legal = before.map_or_else(|e| format!("(and by rs274: {e}) "), |_| String::new());
            *seen.refused.entry(format!("{legal}{}", without_numbers(&error.to_string()))).or_default() += 1;
            return Ok(());
        }
    };
    let told = |what: String| {
        format!(
            "{what}\n{}\n--- set-up\n{}\n--- original\n{}\n--- written\n{out}",
            case.calibrated.machine().name(),
            drawn.setup,
            drawn.text
        )
    };
    let before = client::moves(&drawn.text, &drawn.tables).map_err(|e| told(format!("the original: {e}")))?;
    let after = client::moves(&out, &drawn.tables).map_err(|e| told(format!("what is written: {e}")))?;
    let (before, after) = if kind.marked { (before, after) } else { (one_by_one(before), one_by_one(after)) };
    if before.len() != after.len() || before.len() < drawn.planned.len() {
        return Err(told(format!(
            "{} and {} moves, {} planned",
            before.len(),
            after.len(),
            drawn.planned.len()
        )));
    }
    let half = |planned: &Planned| {
        let places = decimals.unwrap_or(if planned.unit > 1.0 { 4 } else { 3 });
        (
            0.5 * 10f64.powi(-(places as i32)) * planned.unit / 1e3,
            0.5 * 10f64.powi(-(decimals.unwrap_or(3) as i32)),
        )
    };
    let listed = |count: u64, lines: Vec<usize>, line: usize| count > 50 || lines.contains(&line);
    let mut direction = 0i8;
    // A move that starts where the axis is not right is another one.
    let mut from_singular = false;
    let mut knows = false;
    let mut stood = case.play.map_or(0.0, |(c, _)| drawn.start[c] + drawn.zero[c]);
    // Whether that axis has just turned round where it is too near to say.
    let mut turns = false;
    for ((planned, meant), sent) in drawn.planned.iter().zip(&before).zip(&after) {
        seen.moves += 1;
        let (Some(end), Some(last)) = (meant.last(), sent.last()) else {
            return Err(told(format!("line {}: {} and {} moves", planned.line, meant.len(), sent.len())));
        };
        if let Some((c, _)) = case.play {
            let index = case.axes[c].index;
            let now = end.at(1.0)[index];
            // Along lines in the place of an arc the axis goes as the last of them does.
            let round = end.round.is_some_and(|round| round.plane.contains(&index));
            let before = end.at(1.0 - 1.0 / sent.len() as f64)[index];
            let by = if round { now - before } else { now - stood };
            if by.abs() > if round { 3e-4 } else { 1e-4 } {
                direction = by.signum() as i8;
                turns = false;
            } else if round {
                turns = true;
            }
            stood = now;
        }
        let play = case.play.map_or(String::new(), |(c, half)| {
            format!(" (play of {} by {:.2} um or urad, going {direction})", case.axes[c].letter, half * 1e6)
        });
        let fault = |what: String| Err(told(format!("line {}: {what}{play}", planned.line)));
        if planned.sort == Sort::Machine {
            let (a, b) = (end.at(1.0), last.at(1.0));
            let named = case.axes.iter().filter(|axis| {
                line_of(&drawn.text, planned.line)
                    .split(['(', ';'])
                    .next()
                    .unwrap_or_default()
                    .to_uppercase()
                    .contains(axis.letter)
            });
            for axis in named {
                if (a[axis.index] - b[axis.index]).abs() > 1.5e-4 {
                    return fault(format!(
                        "{} of the machine's own frame is moved: {a:?} {b:?}",
                        axis.letter
                    ));
                }
            }
            continue;
        }
        let unknown = listed(
            report.unknown_places.count,
            report.unknown_places.first.iter().map(|u| u.line).collect(),
            planned.line,
        );
        let starts_known = std::mem::replace(&mut knows, planned.known && !unknown);
        let vague = meant.iter().chain(sent).any(|sent| sent.vague);
        if !(planned.known || planned.sort == Sort::Cycle) || unknown || turns || vague {
            continue;
        }
        let unreached = listed(
            report.unreachable.count,
            report.unreachable.first.iter().map(|u| u.line).collect(),
            planned.line,
        );
        let singular = listed(
            report.singular.count,
            report.singular.first.iter().map(|u| u.line).collect(),
            planned.line,
        );
        let starts_singular = std::mem::replace(&mut from_singular, singular);
        let (digit, digit_deg) = half(planned);
        let rounding = 3f64.sqrt() * digit + 0.05e-6;
        if planned.sort == Sort::Cycle {
            let (Some(a), Some(b)) = (meant.first(), sent.first()) else { continue };
            if meant.len() != sent.len() {
                return fault(format!("{} and {} moves of a cycle", meant.len(), sent.len()));
            }
            seen.cycles += 1;
            let mut deeper = a.clone();
            deeper.from[2] += 1.0;
            let (goal, tip) = (case.meant(&drawn, a, 1.0), case.actual(&drawn, b, 1.0, direction));
            let below = case.meant(&drawn, &deeper, 0.0);
            let down = sub(below.at, case.meant(&drawn, a, 0.0).at);
            let down = down.map(|x| x / norm(down));
            let gap = sub(tip.at, goal.at);
            let across = norm(std::array::from_fn(|i| gap[i] - dot(gap, down) * down[i]));
            let level = 1e-3 * 30e-3;
            if across > TIP + rounding + level {
                return fault(format!("a hole is {:.3} um off", across * 1e6));
            }
            continue;
        }
        seen.judged += 1;
        let goal = case.meant(&drawn, end, 1.0);
        let tip = case.actual(&drawn, last, 1.0, direction);
        let gap = goal.gap(&tip);
        if !unreached {
            seen.tip = seen.tip.max(gap - rounding);
            if gap > TIP + rounding {
                return fault(format!("the tip is {:.3} um off", gap * 1e6));
            }
        }
        if !singular && !unreached {
            seen.axes += 1;
            let angle = goal.angle(&tip);
            let rounding = 2f64.sqrt() * digit_deg.to_radians() + 0.05e-6;
            seen.axis = seen.axis.max(angle - rounding);
            if angle > AXIS + rounding {
                return fault(format!("the tool axis is {:.1} urad off", angle * 1e6));
            }
        }
        // The time of the block.
        let sum =
            |moves: &[Sent]| moves.iter().map(Sent::time).fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
        let (ways, feeds) = (end.ways(), end.sort == client::Sort::Feed);
        let turns_alone = ways.0 < 5e-5 && ways.1 > 1e-3;
        // What the interpreter itself hurries, or counts otherwise.
        let left_open = end.is_least() || planned.inverse_time && end.is_closed();
        let bent = singular || starts_singular;
        if feeds
            && !(left_open || bent)
            && meant.len() == 1
            && (turns_alone || planned.inverse_time || ways.0 > 5.0)
        {
            let ((a, open_a), (b, open_b)) = (sum(meant), sum(sent));
            seen.timed += 1;
            // Where the tip has a feed, the way is as much longer as the correction makes it.
            let own_time = turns_alone || planned.inverse_time;
            let way: f64 = sent.iter().map(|sent| sent.ways().0).sum();
            let wanted = if own_time { a } else { a * way / ways.0 };
            // A turn is longer by its own correction, and lines that make up for the tip take their time as well.
            let turned: f64 = sent.iter().map(|sent| sent.ways().1).sum();
            let longer = if turns_alone { (turned / ways.1 - 1.0).abs() + 0.02 } else { 0.01 };
            // Under the least feed the original itself is as fast as it may be.
            let hurried = !turns_alone && sent.iter().any(Sent::is_least);
            if !hurried && (b - wanted).abs() > longer * wanted + open_a + open_b {
                return fault(format!("the block takes {:.5} instead of {:.5} min", b, a));
            }
        }
        if planned.sort == Sort::Arc && case.play.is_none() && starts_known {
            seen.arcs += 1;
            seen.lines += sent.len();
            let worst = beside_arc(case, &drawn, end, sent);
            // Its centre has four digits.
            let digits = 0.05e-6 * 3.0 * planned.unit;
            if report.largest_arc_m.value > ARCS {
                // Told: no lines hold an arc through a singular pose.
                seen.told += 1;
                continue;
            }
            seen.arc = seen.arc.max(worst - digits);
            if worst > ARCS + digits {
                return fault(format!(
                    "a line is {:.3} um off its arc ({:.3} um are told)",
                    worst * 1e6,
                    report.largest_arc_m.value * 1e6
                ));
            }
        }
    }
    Ok(())
}

/// Largest distance of the actual tip along `lines` from the meant arc, m.
fn beside_arc(case: &Case, drawn: &Drawn, arc: &Sent, lines: &[Sent]) -> f64 {
    let count = lines.len() as f64;
    let mut worst = 0.0f64;
    for (k, line) in lines.iter().enumerate() {
        for part in [0.25, 0.5, 0.75, 1.0] {
            let tip = case.actual(drawn, line, part, 0);
            let gap = |s: f64| case.meant(drawn, arc, s).gap(&tip);
            // Nearest place of the arc by thirds.
            let near = (k as f64 + part) / count;
            let (mut low, mut high) = ((near - 1.0 / count).max(0.0), (near + 1.0 / count).min(1.0));
            for _ in 0..24 {
                let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
                if gap(a) < gap(b) { high = b } else { low = a }
            }
            worst = worst.max(gap(0.5 * (low + high)).min(gap(near)));
        }
    }
    worst
}

fn one_by_one(moves: Vec<Vec<Sent>>) -> Vec<Vec<Sent>> {
    moves.into_iter().flatten().map(|sent| vec![sent]).collect()
}

fn line_of(text: &str, line: usize) -> &str {
    text.lines().nth(line.saturating_sub(1)).unwrap_or_default()
}

/// `KINCAL_PROGRAMS=2000 KINCAL_SEED=7`: so many programs for each machine, other ones.
fn number_of(name: &str, otherwise: u64) -> u64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(otherwise)
}

#[test]
#[ignore = "needs rs274, the interpreter of LinuxCNC"]
fn the_calibrated_machine_goes_by_what_is_written_where_the_nominal_one_goes_by_the_original() {
    let (programs, seed) = (number_of("KINCAL_PROGRAMS", 60), number_of("KINCAL_SEED", 1));
    let machines: Vec<(String, Machine)> =
        common::machines().into_iter().filter(|(_, machine)| axes_of(machine).is_some()).collect();
    assert!(machines.len() >= 8, "{}", machines.len());
    let mut faults = Vec::new();
    let (mut all, mut refused) = (0, Vec::new());
    for (m, (name, machine)) in machines.iter().enumerate() {
        let mut seen = Seen::default();
        for k in 0..programs {
            let mut random = Random::new(seed.wrapping_mul(1_000_003).wrapping_add(100_000 * m as u64 + k));
            let with_play = k % 6 == 5;
            let marked = k % 3 != 1;
            let kind = Kind {
                arcs: marked && random.between(0.0, 1.0) < 0.7,
                known_ways: with_play,
                marked,
                moves: 40,
            };
            let case = Case::new(machine, &mut random, with_play);
            if let Err(told) = ask(&case, kind, &mut random, &mut seen) {
                faults.push(format!("program {k}, {told}"));
            }
        }
        println!("{}", seen.row(name));
        refused.extend(seen.refused.iter().map(|(what, count)| (what.clone(), *count)));
        all += seen.programs;
    }
    if let (Some(folder), false) = (std::env::var_os("KINCAL_FAULTS"), faults.is_empty()) {
        std::fs::create_dir_all(&folder).expect("a folder");
        for (k, fault) in faults.iter().enumerate() {
            std::fs::write(Path::new(&folder).join(format!("{k}.txt")), fault).expect("writable");
        }
    }
    for (what, _) in &refused {
        assert!(LEGITIMATE.iter().any(|known| what.contains(known)), "refused: {what}");
    }
    let count: usize = refused.iter().map(|(_, count)| count).sum();
    println!("{count} of {all} programs are refused: {refused:?}");
    assert!(count * 10 < all, "{count} of {all} are refused");
    let heads: Vec<&str> = faults.iter().map(|fault| fault.lines().next().unwrap_or_default()).collect();
    assert!(faults.is_empty(), "{} programs:\n{}\n{}", faults.len(), heads.join("\n"), faults[0]);
}
