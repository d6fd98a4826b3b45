//! A scheme of the literature: a parameterisation and a step, repeated. No prior, no weights, plain m and rad.

use serde::{Deserialize, Serialize};

use super::Fitted;
use super::form::{Form, Rows, stepped};
use super::state::State;
use super::step::{Step, Triangle};
use crate::error::{Error, Result};
use crate::identify::{Places, Sources, Stop};
use crate::lie::{Mat3, Pose, Twist, Vec3};
use crate::machine::Machine;
use crate::recording::Recording;
use crate::sensor::Sensor;
use crate::variation::CONSTANT;
use crate::wording::count;

/// A parameterisation with a step rule.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scheme {
    /// What the unknowns are.
    pub form: Form,
    /// How each step is found.
    pub step: Step,
    /// Steps at most. Damped schemes take all of them: part of their regularisation is in this number.
    pub steps: usize,
}

/// Relative change of the sum of squares that counts as none; readings of metres with residuals of micrometres round at 1e-10.
const SETTLED: f64 = 1e-9;

impl Scheme {
    /// Runs from the machine as declared.
    ///
    /// # Errors
    /// If a recording cannot be read or measures a joint (which these models have no place for), and where a step cannot be found.
    pub(super) fn fit(&self, machine: &Machine, recordings: &[Recording]) -> Result<Fitted> {
        let sources = Sources::new(recordings, machine, &CONSTANT, &[], &|_| {})?;
        if let Some(source) = sources.all.iter().find(|s| !s.sees_frames()) {
            return Err(Error::Undetermined {
                what: format!("{}: this scheme has no place for readings of a single joint", source.label),
                mend: "leave that recording out, or use the local model with its own solver".into(),
            });
        }
        let places = Places::new(machine, &sources);
        let mut state = State::declared(machine, recordings, &sources)?;
        let mut squares = f64::INFINITY;
        let (mut steps, mut stop) = (0, Stop::Steps);
        for _ in 0..self.steps {
            let (triangle, now) = self.linearised(machine, &sources, places, &state)?;
            if !matches!(self.step, Step::Damped { .. } | Step::DampedBy { .. })
                && (squares - now).abs() <= SETTLED * now
            {
                stop = Stop::Converged;
                break;
            }
            squares = now;
            let (r, y) = triangle.finish();
            if !r.iter().chain(y.iter()).all(|x| x.is_finite()) {
                return Err(not_finite(steps));
            }
            let step = self.step.solve(&r, &y, |k| places.is_translation(k))?;
            state = stepped(self.form, machine, places, &state, &step);
            steps += 1;
        }
        Ok(Fitted { calibrated: state.calibrated(machine, &sources), steps, stop })
    }

    /// Singular values of the scheme's own Jacobian at the machine as declared, largest first, plain m and rad. Where unknowns are not
    /// confined to what can be a machine ([`Form::Free`]), more of them seem to show than there are.
    ///
    /// # Errors
    /// If a recording cannot be read.
    pub fn singular_values(&self, machine: &Machine, recordings: &[Recording]) -> Result<Vec<f64>> {
        let sources = Sources::new(recordings, machine, &CONSTANT, &[], &|_| {})?;
        let state = State::declared(machine, recordings, &sources)?;
        let (triangle, _) = self.linearised(machine, &sources, Places::new(machine, &sources), &state)?;
        let mut values: Vec<f64> = triangle.finish().0.singular_values().iter().copied().collect();
        values.sort_by(|a, b| b.total_cmp(a));
        Ok(values)
    }

    /// Rows and residuals of all samples, and the sum of squared residuals.
    fn linearised(
        &self,
        machine: &Machine,
        sources: &Sources,
        places: Places,
        state: &State,
    ) -> Result<(Triangle, f64)> {
        let mut triangle = Triangle::new(places.len());
        let mut squares = 0.0;
        let commands = machine.commands().len();
        let mut row = vec![0.0; places.len()];
        let instruments: Vec<_> = (sources.all.iter())
            .map(|s| {
                let rows = Rows::new(self.form, machine, places, state, s.setup);
                (state.chain(machine, s.setup), rows, state.set_ups.sensor_state(s))
            })
            .collect();
        sources.pass(
            |_, stretch| (stretch.chunk.commands.clone(), stretch.chunk.values.clone(), stretch.chunk.len),
            |index, (all_q, all_values, len)| {
                let (source, (chain, rows, sensor_state)) = (&sources.all[index], &instruments[index]);
                let width = source.recording.value_count();
                for k in 0..len {
                    let q = &all_q[k * commands..(k + 1) * commands];
                    let measured = &all_values[k * width..(k + 1) * width];
                    let sweep = chain.sweep(q);
                    let displacements = machine.displacements(q);
                    let rotation = measured_rotation(&source.sensor, measured);
                    let (readings, count) = source.sensor.readings(&sweep, sensor_state, rotation);
                    for (i, reading) in readings.iter().take(count).enumerate() {
                        let residual = if i < 3 { measured[i] } else { 0.0 } - reading.value;
                        squares += residual * residual;
                        row.fill(0.0);
                        rows.fill(&sweep, &displacements, reading.by_twist_w, &mut row);
                        if let Some(p) = source.tool_point.unknown() {
                            let at = places.tool_point(p);
                            row[at..at + 3].copy_from_slice(&reading.by_tool_point_t.0);
                        }
                        if let Some(z) = source.zero.unknown() {
                            row[places.zero(z)] = 1.0;
                        }
                        if let Some(l) = source.length.unknown() {
                            row[places.length(l)] = -1.0;
                        }
                        if let Some(r) = source.tool_rotation.unknown() {
                            let at = places.tool_rotation(r);
                            row[at..at + 3].copy_from_slice(&reading.by_tool_rotation.0);
                        }
                        triangle.push(&row, residual);
                    }
                }
            },
        )?;
        Ok((triangle, squares))
    }
}

fn not_finite(steps: usize) -> Error {
    if steps == 0 {
        return Error::Undetermined {
            what: "at the machine as declared a reading or its row is not finite: a bar of length zero has no direction".into(),
            mend: "check `workpiece_point` and `tool_point` of the recordings, or leave such samples out".into(),
        };
    }
    Error::Undetermined {
        what: format!(
            "after {} the model has no finite readings: the scheme has run away",
            count(steps as u64, "step", "steps")
        ),
        mend: "damp the step more, or truncate it".into(),
    }
}

/// The rotation that a pose's rotation readings are relative to.
pub(super) fn measured_rotation(sensor: &Sensor, measured: &[f64]) -> Mat3<f64> {
    match sensor {
        Sensor::Pose => {
            Pose::exp(Twist::new(Vec3([0.0; 3]), Vec3([measured[3], measured[4], measured[5]]))).rotation
        }
        _ => Mat3::identity(0.0),
    }
}
