//! Rules that decide beside the evidence.
//!
//! What each is worth is measured by leaving it out, `examples/blind --ablate`, `docs/benchmarks.md`; one without which no case is worse goes.

/// A rule that decides where evidence alone would decide otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rule {
    // ---- Which hypothesis comes first ----
    /// What remembers is looked at together with what it was before anybody looked (`reach.rs`).
    Remembers,
    /// Names that come near the best may depart from their families' shapes (`compare.rs`).
    MayDepart,
    /// Of names that come near the best, a rare one gives way (`compare.rs`).
    RareGivesWay,
    /// A name is as likely as all its forms together (`compare.rs`).
    FormsTogether,
    /// A shape of its own lends a name no more than a part of what it takes (`reach.rs`).
    OwnShapeIsLimited,
    /// Play of unusual size gives way to a usual lag where there is one speed (`speeds.rs`).
    UsualSizeFirst,

    // ---- What is taken in ----
    /// What is little beside one of its name at its place is the shape of that (`shares.rs`).
    Repeats,
    /// So is another function along the travel where a curve was found (`shares.rs`).
    RepeatsCurve,
    /// What is less than the shapes of others may be off by is no effect of its own (`steps.rs`).
    LessThanShapes,
    /// But a wave of whole orders has no such shape (`shares.rs`).
    OrdersHaveNoShape,
    /// And a train of waves along the travel has a larger one (`shares.rs`).
    TrainsSwell,
    /// Of two courses over time the smaller one is the other one's shape (`shares.rs`).
    OneCourse,
    /// What takes little of what is left is a poor name for it (`steps.rs`).
    TakesLittle,
    /// What was taken for a shape is an effect if it is most of that (`steps.rs`).
    MostOfShapes,
    /// Where shapes are too much, the next effect is looked for among them (`steps.rs`).
    ShapesFirst,
    /// Where they are much, after all else (`steps.rs`).
    ShapesLast,
    /// Beside shapes that are too much, effects are judged beside names alone (`search.rs`).
    BesideNames,
    /// The search ends where names make stretches worse that were left out (`steps.rs`).
    NoneDoesHarm,
    /// A line and waves in the place of a curve (`unfold.rs`).
    Unfolds,
    /// Where much is left the search runs again against that (`rounds.rs`).
    SearchesAgain,
    /// Settled positions are asked again which of them are off (`rounds.rs`).
    OutliersAgain,
    /// What is off at every reversal is no outlier (`noise.rs`).
    SparesReversals,
    /// Of settled positions a likelier set takes the place of what was found one by one (`sets.rs`).
    WeighsSets,
    /// The other story: an axis that is late (`lag.rs`).
    MayBeLate,

    // ---- What is told ----
    /// What foretells left-out stretches worse goes (`folds.rs`).
    HasToForetell,
    /// Of settled positions effects that have each proved themselves are told alone where they foretell more (`rounds.rs`).
    ProvedAlone,
    /// Many functions of position at one joint are patches of a curve (`doubt.rs`).
    Patches,
    /// Names that leave much are no explanation (`doubt.rs`).
    LeavesMuch,
    /// So many slips are none (`doubt.rs`).
    FewEvents,
    /// Names whose shapes depart far along a path are wrong (`doubt.rs`).
    Unlike,
    /// One place says more than several names (`doubt.rs`).
    Outbid,
    /// A series says that something is left where names say nothing (`doubt.rs`).
    Standing,
    /// A meaningless cause that does better outdoes a name (`told.rs`).
    Outdone,
    /// A law that is as good as a simpler one has its name (`contained.rs`).
    SaysNoMore,
    /// Odds may shift by shapes that nobody knows (`odds.rs`).
    OddsMayShift,

    // ---- What has no name ----
    /// Parts that foretell better outdo names that leave much (`report.rs`).
    PartsOutdoNames,
    /// Beside parts, a name that does harm goes (`report.rs`).
    NoneDoesHarmBesideParts,
    /// Parts that leave more than half are not modelled (`report.rs`).
    LeavesHalf,
    /// A long memory is asked a second time (`report.rs`).
    ShorterMemory,
    /// By more than twice the largest departure nothing departs (`names.rs`).
    FarFromFamily,
    /// The first group without a name ends the naming (`names.rs`).
    LargestFirst,
}

impl Rule {
    /// Whether it decides, where it would: always, unless it is being left out.
    pub(super) fn decides(self) -> bool {
        #[cfg(feature = "measure")]
        return ablation::decides(self);
        #[cfg(not(feature = "measure"))]
        true
    }
}

/// Leaving rules out, to measure them.
#[cfg(feature = "measure")]
mod ablation {
    use std::sync::{Mutex, OnceLock, PoisonError};

    use super::Rule;

    /// Whether a rule decides: its name is not in `KINCAL_ABLATE`. Tells on standard error, once, that it was asked.
    pub fn decides(rule: Rule) -> bool {
        static LEFT_OUT: OnceLock<Option<String>> = OnceLock::new();
        static ASKED: Mutex<Vec<Rule>> = Mutex::new(Vec::new());
        let Some(left_out) = LEFT_OUT.get_or_init(|| std::env::var("KINCAL_ABLATE").ok()) else {
            return true;
        };
        let name = format!("{rule:?}");
        let mut asked = ASKED.lock().unwrap_or_else(PoisonError::into_inner);
        if !asked.contains(&rule) {
            asked.push(rule);
            eprintln!("rule {name}");
        }
        !left_out.split(',').any(|other| other == name)
    }
}
