//! Diagnosis: where a calibrated model and real recordings differ, what physics was left out, and the model with it, `docs/diagnosis.md`.
//!
//! Constant geometry is fitted first and marginalised out of everything that follows, so that nothing is blamed on physics that
//! geometry explains. Every family of the library at every place competes by the evidence for it; what is found is put into the
//! model and judged on stretches that were left out. Where structure is left that no family explains, it says so.

mod approaches;
mod beside;
mod blocks;
mod cell_sums;
mod cells;
mod coarse;
mod compare;
mod contained;
mod course;
mod curves;
mod diagnosis;
mod discrepancy;
mod doubt;
mod drives;
mod enter;
mod equations;
mod evidence;
mod features;
mod finding;
mod folds;
mod held_out;
mod history;
mod lag;
mod leftover;
mod linear;
mod marginal;
mod model;
mod nameless;
mod names;
mod noise;
mod not_tried;
mod odds;
mod orders;
mod outbid;
mod outliers;
mod panel;
mod parts;
mod passing;
mod past;
mod pictures;
mod placebo;
mod policy;
mod polish;
mod propose;
mod reach;
mod refine;
mod relinearised;
mod report;
mod rms;
mod rounds;
mod score;
mod search;
mod series;
mod set_ups;
mod sets;
mod shared;
mod shares;
mod side_branches;
mod spectrum;
mod speeds;
mod steps;
mod stretch;
mod sums;
mod terms;
mod told;
mod traces;
mod unexplained;
mod unfold;
mod waves;
mod whereabouts;
mod whitener;

inner! {
    use pictures::{Along, Curve, CurvePoint, Trace, Traces};
}
pub use diagnosis::{
    Diagnosis, HeldOutRms, LeftOutRms, Outliers, RmsByModel, SaidBy, SetUpLeftOut, SharedEffect, StandsStill,
    Thinned, WithoutOutliers,
};
pub use finding::{AlsoAt, Confusable, Finding, HeldOutPair, Meaningless, Size, Where};
pub use nameless::{Gathering, LikelyName, Proposal, Unexplained, UnnamedPart};
pub use not_tried::NotTried;
pub use side_branches::UnseenSideBranch;

use crate::effects::{Library, RecordingFacts};
use crate::error::Result;
use crate::feature::as_seen_in;
use crate::identify::CalibrateOptions;
use crate::machine::Machine;
use crate::recording::Recording;
use not_tried::not_tried;
use rounds::{Case, Said};
use side_branches::unseen;

/// What a diagnosis is asked.
#[non_exhaustive]
#[derive(Clone, Debug, Default)]
pub struct DiagnoseOptions {
    /// How the constant geometry is identified.
    pub options: CalibrateOptions,
    /// Whether families are proposed for what has no name, [`Diagnosis::proposals`].
    pub propose: bool,
}

impl DiagnoseOptions {
    /// The same with another way to identify the constant geometry.
    #[must_use]
    pub fn with_options(mut self, options: CalibrateOptions) -> Self {
        self.options = options;
        self
    }

    /// The same with families proposed for what has no name.
    #[must_use]
    pub fn with_proposals(mut self) -> Self {
        self.propose = true;
        self
    }
}

/// Diagnoses what constant geometry leaves over in these recordings.
///
/// # Errors
/// As [`crate::identify::calibrate`].
pub fn diagnose(
    machine: &Machine,
    recordings: &[Recording],
    library: &Library,
    request: &DiagnoseOptions,
    progress: &dyn Fn(&str),
) -> Result<Diagnosis> {
    // Threads tell what they do; the one that asked hears of it.
    let (tell, told) = std::sync::mpsc::channel::<String>();
    // Nobody listens any more only where the other side has panicked.
    let search =
        move || search_all(machine, recordings, library, request, &move |text| drop(tell.send(text.into())));
    let listen = || told.iter().for_each(|text| progress(&text));
    // Among the threads that share the work: from outside, each piece of it would be handed over and waited for. One of them cannot listen
    // meanwhile.
    if rayon::current_thread_index().is_none() {
        let mut said = None;
        rayon::in_place_scope(|scope| {
            scope.spawn(|_| said = Some(search()));
            listen();
        });
        return said.expect("the scope waits for it");
    }
    std::thread::scope(|scope| {
        let search = scope.spawn(search);
        listen();
        search.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })
}

/// The same, told of by any thread.
fn search_all(
    machine: &Machine,
    recordings: &[Recording],
    library: &Library,
    request: &DiagnoseOptions,
    progress: &search::Tell,
) -> Result<Diagnosis> {
    let (whole, machine) = (machine, &as_seen_in(machine, recordings));
    let facts = RecordingFacts::of(machine, recordings)?;
    let candidates = library.candidates(machine, &facts);
    let (options, propose) = (request.options, request.propose);
    let case = Case { machine, recordings, library, facts: &facts, options, propose, progress };
    let Said { mut diagnosis, may_be_late } = case.told(&candidates.all)?;
    if let Some(joint) = may_be_late {
        progress("looking at it as at an axis that is late");
        let other = case.told(&lag::but_late(&candidates.all, joint))?.diagnosis;
        if lag::foretells_better(&other, &diagnosis) {
            diagnosis = other;
        }
    }
    diagnosis.not_tried = not_tried(&candidates);
    diagnosis.unseen_side_branches = unseen(whole, machine);
    Ok(diagnosis)
}
