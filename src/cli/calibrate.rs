//! `kincal calibrate`

use std::fmt::Write;
use std::path::PathBuf;

use crate::calibration::CalibratedMachine;
use crate::circular::{CircularTest, circular_tests};
use crate::identify::{CalibrateOptions, ErrorModel, Figures, Fit, Loss, Solver, calibrate_model};
use crate::machine::Machine;
use crate::recording::Recording;
use crate::units::Rms;
use crate::units::{Quantity, Unit, amount};
use crate::variation::{Directions, MOST_AXES, Varying};
use clap::ValueEnum;

use super::Common;
use super::files::Output;
use super::keep::Keep;
use super::output::{
    Failure, Kind, Outcome, angle, count, length, open_machine, open_recordings, write_whole,
};
use super::report::{self, Frame, Measured, Source, of_measured, write_page};
use super::table::table;
use super::verdict;

#[derive(Clone, Copy, ValueEnum)]
enum SolverWord {
    /// Levenberg-Marquardt by gain ratio, with the tolerances as prior
    Lm,
    /// The paper's fixed damping
    FixedDamping,
    /// Plain Gauss-Newton
    GaussNewton,
    /// Minimum norm above a relative singular value
    RankTruncation,
}

#[derive(Clone, Copy, ValueEnum)]
enum LossWord {
    /// Least squares
    Squares,
    /// Quadratic, then linear beyond --tuning standard deviations (3 unless given)
    Huber,
    /// No influence beyond --tuning standard deviations (4.685 unless given)
    Tukey,
}

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Machine file
    #[arg(value_name = "MACHINE.ron")]
    machine: PathBuf,
    /// Recordings
    #[arg(required = true, value_name = "REC.csv")]
    recordings: Vec<PathBuf>,
    /// Where to write the calibrated machine
    #[arg(short, long, value_name = "CALIBRATED.ron")]
    output: Option<Output>,
    /// Where to write the report with its pictures: one HTML file
    #[arg(long, value_name = "OUT.html")]
    report: Option<Output>,
    /// How to walk to the optimum
    #[arg(long, value_enum, default_value = "lm")]
    solver: SolverWord,
    /// Damping of fixed-damping, relative to the largest diagonal element
    #[arg(long, default_value_t = 1e-3, value_parser = positive, allow_negative_numbers = true)]
    tau: f64,
    /// Steps of fixed-damping
    #[arg(long, default_value_t = 30)]
    steps: usize,
    /// Relative singular value below which rank-truncation takes a direction as not seen
    #[arg(long, default_value_t = 1e-3, value_parser = relative, allow_negative_numbers = true)]
    cut: f64,
    /// How residuals count
    #[arg(long, value_enum, default_value = "huber")]
    loss: LossWord,
    /// Tuning constant of the loss, standard deviations
    #[arg(long, value_parser = positive, allow_negative_numbers = true)]
    tuning: Option<f64>,
    /// Do not hold deviations near zero by the tolerances of the machine file
    #[arg(long)]
    no_prior: bool,
    /// A model for each pattern of directions of travel of these axes, such as a,c
    #[arg(long, value_name = "AXES", value_delimiter = ',')]
    directions: Vec<String>,
    /// Motion against the direction of travel that is still no reversal, such as a=0.01deg (1e-5 of the range unless given)
    #[arg(long, value_name = "AXIS=SIZE", value_delimiter = ',', requires = "directions")]
    dead_band: Vec<String>,
    /// Use so many samples of each piece of the model, evenly spread, and judge it on the others
    #[arg(long, value_name = "N", value_parser = whole, allow_negative_numbers = true)]
    samples: Option<u64>,
    /// Leave room for smooth error motions of every joint, over the tolerance of its frame, such as 0.03, and keep them: for a model that is
    /// to hold on other paths
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, value_parser = share, allow_negative_numbers = true)]
    error_motions: f64,
    /// List every component of every deviation, not only those that the data determine
    #[arg(long)]
    all: bool,
    /// Go on although recordings and machine do not belong together
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    keep: Keep,
    #[command(flatten)]
    common: Common,
}

impl Args {
    /// The model asked for.
    fn model(&self, machine: &Machine) -> Outcome<ErrorModel> {
        let mut axes = Vec::new();
        for name in &self.directions {
            let c = command(machine, name)?;
            if axes.contains(&c) {
                let what = format!("--directions names {name} twice");
                return Err(Failure::Told { what, mend: "name every axis once".into() });
            }
            axes.push(c);
        }
        if axes.len() > MOST_AXES {
            let what = format!("--directions names {} axes", axes.len());
            return Err(Failure::Told { what, mend: format!("name at most {MOST_AXES}") });
        }
        let mut dead_bands = vec![None; machine.commands().len()];
        for text in &self.dead_band {
            let (name, size) = text.split_once('=').unwrap_or((text, ""));
            let c = command(machine, name)?;
            if !axes.contains(&c) {
                let what = format!("--dead-band {text} is of an axis that the model is not keyed on");
                return Err(Failure::Told {
                    what,
                    mend: format!("add {name} to --directions, or leave it out"),
                });
            }
            let quantity = machine.command_joint(c).kind.quantity();
            let Some(band) = amount(size, quantity).ok().filter(|band| *band >= 0.0) else {
                let what = format!("--dead-band {text} is not an axis with a size");
                let units = Unit::symbols_of(quantity);
                let own = match quantity {
                    Quantity::Angle => machine.units().angle,
                    _ => machine.units().length,
                };
                let mend =
                    format!("write {name}=SIZE with one of the units {units}, such as {name}=0.01{own}");
                return Err(Failure::Told { what, mend });
            };
            dead_bands[c] = Some(band);
        }
        let directions = (!axes.is_empty()).then(|| Directions::new(axes));
        Ok(ErrorModel {
            varying: Varying { directions, terms: Vec::new() },
            dead_bands,
            samples: self.samples,
            error_motions: self.error_motions,
            ..ErrorModel::default()
        })
    }

    fn options(&self) -> CalibrateOptions {
        CalibrateOptions {
            solver: match self.solver {
                SolverWord::Lm => Solver::LevenbergMarquardt,
                SolverWord::FixedDamping => Solver::FixedDamping { tau: self.tau, steps: self.steps },
                SolverWord::GaussNewton => Solver::GaussNewton,
                SolverWord::RankTruncation => Solver::RankTruncation { cut: self.cut },
            },
            loss: match self.loss {
                LossWord::Squares => Loss::Squares,
                LossWord::Huber => Loss::Huber { k: self.tuning.unwrap_or(3.0) },
                LossWord::Tukey => Loss::Tukey { c: self.tuning.unwrap_or(4.685) },
            },
            prior: !self.no_prior,
        }
    }
}

/// What is told in JSON.
#[derive(serde::Serialize)]
pub(crate) struct Told<'a> {
    pub verdict: String,
    #[serde(flatten)]
    pub fit: &'a Fit,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    pub circular_tests: &'a [CircularTest],
}

/// Calibrates, and refuses what is nonsense; with `force` that is a note.
pub(crate) fn judged(
    machine: &Machine,
    recordings: &[Recording],
    (model, options): (&ErrorModel, CalibrateOptions),
    force: bool,
    progress: &dyn Fn(&str),
) -> Outcome<(CalibratedMachine, Fit, Option<String>)> {
    let (calibrated, mut fit) = calibrate_model(machine, recordings, model, options, progress)?;
    fit.warnings.extend(verdict::of_recordings(machine, recordings, force, progress)?);
    let note = verdict::of_fit(machine, recordings, &fit, force, progress)?;
    Ok((calibrated, fit, note))
}

pub(crate) fn run(args: &Args) -> Outcome {
    let machine = open_machine(&args.machine, |path| Machine::open(path))?;
    let progress = args.common.progress();
    let recordings = args.keep.within(open_recordings(&args.recordings, &machine, &args.machine)?);
    let recordings = progress.reading(recordings);
    let model = args.model(&machine)?;
    let (calibrated, fit, note) =
        judged(&machine, &recordings, (&model, args.options()), args.force, &|text| progress.say(text))?;
    let mut text = render(&fit, args.all);
    if let Some(note) = &note {
        let _ = writeln!(text, "note: {note}");
    }
    let circular = match args.report.is_some() || args.common.wants_json() {
        true => circular_tests(&calibrated, &recordings)?,
        false => Vec::new(),
    };
    let page = match &args.report {
        None => None,
        Some(_) => {
            progress.say("drawing the report");
            let mut sources = vec![Source::of("machine", &args.machine)];
            sources.extend(args.recordings.iter().map(|path| Source::of("recording", path)));
            let notes = fit.warnings.iter().cloned().chain(note).collect();
            let geometry = (&calibrated, &fit);
            let (machine, recordings, circular) = (&machine, &recordings[..], &circular[..]);
            let measured = Measured { machine, recordings, geometry, diagnosis: None, circular };
            Some(of_measured(&measured, &Frame { command: "kincal calibrate", sources, notes })?)
        }
    };
    drop(progress);
    if let Some(path) = &args.output {
        write_machine(path, &calibrated)?;
        let _ = writeln!(text, "\nwritten to {}", path.display());
    }
    if let (Some(path), Some(page)) = (&args.report, page) {
        write_page(path, &page)?;
        let _ = writeln!(text, "\nreport written to {}", path.display());
    }
    args.common.say(&text)?;
    args.common.write_json(&Told { verdict: report::of_fit(&fit), fit: &fit, circular_tests: &circular })
}

fn command(machine: &Machine, name: &str) -> Outcome<usize> {
    machine.commands().iter().position(|c| c == name).ok_or_else(|| Failure::Told {
        what: format!("\"{name}\" is no axis of {}", machine.name()),
        mend: format!("its axes are {}", machine.commands().join(", ")),
    })
}

/// A whole number above zero.
fn whole(text: &str) -> Result<u64, String> {
    text.parse().ok().filter(|n| *n > 0).ok_or_else(|| "expected a whole number above zero".into())
}

/// A number from 0 to 1.
fn share(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..=1.0).contains(&value) => Ok(value),
        _ => Err("expected a number from 0 to 1".into()),
    }
}

/// A number above zero and below one.
pub(super) fn relative(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value < 1.0 => Ok(value),
        _ => Err("expected a number above zero and below one".into()),
    }
}

/// A number above zero.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err("expected a number above zero".into()),
    }
}

/// Writes a calibrated machine whole or not at all.
pub(crate) fn write_machine(path: &std::path::Path, calibrated: &CalibratedMachine) -> Outcome {
    write_whole(path, |out| {
        // An error is told of the output by `write_whole`.
        let _ = out.write_all(calibrated.to_ron().as_bytes());
        Ok(())
    })
}

fn rms(rms: &Rms) -> String {
    let parts: Vec<String> = rms.m.map(length).into_iter().chain(rms.rad.map(angle)).collect();
    parts.join(", ")
}

fn figures(figures: &Figures) -> [String; 2] {
    [rms(&figures.rms), rms(&figures.max)]
}

/// The pieces of the model, and the samples that were held out.
fn render_pieces(fit: &Fit) -> String {
    let mut text = String::new();
    if fit.pieces.is_empty() && fit.held_out.is_none() {
        return text;
    }
    let out = fit.held_out.is_some();
    let words = |words: [&str; 7]| words.map(String::from).to_vec();
    let mut rows = vec![words(["", "samples", "RMS", "largest", "held out", "RMS", "largest"])];
    for piece in &fit.pieces {
        let [own_rms, own_max] = figures(&piece.fit);
        let held = piece.held_out.as_ref().map(|f| (f.samples.to_string(), figures(f)));
        let (n, [held_rms, held_max]) = held.unwrap_or_default();
        let samples = piece.fit.samples.to_string();
        rows.push(words([&piece.name, &samples, &own_rms, &own_max, &n, &held_rms, &held_max]));
    }
    if let Some(held_out) = &fit.held_out {
        for (name, f) in [("all, calibrated", &held_out.model), ("all, as declared", &held_out.nominal)] {
            let [held_rms, held_max] = figures(f);
            rows.push(words([name, "", "", "", &f.samples.to_string(), &held_rms, &held_max]));
        }
    }
    if !out {
        rows.iter_mut().for_each(|row| row.truncate(4));
    }
    let title = if fit.pieces.is_empty() {
        "samples that were held out"
    } else {
        "pieces by direction of travel (F forward, R reverse)"
    };
    let _ = writeln!(text, "\n{title}");
    text.push_str(&table("  ", &[false, true, true, true, true, true, true][..rows[0].len()], &rows));
    if fit.held_out.as_ref().is_some_and(|held_out| held_out.model.samples == 0) {
        text.push_str("note: --samples took all there are; none is left to judge the model on\n");
    }
    text
}

/// Share of the data from which a single component is listed.
const MOSTLY: f64 = 0.7;

/// The result as people read it.
pub(crate) fn render(fit: &Fit, all: bool) -> String {
    let recordings = count(fit.recordings.len() as u64, "recording", "recordings");
    let mut text = format!("{}\n\n", report::of_fit(fit));
    let _ = write!(text, "{}: {} in {recordings}", fit.machine, count(fit.samples, "sample", "samples"));
    if fit.dropped > 0 {
        let _ = write!(text, ", {} left out as drop-outs", count(fit.dropped, "row", "rows"));
    }
    text.push_str("\n\nRMS of the residuals (measured minus model)\n");
    let words = |words: [&str; 6]| words.map(String::from).to_vec();
    let named = fit.recordings.iter().any(|r| !r.setup.is_empty());
    let setup = if named { "set-up" } else { "" };
    let mut rows = vec![words(["recording", setup, "measurement", "samples", "as declared", "calibrated"])];
    for r in &fit.recordings {
        let (samples, before, after) = (r.samples.to_string(), rms(&r.nominal), rms(&r.geometric));
        rows.push(words([&r.name, &r.setup, &r.measurement, &samples, &before, &after]));
    }
    for (pair, kind) in [(fit.rms.m, Kind::Length), (fit.rms.rad, Kind::Angle)] {
        if let Some(pair) = pair.filter(|_| fit.recordings.len() > 1) {
            let [before, after] = [pair.nominal, pair.geometric].map(|x| kind.show(x));
            rows.push(words(["all", "", "", "", &before, &after]));
        }
    }
    text.push_str(&table("  ", &[false, false, false, true, true, true], &rows));
    let _ = writeln!(
        text,
        "\n{} of {} combinations of the unknowns are seen; {}, {}",
        fit.rank,
        fit.unknowns,
        count(fit.steps as u64, "step", "steps"),
        fit.stop
    );
    let shown: Vec<_> = fit.parameters.iter().filter(|p| all || p.share > MOSTLY).collect();
    if !shown.is_empty() {
        let heading = if all { "deviations" } else { "deviations that come mostly from the data" };
        let _ = writeln!(text, "\n{heading} (value ± standard error, share of the data)");
    }
    let mut rows = Vec::new();
    for p in shown {
        let mut name = if p.setup.is_empty() { p.frame.clone() } else { format!("{}[{}]", p.frame, p.setup) };
        if !p.directions.is_empty() {
            let _ = write!(name, ", direction of {}", p.directions);
        }
        let kind = if p.component.starts_with('v') { Kind::Length } else { Kind::Angle };
        let (value, error, unit) = kind.show_with_error(p.value, p.std_error);
        let share = format!("{:.0} %", 100.0 * p.share);
        rows.push(vec![name, p.component.clone(), value, format!("± {error} {unit}"), share]);
    }
    text.push_str(&table("  ", &[false, false, true, false, true], &rows));
    text.push_str(&render_pieces(fit));
    let seen = fit.combinations.iter().filter(|c| c.share > 0.5).count();
    let _ = writeln!(
        text,
        "\n{} of deviations {} mostly from the data, {} mostly from the tolerances",
        count(seen as u64, "combination", "combinations"),
        if seen == 1 { "comes" } else { "come" },
        fit.combinations.len() - seen
    );
    text.push_str(&super::location::render_location_errors(&fit.location_errors));
    text.push_str(&report::geometry_to_do(&fit.location_errors));
    for suspect in fit.suspects.iter().take(5) {
        let _ = writeln!(
            text,
            "far off: {} line {}, by {:.1} standard deviations (weight {:.2})",
            suspect.recording, suspect.line, suspect.deviations, suspect.weight
        );
    }
    for warning in &fit.warnings {
        let _ = writeln!(text, "note: {warning}");
    }
    text
}
