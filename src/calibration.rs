//! The calibrated machine: a machine file with the deviations that recordings have shown.
//!
//! A calibrated file is a machine file with one more field, `calibration`; whatever reads a machine reads it too.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::chain::Chain;
use crate::document::Document;
use crate::effects::StoredEffect;
use crate::error::Result;
use crate::error_motion::{self, MotionForm};
use crate::lie::{Mat3, Pose, Twist, Vec3};
use crate::machine::{
    Checked, JointKind, Machine, MachineFault, MachineForm, OF_CALIBRATION, Placement, Triple, at_path,
    in_unit, number, to_text, vec_to_si,
};
use crate::units::Unit;

use crate::units::Rms;
use crate::variation::Variation;
use pieces::{AxisForm, PiecesForm};

mod named;
mod pieces;
mod seen;

pub use named::LeftOut;
pub(crate) use named::terms;

/// The field `calibration` of a machine file, in the file's units.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(rename = "calibration", deny_unknown_fields)]
pub(crate) struct CalibrationForm {
    #[serde(default)]
    samples: u64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    rms_length: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    rms_angle: Option<f64>,
    deviations: Vec<DeviationForm>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    setups: Vec<PlaceForm>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    tool_points: Vec<PointForm>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    tool_rotations: Vec<RotationForm>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    zeros: Vec<ZeroForm>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    lengths: Vec<LengthForm>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    seen: Vec<SeenForm>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pieces: Option<PiecesForm>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    dead_bands: Vec<AxisForm>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    clock: Option<(f64, f64)>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    effects: Vec<StoredEffect>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    error_motions: Vec<MotionForm>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    unseen: Option<Vec<Vec<DeviationForm>>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    unseen_at_all: Option<Vec<Vec<DeviationForm>>>,
}

#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(rename = "deviation", deny_unknown_fields)]
pub(crate) struct DeviationForm {
    pub frame: String,
    pub v: Triple,
    pub w: Triple,
}

#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(rename = "setup", deny_unknown_fields)]
struct PlaceForm {
    name: String,
    at: Triple,
    rotation: Triple,
}

#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(rename = "tool_point", deny_unknown_fields)]
struct PointForm {
    name: String,
    at: Triple,
}

#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(rename = "tool_rotation", deny_unknown_fields)]
struct RotationForm {
    name: String,
    rotation: Triple,
}

#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(rename = "zero", deny_unknown_fields)]
struct ZeroForm {
    setup: String,
    of: String,
    value: f64,
}

#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(rename = "length", deny_unknown_fields)]
struct LengthForm {
    setup: String,
    value: f64,
}

#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(rename = "seen", deny_unknown_fields)]
struct SeenForm {
    joint: String,
    from: f64,
    to: f64,
}

/// A machine together with what is known of its deviations. A machine that was never calibrated has none.
#[derive(Clone, Debug, PartialEq)]
pub struct CalibratedMachine {
    machine: Machine,
    deviations: Vec<Twist<f64>>,
    /// Frame `w` in the frame before it, by set-up.
    pub(crate) setups: Vec<(String, Pose<f64>)>,
    pub(crate) tool_points: Vec<(String, Vec3<f64>)>,
    /// Of targets in frame `t`.
    pub(crate) tool_rotations: Vec<(String, Mat3<f64>)>,
    /// Set-up, channel, value.
    pub(crate) zeros: Vec<(String, String, f64)>,
    pub(crate) lengths: Vec<(String, f64)>,
    seen: Vec<Option<(f64, f64)>>,
    /// Patterns of deviations that may be there as well.
    pub(crate) unseen: Option<Vec<Vec<Twist<f64>>>>,
    /// Those that no recording sees at all, where `unseen` does not tell them by their length.
    pub(crate) unseen_at_all: Option<Vec<Vec<Twist<f64>>>>,
    samples: u64,
    rms: Rms,
    variation: Variation,
    /// Effects whose terms stand in `variation`, in their order.
    effects: Vec<StoredEffect>,
    /// First and last time of the recordings on their clock, s.
    clock: Option<(f64, f64)>,
}

impl CalibratedMachine {
    /// A machine without any known deviation.
    pub fn nominal(machine: Machine) -> Self {
        let (dyads, commands) = (machine.dyads().len(), machine.commands().len());
        CalibratedMachine {
            machine,
            deviations: vec![Twist::zero(0.0); dyads],
            setups: Vec::new(),
            tool_points: Vec::new(),
            tool_rotations: Vec::new(),
            zeros: Vec::new(),
            lengths: Vec::new(),
            seen: vec![None; commands],
            unseen: None,
            unseen_at_all: None,
            samples: 0,
            rms: Rms::default(),
            variation: Variation::default(),
            effects: Vec::new(),
            clock: None,
        }
    }

    /// The machine with deviations that also depend on directions of travel or on features.
    pub(crate) fn with_variation(mut self, variation: Variation) -> Self {
        self.variation = variation;
        self
    }

    /// What the deviations depend on besides being constant.
    pub fn variation(&self) -> &Variation {
        &self.variation
    }

    /// The machine with these deviations, one per dyad in machine order, m and rad.
    ///
    /// # Panics
    /// If there is not one deviation per dyad.
    #[must_use]
    pub fn with_deviations(mut self, deviations: Vec<Twist<f64>>) -> Self {
        assert_eq!(deviations.len(), self.machine.dyads().len(), "one deviation per dyad");
        self.deviations = deviations;
        self
    }

    /// The machine as declared.
    pub fn machine(&self) -> &Machine {
        &self.machine
    }

    /// Deviations in machine order, each in its own frame, m and rad. That of `w` is the mean over set-ups with a known frame.
    pub fn deviations(&self) -> &[Twist<f64>] {
        &self.deviations
    }

    /// The calibrated chain, frame `w` as the machine file has it.
    pub fn chain(&self) -> Chain<f64> {
        Chain::new(&self.machine, &self.deviations)
    }

    /// The calibrated chain of a set-up, if the calibration knows it.
    pub fn chain_of_setup(&self, setup: &str) -> Option<Chain<f64>> {
        let (_, previous_from_w) = self.setups.iter().find(|(name, _)| name == setup)?;
        let mut chain = self.chain();
        chain.set_previous_from_frame(self.machine.w_index(), *previous_from_w);
        Some(chain)
    }

    /// Frame `w` of a fitted set-up in the frame before it.
    pub fn setup(&self, name: &str) -> Option<Pose<f64>> {
        self.setups.iter().find(|(known, _)| known == name).map(|(_, pose)| *pose)
    }

    /// Names of the set-ups that were fitted.
    pub fn setup_names(&self) -> impl Iterator<Item = &str> {
        self.setups.iter().map(|(name, _)| name.as_str())
    }

    /// Frame `w` of every fitted set-up in the frame before it, by the set-up's name.
    pub fn setups(&self) -> impl Iterator<Item = (&str, Pose<f64>)> {
        self.setups.iter().map(|(name, pose)| (name.as_str(), *pose))
    }

    /// Tool points that were found, by name, in frame `t`, m.
    pub fn tool_points(&self) -> impl Iterator<Item = (&str, Vec3<f64>)> {
        self.tool_points.iter().map(|(name, at)| (name.as_str(), *at))
    }

    /// Rotations of targets in frame `t` that were found, by name, as rotation vectors, rad.
    pub fn tool_rotations(&self) -> impl Iterator<Item = (&str, Vec3<f64>)> {
        self.tool_rotations.iter().map(|(name, rotation)| (name.as_str(), rotation_vector(*rotation)))
    }

    /// Zeros that were found: set-up, joint or direction that they belong to, value in m or rad.
    pub fn zeros(&self) -> impl Iterator<Item = (&str, &str, f64)> {
        self.zeros.iter().map(|(setup, of, value)| (setup.as_str(), of.as_str(), *value))
    }

    /// Nominal lengths that were found, by set-up, m.
    pub fn lengths(&self) -> impl Iterator<Item = (&str, f64)> {
        self.lengths.iter().map(|(setup, value)| (setup.as_str(), *value))
    }

    /// Samples that it was calibrated on.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// RMS of what the calibration left over.
    pub fn rms(&self) -> Rms {
        self.rms
    }

    /// What the recordings have not seen of tip and tool axis: patterns of deviations (one twist per dyad, machine order, m and
    /// rad), each one standard deviation long and independent of the others. `None` where the file does not say.
    pub fn unseen(&self) -> Option<&[Vec<Twist<f64>>]> {
        self.unseen.as_deref()
    }

    /// Reads a machine file, calibrated or not.
    ///
    /// # Errors
    /// As [`Machine::open`].
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        Self::from_document(&Document::open(path)?)
    }

    /// Reads from a text; `file` is only the name that messages use.
    ///
    /// # Errors
    /// As [`Machine::parse`].
    pub fn parse(file: impl AsRef<Path>, text: &str) -> Result<Self> {
        Self::from_document(&Document::new(file, text.to_string())?)
    }

    fn from_document(document: &Document) -> Result<Self> {
        let form: MachineForm<CalibrationForm> = document.read()?;
        let machine = Machine::from_form(&form).map_err(|e| at_path(document, e))?;
        let mut calibrated = Self::nominal(machine);
        if let Some(calibration) = &form.calibration {
            calibrated.fill(calibration).map_err(|e| at_path(document, e))?;
        }
        Ok(calibrated)
    }

    fn fill(&mut self, form: &CalibrationForm) -> Checked<()> {
        let units = self.machine.units();
        self.deviations = deviations(&self.machine, "calibration.deviations", &form.deviations)?;
        let patterns = |name: &str, all: &Vec<Vec<DeviationForm>>| -> Checked<Vec<Vec<Twist<f64>>>> {
            let pattern = |(i, pattern): (usize, &Vec<DeviationForm>)| {
                deviations(&self.machine, &format!("calibration.{name}[{i}]"), pattern)
            };
            all.iter().enumerate().map(pattern).collect()
        };
        let unseen = form.unseen.as_ref().map(|all| patterns("unseen", all)).transpose()?;
        let at_all = form.unseen_at_all.as_ref().map(|all| patterns("unseen_at_all", all)).transpose()?;
        (self.unseen, self.unseen_at_all) = (unseen, at_all);
        for (i, setup) in form.setups.iter().enumerate() {
            let path = format!("calibration.setups[{i}]");
            let placement = Placement {
                at: place(&format!("{path}.at"), setup.at, units.length)?,
                rotation: place(&format!("{path}.rotation"), setup.rotation, units.angle)?,
            };
            self.setups.push((setup.name.clone(), placement.pose()));
        }
        for (i, point) in form.tool_points.iter().enumerate() {
            let at = place(&format!("calibration.tool_points[{i}].at"), point.at, units.length)?;
            self.tool_points.push((point.name.clone(), at));
        }
        for (i, target) in form.tool_rotations.iter().enumerate() {
            let path = format!("calibration.tool_rotations[{i}].rotation");
            let turn = Twist::new(Vec3([0.0; 3]), place(&path, target.rotation, units.angle)?);
            self.tool_rotations.push((target.name.clone(), Pose::exp(turn).rotation));
        }
        for (i, zero) in form.zeros.iter().enumerate() {
            checked(format!("calibration.zeros[{i}].value"), zero.value)?;
            let value = self.unit_of(&zero.of).to_si(zero.value);
            self.zeros.push((zero.setup.clone(), zero.of.clone(), value));
        }
        for (i, length) in form.lengths.iter().enumerate() {
            checked(format!("calibration.lengths[{i}].value"), length.value)?;
            self.lengths.push((length.setup.clone(), units.length.to_si(length.value)));
        }
        for (i, seen) in form.seen.iter().enumerate() {
            checked(format!("calibration.seen[{i}].from"), seen.from)?;
            checked(format!("calibration.seen[{i}].to"), seen.to)?;
            let unit = self.unit_of(&seen.joint);
            if let Some(c) = self.machine.commands().iter().position(|c| *c == seen.joint) {
                self.seen[c] = Some((unit.to_si(seen.from), unit.to_si(seen.to)));
            }
        }
        if let Some(pieces) = &form.pieces {
            self.variation = pieces.read(&self.machine)?;
        }
        self.read_effects(form)?;
        self.variation.motions = error_motion::read(&form.error_motions, &self.machine)?;
        self.samples = form.samples;
        self.rms = Rms {
            m: form.rms_length.map(|x| units.length.to_si(x)),
            rad: form.rms_angle.map(|x| units.angle.to_si(x)),
        };
        Ok(())
    }

    /// The file's unit for what a joint reads; anything that is no joint is a length.
    fn unit_of(&self, joint: &str) -> Unit {
        let units = self.machine.units();
        match self.machine.joints().find(|(_, j)| j.name == joint) {
            Some((_, joint)) if joint.kind == JointKind::Revolute => units.angle,
            _ => units.length,
        }
    }

    /// The calibrated machine as a RON text in the machine's own units; its effects are in SI. Terms ([`Variation`]) that belong to no
    /// named effect ([`CalibratedMachine::effects`]) are left out.
    pub fn to_ron(&self) -> String {
        let units = self.machine.units();
        let mut form = self.machine.to_form();
        let deviations = deviation_forms(&self.machine, &self.deviations);
        let pattern = |twists: &Vec<Twist<f64>>| -> Vec<DeviationForm> {
            let mut forms = deviation_forms(&self.machine, twists);
            forms.retain(|d| d.v != (0.0, 0.0, 0.0) || d.w != (0.0, 0.0, 0.0));
            forms
        };
        let patterns = |all: &Vec<Vec<Twist<f64>>>| all.iter().map(pattern).collect();
        let place = |(name, pose): &(String, Pose<f64>)| PlaceForm {
            name: name.clone(),
            at: in_unit(pose.translation, units.length),
            rotation: in_unit(pose.rotation_vector(), units.angle),
        };
        let seen = (self.machine.commands().iter().zip(&self.seen)).filter_map(|(joint, seen)| {
            let (from, to) = (*seen)?;
            let unit = self.unit_of(joint);
            Some(SeenForm { joint: joint.clone(), from: unit.write_si(from), to: unit.write_si(to) })
        });
        form.calibration = Some(CalibrationForm {
            samples: self.samples,
            rms_length: self.rms.m.map(|x| units.length.write_si(x)),
            rms_angle: self.rms.rad.map(|x| units.angle.write_si(x)),
            deviations,
            setups: self.setups.iter().map(place).collect(),
            tool_points: (self.tool_points.iter())
                .map(|(name, at)| PointForm { name: name.clone(), at: in_unit(*at, units.length) })
                .collect(),
            tool_rotations: (self.tool_rotations.iter())
                .map(|(name, rotation)| RotationForm {
                    name: name.clone(),
                    rotation: in_unit(rotation_vector(*rotation), units.angle),
                })
                .collect(),
            zeros: (self.zeros.iter())
                .map(|(setup, of, value)| ZeroForm {
                    setup: setup.clone(),
                    of: of.clone(),
                    value: self.unit_of(of).write_si(*value),
                })
                .collect(),
            lengths: (self.lengths.iter())
                .map(|(setup, value)| LengthForm {
                    setup: setup.clone(),
                    value: units.length.write_si(*value),
                })
                .collect(),
            seen: seen.collect(),
            pieces: PiecesForm::of(&self.machine, &self.variation),
            dead_bands: self.dead_band_forms(),
            clock: self.clock,
            effects: self.effects.clone(),
            error_motions: error_motion::forms(&self.machine, &self.variation.motions),
            unseen: self.unseen.as_ref().map(patterns),
            unseen_at_all: self.unseen_at_all.as_ref().map(patterns),
        });
        to_text(&form)
    }

    /// From what an identification has found.
    pub(crate) fn found(
        machine: &Machine,
        deviations: Vec<Twist<f64>>,
        seen: Vec<Option<(f64, f64)>>,
        samples: u64,
        rms: Rms,
    ) -> Self {
        let mut calibrated = Self::nominal(machine.clone()).with_deviations(deviations);
        (calibrated.seen, calibrated.samples, calibrated.rms) = (seen, samples, rms);
        calibrated
    }
}

/// Deviations of every dyad from a list in the file; frames that are not listed have none.
pub(crate) fn deviations(machine: &Machine, path: &str, forms: &[DeviationForm]) -> Checked<Vec<Twist<f64>>> {
    let units = machine.units();
    let mut deviations = vec![Twist::zero(0.0); machine.dyads().len()];
    for (i, deviation) in forms.iter().enumerate() {
        let path = format!("{path}[{i}]");
        let Some(j) = machine.frame_index(&deviation.frame) else {
            let frames: Vec<&str> = machine.dyads().iter().map(|d| d.frame.as_str()).collect();
            let fault =
                MachineFault::UnknownFrame { frame: deviation.frame.clone(), known: frames.join(", ") };
            return Err((format!("{path}.frame"), fault));
        };
        deviations[j] = Twist::new(
            place(&format!("{path}.v"), deviation.v, units.length)?,
            place(&format!("{path}.w"), deviation.w, units.angle)?,
        );
    }
    Ok(deviations)
}

/// The list as it stands in the file.
pub(crate) fn deviation_forms(machine: &Machine, deviations: &[Twist<f64>]) -> Vec<DeviationForm> {
    let units = machine.units();
    (machine.dyads().iter().zip(deviations))
        .map(|(dyad, dh)| DeviationForm {
            frame: dyad.frame.clone(),
            v: in_unit(dh.v, units.length),
            w: in_unit(dh.w, units.angle),
        })
        .collect()
}

fn rotation_vector(rotation: Mat3<f64>) -> Vec3<f64> {
    Pose { rotation, translation: Vec3([0.0; 3]) }.rotation_vector()
}

fn checked(path: String, value: f64) -> Checked<f64> {
    number(path, value, OF_CALIBRATION)
}

fn place(path: &str, triple: Triple, unit: Unit) -> Checked<Vec3<f64>> {
    vec_to_si(path, triple, unit, OF_CALIBRATION)
}
