//! Streams of samples: what the head of a recording adds to the state.

use super::unknowns::{Block, FrameW, Opened, Role};
use super::{Kalman, Stream};
use crate::error::{Error, Result};
use crate::identify::{Known, channel};
use crate::lie::{Mat3, Twist};
use crate::machine::{JointKind, Tolerance};
use crate::recording::{Header, NominalLength, ToolPoint};
use crate::sensor::Sensor;
use crate::units::Quantity;

impl Kalman {
    /// Adds unknowns to the state, at their scale's standard deviation.
    pub(super) fn grow(&mut self, role: Role, scale: Vec<f64>) {
        let (offset, more) = (self.covariance.nrows(), scale.len());
        self.covariance = std::mem::take(&mut self.covariance).resize(offset + more, offset + more, 0.0);
        (offset..offset + more).for_each(|k| self.covariance[(k, k)] = 1.0);
        self.blocks.push(Block { role, offset, scale });
    }

    /// Takes up a stream of samples as the head of a recording describes it. Streams of one set-up share frame `w` and its unknowns,
    /// those that name the same tool point share that.
    ///
    /// # Errors
    /// [`Error::Undetermined`] where its noise is stated nowhere, or where frame `w` or a tool point is unknown and nothing says
    /// where to start.
    pub fn open(&mut self, header: &Header) -> Result<Stream> {
        let sensor = Sensor::of(header);
        let Tolerance { translation, rotation } = self.options.setup;
        let sigmas = self.sigmas(header, &sensor)?;
        let frame = self.frame(header)?;
        let tool_point = match &header.tool_point {
            ToolPoint::Known(at) => Known::Value(*at),
            ToolPoint::Unknown(name) => {
                let own = self.values.tool_points.iter().position(|(known, _)| known == name);
                Known::Unknown(match own {
                    Some(i) => i,
                    None => {
                        let known = self.known.as_ref().and_then(|k| k.tool_points().find(|p| p.0 == name));
                        let at = known.ok_or_else(|| no_start(&format!("tool point \"{name}\"")))?.1;
                        self.values.tool_points.push((name.clone(), at));
                        let i = self.values.tool_points.len() - 1;
                        self.grow(Role::ToolPoint(i), vec![translation; 3]);
                        i
                    }
                })
            }
        };
        let tool_rotation = match &header.tool_rotation_unknown {
            Some(name) if sensor == Sensor::Pose => {
                let own = self.values.tool_rotations.iter().position(|(known, _)| known == name);
                Known::Unknown(match own {
                    Some(i) => i,
                    None => {
                        let known = self.known.as_ref();
                        let known = known.and_then(|k| k.tool_rotations.iter().find(|p| p.0 == *name));
                        let start =
                            known.ok_or_else(|| no_start(&format!("the rotation of target \"{name}\"")))?.1;
                        self.values.tool_rotations.push((name.clone(), start));
                        let i = self.values.tool_rotations.len() - 1;
                        self.grow(Role::ToolRotation(i), vec![rotation; 3]);
                        i
                    }
                })
            }
            _ => Known::Value(Mat3::identity(0.0)),
        };
        let mut zero = Known::Value(0.0);
        if header.zero_unknown && sensor.has_zero() {
            let key = (header.setup.clone(), channel(&sensor, &self.machine));
            let own = self.values.zeros.iter().position(|(s, c, _)| (s, c) == (&key.0, &key.1));
            zero = Known::Unknown(own.unwrap_or_else(|| {
                self.values.zeros.push((key.0, key.1, None));
                let i = self.values.zeros.len() - 1;
                let angle = self.quantity(&sensor, 0) == Quantity::Angle;
                self.grow(Role::Zero(i), vec![if angle { rotation } else { translation }]);
                i
            }));
        }
        let length = match header.nominal_length {
            NominalLength::Known(length) => Known::Value(length),
            NominalLength::Unknown if sensor == (Sensor::Distance { absolute: false }) => {
                let own = self.values.lengths.iter().position(|(s, _)| *s == header.setup);
                Known::Unknown(own.unwrap_or_else(|| {
                    self.values.lengths.push((header.setup.clone(), None));
                    let i = self.values.lengths.len() - 1;
                    self.grow(Role::Length(i), vec![translation]);
                    i
                }))
            }
            _ => Known::Value(0.0),
        };
        let workpiece_point = header.workpiece_point;
        let opened =
            Opened { sensor, frame, tool_point, tool_rotation, workpiece_point, zero, length, sigmas };
        self.streams.push(opened);
        Ok(Stream(self.streams.len() - 1))
    }

    fn frame(&mut self, header: &Header) -> Result<usize> {
        if let Some(i) = self.values.frames.iter().position(|f| f.setup == header.setup) {
            return Ok(i);
        }
        let w = self.machine.w_index();
        let free = header.workpiece_frame_unknown && header.measurement.sees_frames();
        let mut previous_from_w = self.machine.dyads()[w].placement.pose();
        let mut scale = self.machine.tolerance(w).to_array();
        if free {
            let known = self.known.as_ref().and_then(|k| k.setups().find(|s| s.0 == header.setup));
            previous_from_w = known.ok_or_else(|| no_start("frame w of this set-up"))?.1;
            scale = self.options.setup.to_array();
        }
        let dh = Twist::zero(0.0);
        self.values.frames.push(FrameW { setup: header.setup.clone(), previous_from_w, dh, free });
        let i = self.values.frames.len() - 1;
        self.grow(Role::Frame(i), scale.to_vec());
        Ok(i)
    }

    fn quantity(&self, sensor: &Sensor, i: usize) -> Quantity {
        let prismatic = match sensor {
            Sensor::Joint { dyad } => {
                self.machine.dyads()[*dyad].joint.as_ref().is_some_and(|j| j.kind == JointKind::Prismatic)
            }
            _ => true,
        };
        sensor.quantity(i, prismatic)
    }

    fn sigmas(&self, header: &Header, sensor: &Sensor) -> Result<Vec<f64>> {
        let of = |i: usize| {
            let quantity = self.quantity(sensor, i);
            let stated = header.sigma.filter(|s| s.quantity == quantity).map(|s| s.value);
            let given = self.options.noise.map(|n| n[quantity]);
            stated.or(given).filter(|s| *s > 0.0 && s.is_finite()).ok_or_else(|| Error::Undetermined {
                what: "a filter needs the noise of the instrument, and the recording states none".into(),
                mend: "add `# sigma[um]: ...` to the head of the recording, or give the noise".into(),
            })
        };
        (0..sensor.reading_count()).map(of).collect()
    }
}

fn no_start(what: &str) -> Error {
    Error::Undetermined {
        what: format!("{what} is unknown, and a filter needs somewhere to start"),
        mend:
            "give it a file whose calibration knows the set-up (`kincal calibrate` on a few samples finds it)"
                .into(),
    }
}
