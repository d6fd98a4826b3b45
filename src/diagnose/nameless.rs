//! What was found and has no name, as data: `docs/diagnosis.md`.

use serde::{Deserialize, Serialize};

use super::finding::{HeldOutPair, Where};
use crate::units::{ByQuantity, field_by_quantity};

field_by_quantity!(rms, held_out_rms, free_held_out_rms);

/// The place that stands for the instrument.
pub(super) const MEASUREMENT: &str = "measurement";

/// Structure that no family explains.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Unexplained {
    /// How large it is, m (rad where only angles are measured).
    pub rms_m: f64,
    /// The place that it fits best.
    pub at: String,
    /// Another joint whose position it goes with, where one does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub goes_with: Option<String>,
    /// Recordings and times of it.
    pub r#where: Vec<Where>,
    /// Stretches of travel in which it gathers, the most telling first; none where it is everywhere alike.
    pub gathers: Vec<Gathering>,
    /// Parts of it that are known by place and by what they depend on, the largest first; the model has those that foretell stretches left out.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parts: Vec<UnnamedPart>,
    /// In a sentence.
    pub explanation: String,
}

impl Unexplained {
    /// With its parts, each with the rank of its place, in any order. What a joint or frame foretells is not the instrument's: the place of
    /// which most is there then says where it is.
    pub(super) fn take(&mut self, mut parts: Vec<(Option<usize>, UnnamedPart)>) {
        let size = |part: &UnnamedPart| part.rms.m.or(part.rms.rad).unwrap_or(0.0);
        parts.sort_by(|(of_a, a), (of_b, b)| of_a.cmp(of_b).then(size(b).total_cmp(&size(a))));
        let parts: Vec<UnnamedPart> = parts.into_iter().map(|(_, part)| part).collect();
        if let Some(first) = parts.first().filter(|first| first.modelled && self.at == MEASUREMENT) {
            self.explanation = self.explanation.replacen(
                &format!("it fits best at {MEASUREMENT}"),
                &format!("what is foretold of it is at {} for the most part", first.at),
                1,
            );
            (self.at, self.goes_with) = (first.at.clone(), None);
        }
        self.parts = parts;
    }
}

/// A stretch of a joint's travel that holds more of the misfit than of the samples.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Gathering {
    /// Name of the joint.
    pub joint: String,
    /// Where the stretch begins, m or rad.
    pub from: f64,
    /// Where it ends, m or rad.
    pub to: f64,
    /// `m` or `rad`.
    pub unit: String,
    /// Direction of travel, -1 or 1, where it is mostly one of them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction: Option<i8>,
    /// Part of the misfit, 0 to 1.
    pub share_of_misfit: f64,
    /// Part of the samples, 0 to 1.
    pub share_of_samples: f64,
}

/// A part of what no family explains.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct UnnamedPart {
    /// Joint, frame or `measurement`.
    pub at: String,
    /// What it depends on: `position of c`, `direction of c`, `time`.
    pub depends_on: Vec<String>,
    /// What it makes of the readings beyond what geometry and all else would take of it.
    #[serde(flatten, with = "rms")]
    pub rms: ByQuantity<Option<f64>>,
    /// RMS on stretches that were left out, the other parts taken in.
    #[serde(flatten, with = "held_out_rms")]
    pub held_out_rms: ByQuantity<Option<HeldOutPair>>,
    /// Whether the model has it.
    pub modelled: bool,
    /// Names that come into question for what is at its place, the likeliest first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub names: Vec<LikelyName>,
}

/// A name beside a part that has none.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct LikelyName {
    /// Name of a family.
    pub effect: String,
    /// Its probability, against all other names for what the same joints drive at the part's place, and none.
    pub probability: f64,
}

/// A family that is in no book yet.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Proposal {
    /// Name of the family.
    pub name: String,
    /// Joint where it was found.
    pub at: String,
    /// The other joint that it depends on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub partner: Option<String>,
    /// What it is a sum of, as formulas, each times a number of its own.
    pub law: Vec<String>,
    /// Whether it is the free function itself, because nothing shorter foretells as much.
    pub free: bool,
    /// RMS on stretches that were left out, without it and with it, all else taken in.
    #[serde(flatten, with = "held_out_rms")]
    pub held_out_rms: ByQuantity<Option<HeldOutPair>>,
    /// The same without and with the free function.
    #[serde(flatten, with = "free_held_out_rms")]
    pub free_held_out_rms: ByQuantity<Option<HeldOutPair>>,
    /// The family, as it stands in a file of effects.
    pub ron: String,
}

/// A file of effects with these families.
pub(super) fn library_text(families: &str) -> String {
    let heading = "// Proposed by kincal diagnose: in no book. Give them names, and hold them against other recordings by --effects.";
    format!("{heading}\nEffects(families: [\n{families}])\n")
}
