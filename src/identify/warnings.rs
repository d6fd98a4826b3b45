//! What to be careful about in a result, in sentences.

use super::solve::Problem;
use super::{FarOff, Fit, Solver, Stop};
use crate::machine::Machine;
use crate::wording::count;

pub(super) fn warnings(problem: &Problem, fit: &Fit) -> Vec<String> {
    let (machine, sources) = (problem.machine, problem.sources);
    let mut warnings: Vec<String> = Vec::new();
    for source in &sources.all {
        for warning in &source.summary.warnings {
            warnings.push(format!("{}: {warning}", source.label));
        }
    }
    if clocks_overlap(problem) {
        warnings.push(
            "recordings overlap in time: `t` must run on one clock for all of them before drift or slips can be told".into(),
        );
    }
    // (22)
    let needed = fit.rank.max(1) as u64;
    if fit.readings < 5 * needed {
        warnings.push(format!(
            "{} for {}: fewer than five each; record more poses, or the figures flatter themselves",
            count(fit.readings, "reading", "readings"),
            count(needed, "identifiable parameter", "identifiable parameters")
        ));
    }
    if fit.rank < fit.rank_in_general {
        warnings.push(format!(
            "these recordings see {} of the unknowns; the same instrument on general poses would see {}{}",
            count(fit.rank as u64, "combination", "combinations"),
            fit.rank_in_general,
            still(machine, problem)
        ));
    }
    if fit.combinations.iter().all(|c| c.share < 1e-6) {
        warnings.push(
            "no constant deviation of the machine shows in these recordings; only what belongs to the set-up was found"
                .into(),
        );
    }
    for open in &fit.open {
        warnings.push(format!("not seen by the recordings, left as declared: {open}"));
    }
    // A tolerance that the data contradict pulls at everything else.
    for FarOff { frame, tolerances } in fit.far_off() {
        warnings.push(format!(
            "frame {frame} lies {tolerances:.0} tolerances from where the machine file has it: check its declaration, or state a larger tolerance there"
        ));
    }
    // Recordings of one kind share their noise, and often the figure: one sentence for all of them.
    let mut above: Vec<(String, Vec<&str>)> = Vec::new();
    for recording in &fit.recordings {
        let Some(birge) = recording.birge.filter(|b| *b > 2.0) else { continue };
        let figure = format!("{birge:.1}");
        match above.iter_mut().find(|(known, _)| *known == figure) {
            Some((_, names)) => names.push(&recording.name),
            None => above.push((figure, vec![&recording.name])),
        }
    }
    for (figure, names) in above {
        warnings.push(format!(
            "{}: residuals are {figure} times the stated sigma: something besides constant geometry is at work",
            names.join(", ")
        ));
    }
    let samples = |n: u64| count(n, "sample", "samples");
    if fit.outliers > 0 {
        let lies = if fit.outliers == 1 { "lies" } else { "lie" };
        warnings.push(format!("{} {lies} further off than noise explains", samples(fit.outliers)));
    }
    if fit.down_weighted > 0 {
        let counts = if fit.down_weighted == 1 { "counts" } else { "count" };
        warnings.push(format!("{} {counts} less than half for lying far off", samples(fit.down_weighted)));
    }
    if fit.stop == Stop::Steps && !matches!(fit.solver, Solver::FixedDamping { .. }) {
        warnings.push("the number of steps was used up before the fit settled".into());
    }
    warnings
}

/// Whether two recordings claim the same time.
fn clocks_overlap(problem: &Problem) -> bool {
    let mut spans: Vec<(f64, f64)> = problem.sources.all.iter().filter_map(|s| s.summary.time).collect();
    spans.sort_by(|a, b| a.0.total_cmp(&b.0));
    spans.windows(2).any(|pair| pair[1].0 < pair[0].1)
}

/// Which joints stand still, as the end of a sentence.
fn still(machine: &Machine, problem: &Problem) -> String {
    let still: Vec<&str> = (0..machine.commands().len())
        .filter(|c| problem.sources.all.iter().all(|s| !s.summary.moving[*c]))
        .map(|c| machine.commands()[c].as_str())
        .collect();
    if still.is_empty() {
        "; vary the joints independently of each other".into()
    } else {
        format!("; these joints never move: {}", still.join(", "))
    }
}
