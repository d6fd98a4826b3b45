//! One effect that was found, as data: `docs/diagnosis.md`.

use serde::{Deserialize, Serialize};

use crate::units::{ByQuantity, field_by_quantity};

field_by_quantity!(held_out_rms);

/// One effect.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Finding {
    /// Its name.
    pub effect: String,
    /// Name of its family, where that is a form of what `effect` names.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub form: Option<String>,
    /// Joint, frame or `measurement`.
    pub at: String,
    /// A sentence for a machinist.
    pub explanation: String,
    /// What is at fault, as part of a sentence; empty where its family does not say.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub cause: String,
    /// What to do about it; empty where its family does not say.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub remedy: String,
    /// Its sizes.
    pub coefficients: Vec<Size>,
    /// Probability that name and place are right, the place or one of `also_at`.
    pub probability: f64,
    /// Half of it is the logarithm of the evidence for it.
    pub delta_bic: f64,
    /// RMS on stretches that were left out.
    #[serde(flatten, with = "held_out_rms")]
    pub held_out_rms: ByQuantity<Option<HeldOutPair>>,
    /// Where it acts.
    pub r#where: Vec<Where>,
    /// What a cause that cannot be one does as well.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub placebo: Option<Meaningless>,
    /// Other places at which the same effect would do what these recordings show, just as well; not written where there are none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub also_at: Vec<AlsoAt>,
    /// What these recordings cannot tell from it.
    pub confusable_with: Vec<Confusable>,
    /// Part of the mean square that geometry leaves over that goes with it, 0 to 1, the others taken in.
    pub share: f64,
}

impl Finding {
    /// Its name, with its form where it has one: `backlash (worn_stretch)`.
    pub fn name(&self) -> String {
        self.form.as_ref().map_or_else(|| self.effect.clone(), |form| format!("{} ({form})", self.effect))
    }
}

/// A number of a finding.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Size {
    /// Its name.
    pub name: String,
    /// SI.
    pub value: f64,
    /// Its unit.
    pub unit: String,
    /// Standard uncertainty.
    pub std_error: f64,
}

/// The same family at the same place with as many numbers, and a cause that has nothing to do with it.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Meaningless {
    /// The cause, as part of a sentence: of all, the one with which most is explained.
    pub cause: String,
    /// What it explains as part of what the finding does.
    pub share: f64,
}

impl Finding {
    /// How likely it is that it is what its name says, or one of those that it may be instead.
    pub(super) fn probability_of_all(&self) -> f64 {
        self.probability + self.confusable_with.iter().map(|other| other.probability).sum::<f64>()
    }

    /// To other names goes no more than its own leaves.
    pub(super) fn share_out(&mut self) {
        let others: f64 = self.confusable_with.iter().map(|other| other.probability).sum();
        let left = (1.0 - self.probability).max(0.0);
        if others > left {
            self.confusable_with.iter_mut().for_each(|other| other.probability *= left / others);
        }
    }
}

/// Another place for the same.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct AlsoAt {
    /// Place.
    pub at: String,
    /// The motion that would tell them apart.
    pub separate_by: String,
}

/// Another name for the same.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Confusable {
    /// Name of the family.
    pub effect: String,
    /// Place.
    pub at: String,
    /// Its probability.
    pub probability: f64,
    /// The motion that would tell them apart.
    pub separate_by: String,
}

/// Held-out RMS without and with one finding.
#[non_exhaustive]
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct HeldOutPair {
    /// All others taken in.
    pub before: f64,
    /// This one too.
    pub after: f64,
}

/// A stretch of a recording.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Where {
    /// File name.
    pub recording: String,
    /// Start, s; absent without time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from_s: Option<f64>,
    /// End, s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to_s: Option<f64>,
    /// Part of what geometry leaves over.
    pub share_of_misfit: f64,
}
