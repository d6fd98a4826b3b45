//! `kincal compensate`

use std::fmt::Write;
use std::path::{Path, PathBuf};

use crate::calibration::CalibratedMachine;
use crate::compensate::{
    CompensateOptions, ExtrapolatedJoint, Listed, Report, Setup, UnknownAxes, UnknownWay, Verification,
    VerifyOptions, compensate_counted, verify_written,
};
use crate::inverse::Mode;

use super::Common;
use super::files::Output;
use super::output::{Failure, Outcome, angle, count, length, open_machine, write_checked};
use super::program::{DialectWord, IntegerWord, at, departures, dialect_of, integer_unit_of, tolerance};
use super::report::{Frame, Source, of_compensated, of_compensation, write_page};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Machine file, calibrated or not
    #[arg(value_name = "CALIBRATED.ron")]
    machine: PathBuf,
    /// NC program
    #[arg(value_name = "PROGRAM.nc")]
    program: PathBuf,
    /// Where to write the corrected program
    #[arg(short, long, value_name = "OUT.nc")]
    output: Option<Output>,
    /// Where to write the report: one HTML file
    #[arg(long, value_name = "OUT.html")]
    report: Option<Output>,
    /// Tools and work offsets, docs/compensate.md
    #[arg(long, value_name = "SETUP.ron")]
    setup: Option<PathBuf>,
    /// M codes of the machine's builder and the axes that they move, {"M170": [], "M60": ["Z"]}
    #[arg(long, value_name = "FILE")]
    m_codes: Option<PathBuf>,
    /// Write arcs as lines within this tolerance, such as 0.002mm
    #[arg(long, value_name = "LENGTH", value_parser = tolerance)]
    arcs: Option<f64>,
    /// Subdivide straight moves that would leave more than this between their ends
    #[arg(long, value_name = "LENGTH", value_parser = tolerance)]
    split: Option<f64>,
    /// Largest correction of the tip; without this, ten times what the machine's tolerances make
    #[arg(long, value_name = "LENGTH", value_parser = tolerance)]
    max_correction: Option<f64>,
    /// Digits behind the point
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(0..=9))]
    decimals: Option<u8>,
    /// What is corrected, where it is not what the machine has joints for
    #[arg(long, value_enum)]
    mode: Option<ModeWord>,
    /// Moves that need the word of an axis of which it is not known where it stands: without this, rapids are kept
    #[arg(long, value_enum)]
    unknown: Option<UnknownWord>,
    /// Tell steps of the correction apart that are larger than this where a direction of travel changes
    #[arg(long, value_name = "LENGTH", value_parser = tolerance)]
    max_step: Option<f64>,
    /// The control, where the program's first lines do not say it
    #[arg(long, value_enum)]
    dialect: Option<DialectWord>,
    /// What axis numbers without a point count in RS-274 programs: without this, mm and deg
    #[arg(long, value_enum)]
    integer_unit: Option<IntegerWord>,
    /// Do not read what was written anew to see whether it does what it should
    #[arg(long)]
    no_verify: bool,
    /// Compensate a program that is compensated already, or that goes where the model says nothing
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    common: Common,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum ModeWord {
    /// The tip alone
    Position,
    /// Tip and tool axis
    Axis,
    /// The whole pose
    Pose,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum UnknownWord {
    /// Refuse the move
    Refuse,
    /// Leave it as it is, and tell
    Keep,
}

pub(crate) fn run(args: &Args) -> Outcome {
    let calibrated = open_machine(&args.machine, |path| CalibratedMachine::open(path))?;
    let mut setup = args.setup.as_ref().map_or(Ok(Setup::default()), Setup::open)?;
    if let Some(codes) = &args.m_codes {
        setup = setup.with_m_codes(codes)?;
    }
    let options = CompensateOptions {
        decimals: args.decimals.map(usize::from),
        arcs: args.arcs,
        split: args.split,
        max_correction: args.max_correction,
        max_step: args.max_step,
        integer_unit: args.integer_unit.map(integer_unit_of),
        marked: true,
        force: args.force,
        mode: args.mode.map(|mode| match mode {
            ModeWord::Position => Mode::Position,
            ModeWord::Axis => Mode::PositionAndAxis,
            ModeWord::Pose => Mode::Pose,
        }),
        unknown: args.unknown.map(|unknown| match unknown {
            UnknownWord::Refuse => UnknownAxes::Refuse,
            UnknownWord::Keep => UnknownAxes::Keep,
        }),
        dialect: args.dialect.map(dialect_of),
    };
    let progress = args.common.progress();
    progress.say(&format!("correcting {}", args.program.display()));
    let mut verified = None;
    let write = |out: &mut dyn std::io::Write| {
        compensate_counted(&calibrated, &args.program, &setup, &options, out, progress.meter())
    };
    let report = match &args.output {
        None => write(&mut std::io::sink())?,
        Some(path) => write_checked(path, write, |written, report| {
            if args.no_verify || !report.has_corrected() {
                return Ok(());
            }
            progress.say("reading anew what was written");
            let files = (args.program.as_path(), written, &**path);
            verified = Some(verification(&calibrated, files, &setup, &options, report)?);
            Ok(())
        })?,
    };
    drop(progress);
    let mut text = render(&report, &args.program.display().to_string());
    if report.moves + report.machine_moves == 0 {
        let machine = calibrated.machine();
        let words: Vec<String> =
            (0..machine.commands().len()).map(|c| machine.command_joint(c).nc_word().address).collect();
        let _ = writeln!(
            text,
            "note: no block moves an axis of {}: its words are {} (`nc` in the machine file names others)",
            machine.name(),
            words.join(", ")
        );
    }
    if let Some(verified) = &verified {
        let _ = writeln!(
            text,
            "read anew: {} judged, the tip at most {} off at their ends",
            count(verified.judged, "move", "moves"),
            at(verified.largest_end_m, length)
        );
    }
    if let Some(tolerance) = args.arcs.filter(|tolerance| report.largest_arc_m.value > *tolerance) {
        let _ = writeln!(
            text,
            "note: --arcs {} is not held, {}: where a direction of travel changes the correction steps, and the line begins on its other side",
            length(tolerance),
            at(report.largest_arc_m, length)
        );
    }
    if let Some(path) = &args.output {
        let _ = writeln!(text, "written to {}", path.display());
    }
    if let Some(path) = &args.report {
        let mut sources =
            vec![Source::of("calibrated machine", &args.machine), Source::of("program", &args.program)];
        sources.extend(args.setup.iter().map(|path| Source::of("set-up", path)));
        sources.extend(args.m_codes.iter().map(|path| Source::of("M codes", path)));
        let frame = Frame { command: "kincal compensate", sources, notes: Vec::new() };
        write_page(path, &of_compensated(&calibrated, &report, &text, &frame))?;
        let _ = writeln!(text, "report written to {}", path.display());
    }
    args.common.say(&text)?;
    args.common.write_json(&Told { verdict: of_compensation(&report), report, verification: verified })
}

/// What is told in JSON.
#[derive(serde::Serialize)]
struct Told {
    /// What the program would be off, and what is left, in a sentence.
    verdict: String,
    #[serde(flatten)]
    report: Report,
    #[serde(skip_serializing_if = "Option::is_none")]
    verification: Option<Verification>,
}

/// The numbers of a program hold its tip no better than this, m.
const ROUNDING: f64 = 1e-9;

/// Reads anew what was written, and refuses it where the tip is farther off than the report says. `files`: the program, where the
/// corrected one stands now, and what it is to be called.
fn verification(
    calibrated: &CalibratedMachine,
    (program, written, name): (&Path, &Path, &Path),
    setup: &Setup,
    options: &CompensateOptions,
    report: &Report,
) -> Outcome<Verification> {
    let left = report.largest_left_m.value.max(report.largest_cycle_m.value) + ROUNDING;
    let mut how = VerifyOptions::default().with_tolerance(left);
    (how.dialect, how.integer_unit, how.force) = (options.dialect, options.integer_unit, options.force);
    held(verify_written(calibrated, program, (written, name), setup, &how)?, program, name)
}

/// What holds; what does not is a fault of ours, and nothing is written.
fn held(found: Verification, program: &Path, name: &Path) -> Outcome<Verification> {
    if found.holds() {
        return Ok(found);
    }
    let moves = count(found.departures.count, "move", "moves");
    Err(Failure::Told {
        what: format!(
            "{}: read anew, what would be written takes {moves} elsewhere than {} means; nothing is written\n{}",
            name.display(),
            program.display(),
            departures(&found).trim_end()
        ),
        mend:
            "this is a fault of kincal: please report it with the program; --no-verify writes it all the same"
                .into(),
    })
}

fn joint_unit(beyond: &ExtrapolatedJoint) -> fn(f64) -> String {
    if beyond.rotary { angle } else { length }
}

/// What is less is the rounding of the calculation, m or rad.
const NOTHING: f64 = 1e-11;

/// `lines 3, 7, 9 and 12 more`.
fn lines<T>(listed: &Listed<T>, line: impl Fn(&T) -> usize) -> String {
    const SHOWN: usize = 8;
    let mut shown: Vec<usize> = listed.first.iter().map(line).collect();
    shown.dedup();
    let names: Vec<String> = shown.iter().take(SHOWN).map(usize::to_string).collect();
    let more = listed.count.saturating_sub(names.len() as u64);
    let more = if more > 0 && listed.count as usize > SHOWN { " and more" } else { "" };
    format!("{} {}{more}", if names.len() == 1 { "line" } else { "lines" }, names.join(", "))
}

/// The report as people read it.
fn render(r: &Report, program: &str) -> String {
    let mut text =
        format!("{program}: {}, {}", count(r.blocks, "line", "lines"), count(r.moves, "move", "moves"));
    if r.machine_moves > 0 {
        let _ = write!(text, ", {} in the machine's own frame left as they are", r.machine_moves);
    }
    text.push('\n');
    if r.corrected_words + r.inserted_words + r.split_arcs == 0 {
        text.push_str("nothing to correct\n");
        return text + &notes(r);
    }
    let _ = writeln!(
        text,
        "{} corrected, {} inserted",
        count(r.corrected_words, "axis word", "axis words"),
        r.inserted_words
    );
    if r.split_arcs > 0 {
        let _ = writeln!(
            text,
            "{} written as {}, at most {} off",
            count(r.split_arcs, "arc", "arcs"),
            count(r.arc_lines, "line", "lines"),
            at(r.largest_arc_m, length)
        );
    }
    if r.split_moves > 0 {
        let _ = writeln!(text, "{} subdivided", count(r.split_moves, "straight move", "straight moves"));
    }
    let (m, rad) = (r.largest_correction_m, r.largest_correction_rad);
    let _ = writeln!(text, "largest correction: tip {}, tool axis {}", at(m, length), at(rad, angle));
    let (m, rad) = (r.largest_left_m, r.largest_left_rad);
    let _ = writeln!(
        text,
        "left at the end of a move, rounding included: tip {}, tool axis {}",
        at(m, length),
        at(rad, angle)
    );
    let _ = writeln!(text, "left along a straight move: tip {}", at(r.largest_mid_line_m, length));
    text + &notes(r)
}

fn notes(r: &Report) -> String {
    let mut text = String::new();
    for left in &r.left_out {
        let _ = writeln!(text, "note: {} at {} is not corrected: {}", left.effect, left.at, left.because);
    }
    for held in &r.held {
        let _ = writeln!(text, "note: {} at {}: {}", held.effect, held.at, held.because);
    }
    let tip_steps = r.largest_reversal_m.value > NOTHING;
    if tip_steps || r.reversals.first.iter().any(|x| x.step_rad > NOTHING) {
        let _ = writeln!(
            text,
            "note: the correction steps at {} where a direction of travel changes, {}: {}",
            count(r.reversals.count, "block", "blocks"),
            match tip_steps {
                true => format!("by at most {}", at(r.largest_reversal_m, length)),
                false => "of the tool axis alone".into(),
            },
            lines(&r.reversals, |x| x.line)
        );
    }
    for taken in [true, false] {
        let of = |way: &&UnknownWay| (way.side != 0) == taken;
        let first: Vec<&UnknownWay> = r.unknown_ways.first.iter().filter(of).collect();
        let joints: std::collections::BTreeSet<&str> = first.iter().map(|way| way.joint.as_str()).collect();
        let joints: Vec<&str> = joints.into_iter().collect();
        let mut at: Vec<String> = first.iter().map(|way| way.line.to_string()).collect();
        at.dedup();
        if at.is_empty() {
            continue;
        }
        let more = if at.len() > 8 || r.unknown_ways.count > first.len() as u64 { " and more" } else { "" };
        at.truncate(8);
        let _ = writeln!(
            text,
            "note: from where {} comes at {} {}{more} is not known; taken is {} (`start` and `reference` of the set-up say where axes stand)",
            joints.join(", "),
            if at.len() == 1 { "line" } else { "lines" },
            at.join(", "),
            if taken { "the direction of its first motion" } else { "the mean of both directions" }
        );
    }
    if r.unseen_directions.count > 0 {
        let pieces: std::collections::BTreeSet<&str> =
            r.unseen_directions.first.iter().map(|x| x.piece.as_str()).collect();
        let pieces: Vec<&str> = pieces.into_iter().collect();
        let _ = writeln!(
            text,
            "note: at {} the axes travel in a pattern of directions that the calibration has not seen ({}); corrected by what single directions have shown: {}",
            count(r.unseen_directions.count, "block", "blocks"),
            pieces.join(", "),
            lines(&r.unseen_directions, |x| x.line)
        );
    }
    if r.cycles > 0 {
        let _ = writeln!(
            text,
            "note: {} corrected in the plane only, which leaves {}",
            count(r.cycles, "drilling cycle", "drilling cycles"),
            match r.largest_cycle_m.value > NOTHING {
                true => format!("at most {}", at(r.largest_cycle_m, length)),
                false => "nothing".into(),
            }
        );
    }
    if r.unknown_places.count > 0 {
        let axes: std::collections::BTreeSet<&str> =
            r.unknown_places.first.iter().flat_map(|x| x.axes.iter().map(String::as_str)).collect();
        let axes: Vec<&str> = axes.into_iter().collect();
        let _ = writeln!(
            text,
            "note: where {} stands is not known at {}, so its share of the correction is left out: {}",
            axes.join(", "),
            count(r.unknown_places.count, "move", "moves"),
            lines(&r.unknown_places, |x| x.line)
        );
    }
    if r.singular.count > 0 {
        let _ = writeln!(
            text,
            "note: a direction of the tool axis is lost at {}, and what is wrong there stays: {}",
            count(r.singular.count, "block", "blocks"),
            lines(&r.singular, |x| x.line)
        );
    }
    if r.unreachable.count > 0 {
        let _ = writeln!(
            text,
            "note: the corrected machine does not reach {}: {}",
            count(r.unreachable.count, "block", "blocks"),
            lines(&r.unreachable, |x| x.line)
        );
    }
    if r.extrapolated_moves > 0 {
        let by = |beyond: &ExtrapolatedJoint| {
            format!("{} by up to {}", beyond.joint, at(beyond.by, joint_unit(beyond)))
        };
        let joints: Vec<String> = r.extrapolated_joints.iter().map(by).collect();
        let _ = writeln!(
            text,
            "note: {} leave what the calibration has seen: {}",
            count(r.extrapolated_moves, "move", "moves"),
            joints.join(", ")
        );
    }
    if r.large_steps.count > 0 {
        let _ = writeln!(
            text,
            "note: larger than --max-step are the steps at {}: {}",
            count(r.large_steps.count, "block", "blocks"),
            lines(&r.large_steps, |x| x.line)
        );
    }
    if r.numbers_without_point > 0 {
        let _ = writeln!(
            text,
            "note: {} without a point taken as mm and deg; where the control counts um, say so with --integer-unit um",
            count(r.numbers_without_point, "axis number", "axis numbers")
        );
    }
    if !r.never_programmed.is_empty() {
        let _ = writeln!(
            text,
            "note: the program never names {}; taken as standing at zero (or at `start` of the set-up), and not moved",
            r.never_programmed.join(", ")
        );
    }
    match &r.unseen {
        Some(unseen) if !unseen.patterns.is_empty() => {
            let _ = writeln!(
                text,
                "not seen by the calibration, and left (one standard deviation): tip {}, tool axis {}",
                length(unseen.tip_m),
                angle(unseen.axis_rad)
            );
            for p in unseen.patterns.iter().take(5) {
                let (tip, axis) = (length(p.tip_m), angle(p.axis_rad));
                let _ = writeln!(text, "  along {}: tip {tip}, tool axis {axis}", p.mostly.join(" "));
            }
            if unseen.patterns.len() > 5 {
                let _ = writeln!(text, "  and {} more", unseen.patterns.len() - 5);
            }
        }
        Some(_) => {}
        None if r.corrected_words + r.inserted_words > 0 => {
            text.push_str("note: the calibrated file does not say what its recordings have not seen\n");
        }
        None => {}
    }
    text
}

#[cfg(test)]
mod tests {
    use crate::compensate::{Departure, Reversal, Worst};

    use super::*;

    #[test]
    fn what_is_nothing_is_not_told_as_0_um_at_most() {
        let mut report = Report { cycles: 1, moves: 1, corrected_words: 1, ..Report::default() };
        assert!(
            notes(&report)
                .contains("note: 1 drilling cycle corrected in the plane only, which leaves nothing\n")
        );
        report.reversals.count = 1;
        report.reversals.first = vec![Reversal { line: 7, step_m: 1e-16, step_rad: 0.0 }];
        assert!(!notes(&report).contains("steps"));
        report.reversals.first[0].step_rad = 2e-6;
        assert!(notes(&report).contains(
            "steps at 1 block where a direction of travel changes, of the tool axis alone: line 7"
        ));
        report.largest_reversal_m = Worst { value: 3e-6, line: 7 };
        assert!(notes(&report).contains("changes, by at most 3.00 um (line 7): line 7"));
    }

    /// What is written is right, so what `verify` finds in it stands for a fault of ours.
    #[test]
    fn what_is_farther_off_than_reported_is_not_written() {
        let judge = |found| held(found, Path::new("part.nc"), Path::new("out.nc"));
        let mut found = Verification { judged: 1, ..Verification::default() };
        assert!(judge(found.clone()).is_ok_and(|found| found.judged == 1));
        found.departures.count = 1;
        found.departures.first =
            vec![Departure { line: 2, compensated_line: 3, end_m: Some(1e-5), between_m: Some(2e-6) }];
        let Err(Failure::Told { what, mend }) = judge(found) else {
            panic!("off by 10 um");
        };
        assert!(
            what.starts_with("out.nc: read anew, what would be written takes 1 move elsewhere than part.nc "),
            "{what}"
        );
        assert!(what.contains("line 2 (written in line 3): 10.0 um at its end"), "{what}");
        assert!(mend.contains("--no-verify"), "{mend}");
    }
}
