//! Residuals and Jacobian rows of one sample.

use super::blocks::Samples;
use super::gauge::{EXTRAS, Gauge};
use super::source::Source;
use super::stretch::Stretch;
use super::unknowns::Unknowns;
use crate::chain::{Chain, Path, Sweep, deviation_jacobian};
use crate::error_motion::ErrorMotions;
use crate::lie::{Mat3, Pose, Twist, Wrench};
use crate::machine::Machine;
use crate::sensor::{MOST_READINGS, Sensor, SensorState};
use crate::variation::{Directions, Slot, Term};

/// Deviations of one pattern of directions.
pub(crate) struct Piece {
    pub chain: Chain<f64>,
    /// Constant and direction part of every dyad.
    pub dh: Vec<Twist<f64>>,
}

/// A machine as a recording's set-up sees it, with the instrument.
pub(crate) struct Evaluator<'a> {
    pub machine: &'a Machine,
    pub sensor: &'a Sensor,
    pub state: SensorState<f64>,
    /// Pose of every frame in the one before it without its deviation.
    nominal: Vec<Pose<f64>>,
    directions: Option<&'a Directions>,
    pieces: Vec<Piece>,
    terms: &'a [Term],
    coefficients: &'a [f64],
    motions: &'a ErrorMotions,
    /// Dyads with a deviation that changes from sample to sample, before and behind the joint.
    changing: Vec<usize>,
    carried: Vec<usize>,
}

/// What a sample is evaluated in, used again for the next.
pub(crate) struct Workspace {
    pub sweep: Sweep<f64>,
    chain: Chain<f64>,
    /// Total deviations of the dyads that change, before and behind the joint.
    before: Vec<Twist<f64>>,
    behind: Vec<Twist<f64>>,
    features: Vec<Vec<f64>>,
}

/// Everything besides the commands that a sample's deviations depend on.
#[derive(Clone, Copy)]
pub(crate) enum Moment<'a> {
    /// No direction, no feature: constant deviations alone.
    Still,
    /// Sample `k`.
    At(&'a Stretch, usize),
}

impl<'a> Evaluator<'a> {
    pub fn new(machine: &'a Machine, unknowns: &'a Unknowns, source: &'a Source) -> Self {
        let frame = &unknowns.setups[source.setup];
        let mut dh = unknowns.dh.clone();
        dh[machine.w_index()] = frame.dh;
        let values = Values {
            directions: unknowns.varying.directions.as_ref(),
            parts: &unknowns.parts,
            terms: &unknowns.varying.terms,
            coefficients: &unknowns.coefficients,
            // An identification eliminates them.
            motions: &NO_MOTIONS,
        };
        let state = unknowns.values.sensor_state(source);
        Self::with(machine, &source.sensor, state, frame.previous_from_w, &dh, values)
    }

    /// From its parts; `previous_from_w` is the frame of the set-up without the deviation `dh[w]`.
    pub fn with(
        machine: &'a Machine,
        sensor: &'a Sensor,
        state: SensorState<f64>,
        previous_from_w: Pose<f64>,
        dh: &[Twist<f64>],
        values: Values<'a>,
    ) -> Self {
        let Values { directions, parts, terms, coefficients, motions } = values;
        let mut nominal: Vec<Pose<f64>> = machine.dyads().iter().map(|d| d.placement.pose()).collect();
        nominal[machine.w_index()] = previous_from_w;
        let piece = |piece: usize| {
            let total = |j: usize| match directions {
                None => dh[j],
                Some(d) => {
                    (0..d.sets().len()).fold(dh[j], |sum, s| sum + parts[s][j].times(d.factor(s, piece)))
                }
            };
            let dh: Vec<Twist<f64>> = (0..dh.len()).map(total).collect();
            let mut chain = Chain::nominal(machine);
            for (j, dh) in dh.iter().enumerate() {
                chain.set_previous_from_frame(j, nominal[j] * Pose::exp(*dh));
            }
            Piece { chain, dh }
        };
        let pieces = (0..directions.map_or(1, Directions::piece_count)).map(piece).collect();
        let slots = || terms.iter().flat_map(|t| t.parts.iter().map(|p| p.slot));
        let among = |pick: fn(Slot) -> Option<usize>| {
            let mut list: Vec<usize> = slots().filter_map(pick).collect();
            list.sort_unstable();
            list.dedup();
            list
        };
        let mut changing = among(|s| if let Slot::Before(j) = s { Some(j) } else { None });
        changing.extend(motions.joints.iter().map(|motion| motion.dyad));
        changing.sort_unstable();
        changing.dedup();
        let carried = among(|s| if let Slot::After(j) = s { Some(j) } else { None });
        Evaluator {
            machine,
            sensor,
            state,
            nominal,
            directions,
            pieces,
            terms,
            coefficients,
            motions,
            changing,
            carried,
        }
    }

    /// The piece in whose pattern a moment lies.
    pub fn piece(&self, moment: Moment) -> usize {
        let still = self.pieces.len() / 2; // every direction 0
        match (self.directions, moment) {
            (Some(directions), Moment::At(stretch, k)) => directions.piece(stretch.directions(k)),
            _ => still,
        }
    }

    /// The samples of a stretch by piece.
    pub fn members(&self, stretch: &Stretch) -> Vec<Vec<usize>> {
        if self.pieces.len() == 1 {
            return vec![(0..stretch.chunk.len).collect()];
        }
        let mut members: Vec<Vec<usize>> = vec![Vec::new(); self.pieces.len()];
        (0..stretch.chunk.len).for_each(|k| members[self.piece(Moment::At(stretch, k))].push(k));
        members
    }

    /// The residuals of all samples of a stretch, those of a sample one after the other: as [`Evaluator::residuals`] gives them.
    pub fn all_residuals(&self, stretch: &Stretch) -> Vec<f64> {
        let count = self.sensor.reading_count();
        let mut residuals = vec![0.0; stretch.chunk.len * count];
        if let Some(gauges) = self.gauges() {
            for (members, gauge) in self.members(stretch).iter().zip(&gauges) {
                let own = Samples { gauge, stretch, members }.residuals();
                for (k, own) in members.iter().zip(own.chunks_exact(count)) {
                    residuals[k * count..(k + 1) * count].copy_from_slice(own);
                }
            }
            return residuals;
        }
        let mut work = self.workspace();
        for (k, own) in residuals.chunks_exact_mut(count).enumerate() {
            let measured = &stretch.chunk.values[k * count..(k + 1) * count];
            let all = self.residuals(stretch.q(k), measured, Moment::At(stretch, k), &mut work, None);
            own.copy_from_slice(&all[..count]);
        }
        residuals
    }

    /// How many pieces there are.
    pub fn piece_count(&self) -> usize {
        self.pieces.len()
    }

    /// Constant and direction part of every dyad in a piece.
    pub fn deviations(&self, piece: usize) -> &[Twist<f64>] {
        &self.pieces[piece].dh
    }

    /// Whether the rows of dyad `j` come in the deviation's own coordinates already.
    pub fn is_turned(&self, j: usize) -> bool {
        self.changing.contains(&j)
    }

    /// Columns of a row: six of each dyad, the extras, one of each term.
    pub fn width(&self) -> usize {
        6 * self.machine.dyads().len() + EXTRAS + self.terms.len()
    }

    /// The same for many samples at a time, one for each piece; none where deviations change from sample to sample.
    pub fn gauges(&self) -> Option<Vec<Gauge<'_>>> {
        if self.changes() {
            return None;
        }
        let dyads = self.machine.dyads().len();
        let gauge = |piece: &Piece| Gauge::new(Path::new(&piece.chain), self.sensor, self.state, dyads);
        self.pieces.iter().map(gauge).collect()
    }

    /// A workspace.
    pub fn workspace(&self) -> Workspace {
        let chain = self.pieces[0].chain.clone();
        Workspace {
            sweep: chain.sweep(&vec![0.0; self.machine.commands().len()]),
            chain,
            before: vec![Twist::zero(0.0); self.machine.dyads().len()],
            behind: vec![Twist::zero(0.0); self.machine.dyads().len()],
            features: self.terms.iter().map(|t| vec![0.0; t.parts.len()]).collect(),
        }
    }

    /// Whether deviations change from sample to sample, directions of travel aside.
    fn changes(&self) -> bool {
        !(self.terms.is_empty() && self.motions.is_empty())
    }

    /// The machine at a moment: the sweep of `work`, and the totals of the deviations that change.
    pub fn move_to(&self, q: &[f64], moment: Moment, work: &mut Workspace) {
        let piece = &self.pieces[self.piece(moment)];
        let Moment::At(stretch, k) = moment else { return piece.chain.sweep_into(q, &mut work.sweep) };
        if !self.changes() {
            return piece.chain.sweep_into(q, &mut work.sweep);
        }
        work.before.copy_from_slice(&piece.dh);
        work.behind.fill(Twist::zero(0.0));
        self.motions.add(self.machine, q, stretch.directions(k), &mut work.before);
        let mut columns = stretch.features.iter();
        for ((term, coefficient), features) in
            self.terms.iter().zip(self.coefficients).zip(&mut work.features)
        {
            for (part, feature) in term.parts.iter().zip(features) {
                *feature = columns.next().map_or(0.0, |column| column[k]);
                let added = part.direction.times(coefficient * *feature);
                match part.slot {
                    Slot::Before(j) => work.before[j] = work.before[j] + added,
                    Slot::After(j) => work.behind[j] = work.behind[j] + added,
                    Slot::Reading => {}
                }
            }
        }
        work.chain.copy_frames(&piece.chain);
        for j in &self.changing {
            work.chain.set_previous_from_frame(*j, self.nominal[*j] * Pose::exp(work.before[*j]));
        }
        for j in &self.carried {
            work.chain.set_carried(*j, Pose::exp(work.behind[*j]));
        }
        work.chain.sweep_into(q, &mut work.sweep);
    }

    /// The residuals, measured minus model, m and rad. With `rows`, the columns of the transposed Jacobian as well: derivatives
    /// by increments behind `exp(dh)`, by `dh` itself where [`Evaluator::is_turned`].
    pub fn residuals(
        &self,
        q: &[f64],
        measured: &[f64],
        moment: Moment,
        work: &mut Workspace,
        mut rows: Option<&mut [f64]>,
    ) -> [f64; MOST_READINGS] {
        let mut residuals = [0.0; MOST_READINGS];
        let (dyads, width) = (self.machine.dyads().len(), self.width());
        if let Some(rows) = &mut rows {
            rows[..self.sensor.reading_count() * width].fill(0.0);
        }
        self.move_to(q, moment, work);
        if let Sensor::Joint { dyad } = *self.sensor {
            residuals[0] = measured[0] - self.joint_reading(dyad, q, moment, work);
            if let Some(rows) = &mut rows {
                let xi = self.joint_twist(dyad);
                rows[6 * dyad..6 * dyad + 6].copy_from_slice(&xi.to_array());
                rows[6 * dyads + 3] = 1.0;
                if let Moment::At(..) = moment {
                    self.term_columns(0, &mut rows[..width], work, |_, part| match part.slot {
                        Slot::Before(j) | Slot::After(j) if j == dyad => along(xi, part.direction),
                        _ => 0.0,
                    });
                }
            }
            return residuals;
        }
        let (readings, count) =
            self.sensor.readings(&work.sweep, &self.state, self.measured_rotation(measured));
        let relative = matches!(self.sensor, Sensor::Distance { absolute: false });
        for (i, reading) in readings.iter().take(count).enumerate() {
            let reference = if i < 3 { measured[i] } else { 0.0 };
            residuals[i] = reference - reading.value - self.added(i, moment, work);
            if let Some(rows) = &mut rows {
                let row = &mut rows[i * width..(i + 1) * width];
                work.sweep.error_row(reading.by_twist_w, &mut row[..6 * dyads]);
                row[6 * dyads..6 * dyads + 3].copy_from_slice(&reading.by_tool_point_t.0);
                row[6 * dyads + 3] = if self.sensor.has_zero() { 1.0 } else { 0.0 };
                row[6 * dyads + 4] = if relative { -1.0 } else { 0.0 };
                row[6 * dyads + 5..6 * dyads + 8].copy_from_slice(&reading.by_tool_rotation.0);
                if let Moment::At(..) = moment {
                    self.varying_columns(i, reading.by_twist_w, row, work);
                }
            }
        }
        residuals
    }

    /// How the readings of the sample last moved to answer to a twist behind each joint, six numbers a dyad.
    pub fn carried_rows(&self, measured: &[f64], work: &Workspace) -> Vec<Vec<f64>> {
        let dyads = self.machine.dyads().len();
        if let Sensor::Joint { dyad } = *self.sensor {
            let mut row = vec![0.0; 6 * dyads];
            row[6 * dyad..6 * dyad + 6].copy_from_slice(&self.joint_twist(dyad).to_array());
            return vec![row];
        }
        let (readings, count) =
            self.sensor.readings(&work.sweep, &self.state, self.measured_rotation(measured));
        // Where something is carried already, by what is added to it.
        let block = |j: usize, y_w| match self.carried.contains(&j) {
            true => times(work.sweep.carried_block(j, y_w), deviation_jacobian(work.behind[j])),
            false => work.sweep.carried_block(j, y_w),
        };
        let row = |reading: &crate::sensor::Reading<f64>| {
            (0..dyads).flat_map(|j| block(j, reading.by_twist_w)).collect()
        };
        readings.iter().take(count).map(row).collect()
    }

    fn measured_rotation(&self, measured: &[f64]) -> Mat3<f64> {
        match self.sensor {
            Sensor::Pose => {
                Pose::exp(Twist::from_array([0.0, 0.0, 0.0, measured[3], measured[4], measured[5]])).rotation
            }
            _ => Mat3::identity(0.0),
        }
    }

    /// Turns the rows of the dyads that change into their own coordinates and fills the columns of the terms.
    fn varying_columns(&self, reading: usize, y_w: Wrench<f64>, row: &mut [f64], work: &Workspace) {
        for j in &self.changing {
            let block: [f64; 6] = std::array::from_fn(|k| row[6 * j + k]);
            let turned = times(block, deviation_jacobian(work.before[*j]));
            row[6 * j..6 * j + 6].copy_from_slice(&turned);
        }
        let carried: Vec<(usize, [f64; 6])> = (self.carried.iter())
            .map(|j| (*j, times(work.sweep.carried_block(*j, y_w), deviation_jacobian(work.behind[*j]))))
            .collect();
        self.term_columns(reading, row, work, |row, part| match part.slot {
            Slot::Before(j) => dot(&row[6 * j..6 * j + 6], part.direction),
            Slot::After(j) => {
                carried.iter().find(|(own, _)| *own == j).map_or(0.0, |(_, b)| dot(b, part.direction))
            }
            Slot::Reading => 0.0,
        });
    }

    fn term_columns(
        &self,
        reading: usize,
        row: &mut [f64],
        work: &Workspace,
        by_direction: impl Fn(&[f64], &crate::variation::Part) -> f64,
    ) {
        let first = 6 * self.machine.dyads().len() + EXTRAS;
        for (t, term) in self.terms.iter().enumerate() {
            let column: f64 = (term.parts.iter().zip(&work.features[t]))
                .map(|(part, feature)| match part.slot {
                    Slot::Reading => feature * part.weight(reading),
                    _ => feature * by_direction(row, part),
                })
                .sum();
            row[first + t] = column;
        }
    }

    /// What terms add to a reading itself.
    fn added(&self, reading: usize, moment: Moment, work: &Workspace) -> f64 {
        if let Moment::Still = moment {
            return 0.0;
        }
        let mut sum = 0.0;
        for ((term, coefficient), features) in self.terms.iter().zip(self.coefficients).zip(&work.features) {
            for (part, feature) in term.parts.iter().zip(features) {
                sum += part.weight(reading) * coefficient * feature;
            }
        }
        sum
    }

    /// `q + xi·dh + zero`, `docs/model.md` (19).
    fn joint_reading(&self, dyad: usize, q: &[f64], moment: Moment, work: &Workspace) -> f64 {
        let drive = self.machine.drive(dyad).expect("a measured joint has a drive");
        let displacement: f64 = drive.terms.iter().map(|(c, factor)| factor * q[*c]).sum();
        let xi = self.joint_twist(dyad);
        let varying = matches!(moment, Moment::At(..)) && self.changes();
        let dh = if varying {
            work.before[dyad] + work.behind[dyad]
        } else {
            self.pieces[self.piece(moment)].dh[dyad]
        };
        displacement + along(xi, dh) + self.state.zero + self.added(0, moment, work)
    }

    fn joint_twist(&self, dyad: usize) -> Twist<f64> {
        self.machine.dyads()[dyad].joint.as_ref().expect("a measured joint is a joint").twist()
    }
}

/// What deviations depend on, with its values.
#[derive(Clone, Copy)]
pub(crate) struct Values<'a> {
    pub directions: Option<&'a Directions>,
    /// By set and dyad.
    pub parts: &'a [Vec<Twist<f64>>],
    pub terms: &'a [Term],
    pub coefficients: &'a [f64],
    pub motions: &'a ErrorMotions,
}

static NO_MOTIONS: ErrorMotions = ErrorMotions { joints: Vec::new() };

fn along(xi: Twist<f64>, dh: Twist<f64>) -> f64 {
    xi.v.dot(dh.v) + xi.w.dot(dh.w)
}

fn dot(row: &[f64], direction: Twist<f64>) -> f64 {
    row.iter().zip(direction.to_array()).map(|(a, b)| a * b).sum()
}

fn times(row: [f64; 6], matrix: [[f64; 6]; 6]) -> [f64; 6] {
    std::array::from_fn(|b| (0..6).map(|a| row[a] * matrix[a][b]).sum())
}
