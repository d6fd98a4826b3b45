//! What a diagnosis says, as data: `docs/diagnosis.md`.

use serde::{Deserialize, Serialize};

use super::finding::Finding;
use super::nameless::{Proposal, Unexplained, library_text};
use super::not_tried::NotTried;
use super::pictures::Traces;
use super::rms::LeftOut;
use super::side_branches::UnseenSideBranch;
use crate::effects::StoredEffect;
use crate::identify::{Approach, BeforeAfter, FarOff};
use crate::location::LocationErrors;
use crate::units::{ByQuantity, field_by_quantity};

field_by_quantity!(noise_floor, rms, held_out_rms, rms_without_outliers, largest);

/// Everything that a diagnosis has to say. Numbers in SI; `docs/commands.md` lists the fields.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Diagnosis {
    /// Name of the machine.
    pub machine: String,
    /// File names.
    pub recordings: Vec<String>,
    /// Samples of the recordings.
    pub samples: u64,
    /// Which of them causes were looked for in, and everything here is told of, where that was not all of them. The model is fitted to all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub thinned: Option<Thinned>,
    /// Standard deviation of the noise.
    #[serde(flatten, with = "noise_floor")]
    pub noise_floor: ByQuantity<Option<f64>>,
    /// RMS under three models.
    #[serde(flatten, with = "rms")]
    pub rms: ByQuantity<Option<RmsByModel>>,
    /// Combinations of constant deviations that come mostly from the data: so many numbers geometry has.
    #[serde(default)]
    pub geometry_numbers: u64,
    /// RMS over stretches that were left out of the fit.
    #[serde(flatten, with = "held_out_rms")]
    pub held_out_rms: ByQuantity<Option<HeldOutRms>>,
    /// Each set-up left out of the fit in turn, where there are several.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub set_ups_left_out: Vec<SetUpLeftOut>,
    /// What was found, strongest evidence first.
    pub findings: Vec<Finding>,
    /// Joints that have an effect without a finding: what is found at another joint and comes anew with every set-up, or what every joint has
    /// more or less; the model has them.
    #[serde(default, rename = "companions", skip_serializing_if = "Vec::is_empty")]
    pub shared: Vec<SharedEffect>,
    /// Joints that stand still all through a recording, and have an effect that depends on how they came there.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub stand_still: Vec<StandsStill>,
    /// Sides from which joints came before they first moved, where they are others than the recordings show.
    #[serde(skip)]
    pub(super) approaches: Vec<Approach>,
    /// What no family explains.
    pub unexplained: Option<Unexplained>,
    /// Families for that, where they were asked for.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub proposals: Vec<Proposal>,
    /// Part of the structure left over by geometry that is no family's shape, 0 to 1, where something was found.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shape_share: Option<f64>,
    /// What the calibrated file is made of: the effects of `findings` and `shared`, ready to be fitted on the real model.
    #[serde(skip)]
    pub(super) named: Vec<Named>,
    /// What its model leaves of stretches that took no part in its fit.
    #[serde(skip)]
    pub(super) left_out: LeftOut,
    /// Effects that could not be looked for in these recordings.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub not_tried: Vec<NotTried>,
    /// What hangs on the machine beside its chain, and no recording says how it stood.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub unseen_side_branches: Vec<UnseenSideBranch>,
    /// Frames that lie far from where the machine file has them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub far_off: Vec<FarOff>,
    /// Rows left out because a number was missing.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub dropped: u64,
    /// Samples that were left out because they lie far off.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub outliers: Vec<Outliers>,
    /// RMS without them.
    #[serde(flatten, with = "rms_without_outliers")]
    pub rms_without_outliers: ByQuantity<Option<WithoutOutliers>>,
    /// What its pictures show.
    #[serde(skip)]
    pub traces: Traces,
    /// The geometry as ISO 230-1 location errors.
    #[serde(skip)]
    pub location_errors: LocationErrors,
}

/// Every so manieth sample of large recordings.
#[non_exhaustive]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Thinned {
    /// Every so manieth.
    pub every: u64,
    /// How many these are.
    pub samples: u64,
}

impl Diagnosis {
    /// Whether the model has anything beside constant geometry: what was found, what joints have besides, or parts of what has no name.
    pub fn has_more_than_geometry(&self) -> bool {
        let parts = self.unexplained.iter().flat_map(|unexplained| &unexplained.parts);
        !self.findings.is_empty() || !self.shared.is_empty() || parts.into_iter().any(|part| part.modelled)
    }

    /// Whether its model foretells left-out stretches better than that of another one.
    pub(super) fn foretells_more(&self, other: &Diagnosis) -> bool {
        let left = |diagnosis: &Diagnosis| -> f64 {
            diagnosis.held_out_rms.there().map(|(_, rms)| rms.r#final.ln()).sum()
        };
        left(self) < left(other)
    }

    /// The text of a file of effects with all families that are proposed, for
    /// [`Library::with_file`](crate::effects::Library::with_file); `None` where there are none.
    pub fn proposed_library(&self) -> Option<String> {
        let families: String = self.proposals.iter().map(|proposal| proposal.ron.as_str()).collect();
        (!families.is_empty()).then(|| library_text(&families))
    }
}

/// An effect that was found, as it is put into the model.
#[derive(Clone, Debug)]
pub(super) struct Named {
    pub effect: StoredEffect,
    /// Standard deviation of the prior of each of its terms, in the coefficient's unit.
    pub scales: Vec<f64>,
}

/// RMS under three models.
#[non_exhaustive]
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct RmsByModel {
    /// The machine as declared.
    pub nominal: f64,
    /// With constant deviations.
    pub geometric: f64,
    /// With what was found besides.
    pub r#final: f64,
}

impl RmsByModel {
    pub(super) fn of(fit: Option<BeforeAfter>, last: Option<f64>) -> Option<Self> {
        let (fit, last) = (fit?, last?);
        Some(RmsByModel { nominal: fit.nominal, geometric: fit.geometric, r#final: last })
    }
}

/// Held-out RMS under two models.
#[non_exhaustive]
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct HeldOutRms {
    /// With constant deviations.
    pub geometric: f64,
    /// With what was found besides.
    pub r#final: f64,
}

fn is_zero(count: &u64) -> bool {
    *count == 0
}

/// Samples of one recording that lie far off their surroundings whatever is taken away.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Outliers {
    /// File name.
    pub recording: String,
    /// Their lines in the file.
    pub lines: Vec<u64>,
    /// The largest departure.
    #[serde(flatten, with = "largest")]
    pub largest: ByQuantity<Option<f64>>,
}

/// RMS of all samples but outliers.
#[non_exhaustive]
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct WithoutOutliers {
    /// With constant deviations.
    pub geometric: f64,
    /// With what was found besides.
    pub r#final: f64,
}

/// A joint that stands still all through a recording.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StandsStill {
    /// File name.
    pub recording: String,
    /// Name of the joint.
    pub at: String,
    /// The side from which it came there, as the readings say: 1 rising, -1 falling.
    pub direction: i8,
    /// What would say so in the recording itself; `None` where the joint follows several commands.
    #[serde(flatten)]
    pub said_by: Option<SaidBy>,
}

/// A column that says from which side a joint came.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SaidBy {
    /// Its heading, `<command>_direction[1]`.
    pub column: String,
    /// Its value in every row, 1 or -1.
    pub value: i8,
}

/// What is left of one set-up when all others say what the machine is like.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SetUpLeftOut {
    /// Its name.
    pub setup: String,
    /// How many samples it has.
    pub samples: u64,
    /// RMS of its samples.
    #[serde(flatten, with = "rms")]
    pub rms: ByQuantity<Option<LeftOutRms>>,
}

/// RMS of a set-up left out under three models.
#[non_exhaustive]
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct LeftOutRms {
    /// With constant deviations.
    pub geometric: f64,
    /// With what was found besides.
    pub r#final: f64,
    /// With as many numbers that multiply meaningless causes, where there is such a thing for an effect.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub placebo: Option<f64>,
}

/// A joint that has an effect, so little that it is no finding; the model has it.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SharedEffect {
    /// Name of the effect.
    pub effect: String,
    /// Name of the place.
    pub at: String,
    /// Whether it comes anew with every set-up; else every joint has it more or less.
    pub of_set_up: bool,
}
