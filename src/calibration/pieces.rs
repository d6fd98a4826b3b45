//! The pieces of a calibrated machine in its file.

use serde::{Deserialize, Serialize};

use super::{DeviationForm, checked, deviation_forms, deviations};
use crate::machine::{Checked, Machine, MachineFault};
use crate::units::Unit;
use crate::variation::{Directions, MOST_AXES, Variation, Varying};

/// What of the deviations changes with directions of travel, in the file's units.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(rename = "pieces", deny_unknown_fields)]
pub(crate) struct PiecesForm {
    axes: Vec<AxisForm>,
    parts: Vec<PartForm>,
    seen: Vec<PieceForm>,
}

#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(rename = "axis", deny_unknown_fields)]
pub(crate) struct AxisForm {
    pub joint: String,
    pub dead_band: f64,
}

/// Deviations that change sign with the product of the directions of these axes.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(rename = "part", deny_unknown_fields)]
struct PartForm {
    with_direction_of: Vec<String>,
    deviations: Vec<DeviationForm>,
}

#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(rename = "piece", deny_unknown_fields)]
struct PieceForm {
    name: String,
    samples: u64,
}

impl PiecesForm {
    /// From a model that is keyed on directions.
    pub fn of(machine: &Machine, variation: &Variation) -> Option<Self> {
        let directions = variation.varying.directions.as_ref()?;
        let name = |c: &usize| machine.commands()[*c].clone();
        let axes = directions.axes().iter().map(|c| AxisForm {
            joint: name(c),
            dead_band: unit(machine, *c).write_si(variation.dead_bands[*c]),
        });
        let parts = directions.sets().iter().zip(&variation.parts).map(|(set, parts)| PartForm {
            with_direction_of: set.iter().map(|i| name(&directions.axes()[*i])).collect(),
            deviations: deviation_forms(machine, parts),
        });
        let seen = variation.samples.iter().enumerate().filter(|(_, n)| **n > 0);
        let seen = seen.map(|(piece, n)| PieceForm { name: directions.name(machine, piece), samples: *n });
        Some(PiecesForm { axes: axes.collect(), parts: parts.collect(), seen: seen.collect() })
    }

    /// Back from the file.
    pub fn read(&self, machine: &Machine) -> Checked<Variation> {
        let path = "calibration.pieces";
        let mut dead_bands = vec![0.0; machine.commands().len()];
        let mut axes = Vec::new();
        for (i, axis) in self.axes.iter().enumerate() {
            let at = format!("{path}.axes[{i}]");
            let c = command(machine, &axis.joint).ok_or_else(|| unknown(machine, &at, &axis.joint))?;
            if axes.contains(&c) {
                return Err((
                    format!("{at}.joint"),
                    MachineFault::BadPieces { what: "this axis is named twice".into() },
                ));
            }
            checked(format!("{at}.dead_band"), axis.dead_band)?;
            dead_bands[c] = unit(machine, c).to_si(axis.dead_band);
            axes.push(c);
        }
        if axes.is_empty() || axes.len() > MOST_AXES {
            let what = format!("pieces are keyed on one to {MOST_AXES} axes, here on {}", axes.len());
            return Err((format!("{path}.axes"), MachineFault::BadPieces { what }));
        }
        let directions = Directions::new(axes);
        let mut parts = vec![deviations(machine, path, &[])?; directions.sets().len()];
        for (i, part) in self.parts.iter().enumerate() {
            let at = format!("{path}.parts[{i}]");
            let mut named: Vec<Option<usize>> = Vec::new();
            for joint in &part.with_direction_of {
                let c = command(machine, joint);
                named.push(directions.axes().iter().position(|own| Some(*own) == c));
            }
            let set = directions
                .sets()
                .iter()
                .position(|set| set.len() == named.len() && set.iter().all(|i| named.contains(&Some(*i))));
            let Some(set) = set else {
                let what = format!(
                    "no part goes with the directions of [{}] here",
                    part.with_direction_of.join(", ")
                );
                return Err((format!("{at}.with_direction_of"), MachineFault::BadPieces { what }));
            };
            parts[set] = deviations(machine, &format!("{at}.deviations"), &part.deviations)?;
        }
        let mut samples = vec![0; directions.piece_count()];
        for (i, seen) in self.seen.iter().enumerate() {
            let piece = (0..samples.len()).find(|p| directions.name(machine, *p) == seen.name);
            let Some(piece) = piece else {
                let what = format!("\"{}\" is no piece of these axes", seen.name);
                return Err((format!("{path}.seen[{i}].name"), MachineFault::BadPieces { what }));
            };
            samples[piece] = seen.samples;
        }
        let varying = Varying { directions: Some(directions), terms: Vec::new() };
        Ok(Variation { varying, parts, dead_bands, samples, ..Variation::default() })
    }
}

pub(super) fn command(machine: &Machine, joint: &str) -> Option<usize> {
    machine.commands().iter().position(|c| c == joint)
}

pub(super) fn unknown(machine: &Machine, path: &str, joint: &str) -> (String, MachineFault) {
    let what = format!("\"{joint}\" is none of the axes {}", machine.commands().join(", "));
    (format!("{path}.joint"), MachineFault::BadPieces { what })
}

pub(super) fn unit(machine: &Machine, command: usize) -> Unit {
    machine.units().of(machine.command_joint(command).kind)
}
