//! `kincal calibrate`

use std::fmt::Write;
use std::path::PathBuf;

use clap::ValueEnum;
use kincal::identify::{Fit, Loss, Options, Rms, Solver, calibrate_with_progress};
use kincal::recording::Recording;
use kincal::{CalibratedMachine, Error, Machine};

use super::Common;
use super::output::{Outcome, angle, length, write_whole};

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
    machine: PathBuf,
    /// Recordings
    #[arg(required = true)]
    recordings: Vec<PathBuf>,
    /// Where to write the calibrated machine
    #[arg(short, long, value_name = "CALIBRATED.ron")]
    output: Option<PathBuf>,
    /// How to walk to the optimum
    #[arg(long, value_enum, default_value = "lm")]
    solver: SolverWord,
    /// Damping of fixed-damping, relative to the largest diagonal element
    #[arg(long, default_value_t = 1e-3)]
    tau: f64,
    /// Steps of fixed-damping
    #[arg(long, default_value_t = 30)]
    steps: usize,
    /// Relative singular value below which rank-truncation takes a direction as not seen
    #[arg(long, default_value_t = 1e-3)]
    cut: f64,
    /// How residuals count
    #[arg(long, value_enum, default_value = "huber")]
    loss: LossWord,
    /// Tuning constant of the loss, standard deviations
    #[arg(long)]
    tuning: Option<f64>,
    /// Do not hold deviations near zero by the tolerances of the machine file
    #[arg(long)]
    no_prior: bool,
    /// List every component of every deviation, not only those that the data determine
    #[arg(long)]
    all: bool,
    #[command(flatten)]
    common: Common,
}

impl Args {
    fn options(&self) -> Options {
        Options {
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

pub(crate) fn run(args: &Args) -> Outcome {
    let machine = Machine::open(&args.machine)?;
    let recordings: Vec<Recording> =
        args.recordings.iter().map(|path| Recording::open(path, &machine)).collect::<Result<_, _>>()?;
    let spinner = args.common.spinner();
    let progress = |text: &str| {
        if let Some(spinner) = &spinner {
            spinner.set_message(text.to_string());
        }
    };
    let found = calibrate_with_progress(&machine, &recordings, args.options(), &progress);
    if let Some(spinner) = spinner {
        spinner.finish_and_clear();
    }
    let (calibrated, fit) = found?;
    let mut text = render(&fit, args.all);
    if let Some(path) = &args.output {
        write_machine(path, &calibrated)?;
        let _ = writeln!(text, "\nwritten to {}", path.display());
    }
    args.common.say(&text);
    args.common.write_json(&fit)
}

/// Writes a calibrated machine whole or not at all.
pub(crate) fn write_machine(path: &std::path::Path, calibrated: &CalibratedMachine) -> kincal::Result<()> {
    let failed = |source| Error::File { path: path.to_path_buf(), source };
    write_whole(path, |out| out.write_all(calibrated.to_ron().as_bytes()).map_err(failed))
}

fn rms(rms: &Rms) -> String {
    let parts: Vec<String> = rms.m.map(length).into_iter().chain(rms.rad.map(angle)).collect();
    parts.join(", ")
}

/// The result as people read it.
pub(crate) fn render(fit: &Fit, all: bool) -> String {
    let mut text = format!("{}: {} samples in {} recordings", fit.machine, fit.samples, fit.recordings.len());
    if fit.dropped > 0 {
        let _ = write!(text, ", {} rows left out as drop-outs", fit.dropped);
    }
    text.push_str("\n\nRMS of the residuals\n");
    let _ = writeln!(
        text,
        "  {:<28}{:<14}{:>8}  {:>20}  {:>20}",
        "recording", "measurement", "samples", "as declared", "calibrated"
    );
    for r in &fit.recordings {
        let _ = writeln!(
            text,
            "  {:<28}{:<14}{:>8}  {:>20}  {:>20}",
            r.name,
            r.measurement,
            r.samples,
            rms(&r.nominal),
            rms(&r.geometric)
        );
    }
    for (pair, show) in [(fit.rms_m, length as fn(f64) -> String), (fit.rms_rad, angle)] {
        if let Some(pair) = pair {
            let _ =
                writeln!(text, "  {:<50}  {:>20}  {:>20}", "all", show(pair.nominal), show(pair.geometric));
        }
    }
    let _ = writeln!(
        text,
        "\n{} of {} combinations of the unknowns are seen; {} steps, {}",
        fit.rank, fit.unknowns, fit.steps, fit.stop
    );
    let shown: Vec<_> = fit.parameters.iter().filter(|p| all || p.share > 0.5).collect();
    if !shown.is_empty() {
        let heading = if all { "deviations" } else { "deviations that come mostly from the data" };
        let _ = writeln!(text, "\n{heading} (value ± standard error, share of the data)");
    }
    for p in shown {
        let name = if p.setup.is_empty() { p.frame.clone() } else { format!("{}[{}]", p.frame, p.setup) };
        let show = if p.component.starts_with('v') { length } else { angle };
        let _ = writeln!(
            text,
            "  {name:<16} {}  {:>14} ± {:<12} {:>4.0} %",
            p.component,
            show(p.value),
            show(p.std_error),
            100.0 * p.share
        );
    }
    let seen = fit.combinations.iter().filter(|c| c.share > 0.5).count();
    let _ = writeln!(
        text,
        "\n{seen} combinations of deviations come mostly from the data, {} mostly from the tolerances",
        fit.combinations.len() - seen
    );
    text.push_str(&super::location::render_location_errors(&fit.location_errors));
    for suspect in fit.suspects.iter().take(5) {
        let _ = writeln!(
            text,
            "down-weighted: {} line {}, off by {:.1} standard deviations (weight {:.2})",
            suspect.recording, suspect.line, suspect.deviations, suspect.weight
        );
    }
    for warning in &fit.warnings {
        let _ = writeln!(text, "note: {warning}");
    }
    text
}
