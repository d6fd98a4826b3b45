//! The RON form of a machine, in the file's own units.

use std::collections::BTreeMap;
use std::fmt;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

/// Three numbers as RON writes them, `(1, 2, 3)`.
pub(crate) type Triple = (f64, f64, f64);

/// `C`: what a calibrated file adds; who reads the machine alone takes `IgnoredAny`.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(rename = "Machine", deny_unknown_fields)]
pub(crate) struct MachineForm<C> {
    pub name: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub about: Option<String>,
    pub units: UnitsForm,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gravity: Option<Triple>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<ToleranceForm>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub workpiece: Option<Vec<DyadForm>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tool: Option<Vec<DyadForm>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dh: Option<DhForm>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub side_branches: Vec<SideBranchForm>,
    #[serde(default = "nothing", skip_serializing_if = "Option::is_none")]
    pub calibration: Option<C>,
}

#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(rename = "units", deny_unknown_fields)]
pub(crate) struct UnitsForm {
    pub length: LengthUnit,
    pub angle: AngleUnit,
}

#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
#[allow(non_camel_case_types)]
pub(crate) enum LengthUnit {
    m,
    mm,
    um,
    nm,
    r#in,
}

#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
#[allow(non_camel_case_types)]
pub(crate) enum AngleUnit {
    rad,
    mrad,
    urad,
    deg,
    arcsec,
}

#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
#[serde(rename = "tolerance", deny_unknown_fields)]
pub(crate) struct ToleranceForm {
    pub translation: f64,
    pub rotation: f64,
}

#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(rename = "side_branch", deny_unknown_fields)]
pub(crate) struct SideBranchForm {
    pub on: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recorded_as: Option<String>,
    pub dyads: Vec<DyadForm>,
}

#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(rename = "dyad", deny_unknown_fields)]
pub(crate) struct DyadForm {
    pub frame: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at: Option<Triple>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotation: Option<Triple>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub moves: Option<Vec<MoveForm>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint: Option<JointForm>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mass: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub centre_of_mass: Option<Triple>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<ToleranceForm>,
}

impl DyadForm {
    /// A frame without a joint that stands where the one before it stands.
    pub(super) fn fixed(frame: impl Into<String>) -> DyadForm {
        DyadForm {
            frame: frame.into(),
            at: None,
            rotation: None,
            moves: None,
            joint: None,
            mass: None,
            centre_of_mass: None,
            tolerance: None,
        }
    }
}

/// One elementary move; a list of them, from left to right, says any initial pose: DH, modified DH, roll-pitch-yaw.
#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
pub(crate) enum MoveForm {
    Tx(f64),
    Ty(f64),
    Tz(f64),
    Rx(f64),
    Ry(f64),
    Rz(f64),
}

impl MoveForm {
    /// Its axis 0, 1, 2, by how much, and whether it turns.
    pub(super) fn parts(self) -> (usize, f64, bool) {
        match self {
            MoveForm::Tx(value) => (0, value, false),
            MoveForm::Ty(value) => (1, value, false),
            MoveForm::Tz(value) => (2, value, false),
            MoveForm::Rx(value) => (0, value, true),
            MoveForm::Ry(value) => (1, value, true),
            MoveForm::Rz(value) => (2, value, true),
        }
    }
}

/// Denavit-Hartenberg parameters in place of the list `tool`.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(rename = "dh", deny_unknown_fields)]
pub(crate) struct DhForm {
    pub convention: ConventionForm,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub base: Option<Vec<MoveForm>>,
    pub rows: Vec<DhRowForm>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tool: Option<Vec<MoveForm>>,
}

#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
#[allow(non_camel_case_types)]
pub(crate) enum ConventionForm {
    #[serde(alias = "standard")]
    classic,
    modified,
}

#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize)]
#[allow(non_camel_case_types)]
pub(crate) enum KindForm {
    #[default]
    revolute,
    prismatic,
}

#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(rename = "row", deny_unknown_fields)]
pub(crate) struct DhRowForm {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint: Option<String>,
    #[serde(default)]
    pub kind: KindForm,
    #[serde(default)]
    pub theta: f64,
    #[serde(default)]
    pub d: f64,
    pub a: f64,
    pub alpha: f64,
    #[serde(default)]
    pub beta: f64,
    #[serde(default)]
    pub offset: f64,
    #[serde(default = "plus")]
    pub sign: i8,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub travel: Option<(f64, f64)>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub follows: Option<BTreeMap<String, f64>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nc: Option<NcForm>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mass: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub centre_of_mass: Option<Triple>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<ToleranceForm>,
}

#[derive(Clone, Debug, Deserialize, Serialize)]
pub(crate) enum JointForm {
    Prismatic(JointBody),
    Revolute(JointBody),
}

#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(rename = "joint", deny_unknown_fields)]
pub(crate) struct JointBody {
    pub axis: AxisForm,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub travel: Option<(f64, f64)>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub follows: Option<BTreeMap<String, f64>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nc: Option<NcForm>,
}

#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(rename = "nc", deny_unknown_fields)]
pub(crate) struct NcForm {
    pub address: String,
    #[serde(default = "plus")]
    pub sign: i8,
}

/// `Default` of an option, without asking it of `C`.
fn nothing<C>() -> Option<C> {
    None
}

fn plus() -> i8 {
    1
}

/// An axis: a word in quotes or a vector.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum AxisForm {
    Word(String),
    Vector(Triple),
}

impl<'de> Deserialize<'de> for AxisForm {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Visitor;
        impl<'de> de::Visitor<'de> for Visitor {
            type Value = AxisForm;
            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("an axis: \"x\" or \"-z\" in quotes, or a unit vector (0, 0.6, 0.8)")
            }
            fn visit_str<E: de::Error>(self, word: &str) -> Result<AxisForm, E> {
                Ok(AxisForm::Word(word.to_string()))
            }
            fn visit_seq<A: de::SeqAccess<'de>>(self, mut seq: A) -> Result<AxisForm, A::Error> {
                let mut next = |index| {
                    seq.next_element::<f64>()?
                        .ok_or_else(|| de::Error::invalid_length(index, &"three numbers"))
                };
                let vector = (next(0)?, next(1)?, next(2)?);
                if seq.next_element::<f64>()?.is_some() {
                    return Err(de::Error::invalid_length(4, &"three numbers"));
                }
                Ok(AxisForm::Vector(vector))
            }
        }
        deserializer.deserialize_any(Visitor)
    }
}

impl Serialize for AxisForm {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            AxisForm::Word(word) => serializer.serialize_str(word),
            AxisForm::Vector(vector) => vector.serialize(serializer),
        }
    }
}
