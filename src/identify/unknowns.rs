//! The unknowns of an identification: where each stands in the parameter vector, and their present values.

use nalgebra::DVector;

use super::replay::State;
use super::set_up_values::SetUpValues;
use super::source::{Known, Source, Sources};
use crate::chain::Chain;
use crate::lie::{Pose, Twist, Vec3};
use crate::machine::Machine;
use crate::variation::Varying;

/// What a block of parameters stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    /// Deviation of dyad `j` (never `w`: that one belongs to the set-ups), six numbers.
    Dyad(usize),
    /// Frame `w` of a set-up, six numbers.
    Setup(usize),
    /// Unknown tool point, three numbers.
    ToolPoint(usize),
    /// Unknown rotation of a target, three numbers.
    ToolRotation(usize),
    /// Unknown zero.
    Zero(usize),
    /// Unknown length.
    Length(usize),
    /// What of dyad `dyad` changes sign with the directions of a set of axes, six numbers.
    Part { set: usize, dyad: usize },
    /// Coefficient of a term.
    Term(usize),
}

/// A block of the parameter vector.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Block {
    pub role: Role,
    pub offset: usize,
    pub len: usize,
    /// Prior standard deviations; where there is no prior, only the size by which the parameters are scaled. m or rad.
    pub scale: [f64; 6],
    /// Whether there is a prior on the total value.
    pub prior: bool,
}

/// The parameter vector's order.
#[derive(Clone, Debug)]
pub(crate) struct Layout {
    pub blocks: Vec<Block>,
    pub len: usize,
}

impl Layout {
    /// Every dyad but `w`, then frames, tool points, zeros, lengths and tool rotations of the set-ups, then what varies. `but_play` is a factor on the
    /// prior of direction parts other than play.
    pub fn new(machine: &Machine, sources: &Sources, varying: &Varying, but_play: f64) -> Self {
        let mut layout = Layout { blocks: Vec::new(), len: 0 };
        let tolerance = |j| machine.tolerance(j).to_array();
        for j in (0..machine.dyads().len()).filter(|j| *j != machine.w_index()) {
            layout.push(Role::Dyad(j), 6, tolerance(j), true);
        }
        for (s, unknown) in sources.frame_unknown.iter().enumerate() {
            if sources.all.iter().any(|source| source.setup == s && source.sees_frames()) {
                layout.push(Role::Setup(s), 6, tolerance(machine.w_index()), !unknown);
            }
        }
        let free = |j: usize| {
            let [translation, .., rotation] = tolerance(j);
            (translation, rotation)
        };
        for i in 0..sources.tool_points.len() {
            layout.push(Role::ToolPoint(i), 3, [free(machine.t_index()).0; 6], false);
        }
        for i in 0..sources.zeros.len() {
            let own = |s: &&Source| s.zero == Known::Unknown(i);
            let angular = sources
                .all
                .iter()
                .find(own)
                .is_some_and(|s| s.quantity(machine, 0) == crate::units::Quantity::Angle);
            let (translation, rotation) = free(machine.t_index());
            layout.push(Role::Zero(i), 1, [if angular { rotation } else { translation }; 6], false);
        }
        for i in 0..sources.lengths.len() {
            layout.push(Role::Length(i), 1, [free(machine.t_index()).0; 6], false);
        }
        for i in 0..sources.tool_rotations.len() {
            layout.push(Role::ToolRotation(i), 3, [free(machine.t_index()).1; 6], false);
        }
        if let Some(directions) = &varying.directions {
            for set in 0..directions.sets().len() {
                for dyad in 0..machine.dyads().len() {
                    let scale = directions.tolerance(machine, set, dyad, but_play);
                    layout.push(Role::Part { set, dyad }, 6, scale, true);
                }
            }
        }
        for (i, term) in varying.terms.iter().enumerate() {
            layout.push(Role::Term(i), 1, [term.scale; 6], term.prior);
        }
        layout
    }

    fn push(&mut self, role: Role, len: usize, scale: [f64; 6], prior: bool) {
        self.blocks.push(Block { role, offset: self.len, len, scale, prior });
        self.len += len;
    }

    /// The block of this role, if the data have such an unknown.
    pub fn block(&self, role: Role) -> Option<&Block> {
        self.blocks.iter().find(|b| b.role == role)
    }

    /// Number of dyads up to the last that has a block of its own (that of the tool frame).
    pub fn dyad_count(&self) -> usize {
        let own =
            self.blocks.iter().filter_map(|b| if let Role::Dyad(j) = b.role { Some(j + 1) } else { None });
        own.max().unwrap_or(0)
    }

    /// The scales of all parameters, in order.
    pub fn scales(&self) -> DVector<f64> {
        let scales = self.blocks.iter().flat_map(|b| b.scale[..b.len].iter().copied());
        DVector::from_iterator(self.len, scales)
    }

    /// Which parameters fulfil a condition on their block, in order.
    pub fn mask(&self, holds: impl Fn(&Block) -> bool) -> Vec<bool> {
        self.blocks.iter().flat_map(|b| std::iter::repeat_n(holds(b), b.len)).collect()
    }
}

/// Frame `w` of one set-up.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SetupFrame {
    /// Pose of `w` in the frame before it, before `dh`.
    pub previous_from_w: Pose<f64>,
    /// Deviation behind it; stays zero where the frame is found from nothing (the pose itself moves then).
    pub dh: Twist<f64>,
    /// Whether the frame is found from nothing.
    pub unknown: bool,
}

impl SetupFrame {
    /// The frame with its deviation.
    pub fn pose(&self) -> Pose<f64> {
        self.previous_from_w * Pose::exp(self.dh)
    }
}

/// Present values of all unknowns.
#[derive(Clone, Debug)]
pub(crate) struct Unknowns {
    /// Deviations of all dyads; that of `w` stays zero here.
    pub dh: Vec<Twist<f64>>,
    pub setups: Vec<SetupFrame>,
    /// What else is unknown of the set-ups.
    pub values: SetUpValues,
    /// What deviations depend on.
    pub varying: Varying,
    /// Direction parts by set and dyad.
    pub parts: Vec<Vec<Twist<f64>>>,
    /// Coefficients of the terms.
    pub coefficients: Vec<f64>,
    /// Error motions that room is left for, over their standard deviations; not in the parameter vector. Empty: all zero.
    pub motions: Vec<f64>,
}

impl Unknowns {
    /// Everything as the machine file says.
    pub fn nominal(machine: &Machine, sources: &Sources, varying: &Varying) -> Self {
        let zero = Twist::zero(0.0);
        let frame = |unknown: &bool| SetupFrame {
            previous_from_w: machine.dyads()[machine.w_index()].placement.pose(),
            dh: zero,
            unknown: *unknown,
        };
        Unknowns {
            dh: vec![zero; machine.dyads().len()],
            setups: sources.frame_unknown.iter().map(frame).collect(),
            values: SetUpValues::zero(sources),
            varying: varying.clone(),
            parts: vec![
                vec![zero; machine.dyads().len()];
                varying.directions.as_ref().map_or(0, |d| d.sets().len())
            ],
            coefficients: vec![0.0; varying.terms.len()],
            motions: Vec::new(),
        }
    }

    /// What there is of it where nothing varies.
    pub fn state(&self) -> State {
        let SetUpValues { tool_points, zeros, lengths, tool_rotations } = self.values.clone();
        let setups = self.setups.iter().map(|s| (s.previous_from_w, s.dh, s.unknown)).collect();
        State { dh: self.dh.clone(), setups, tool_points, zeros, lengths, tool_rotations }
    }

    /// The same unknowns with other values; none where those are of other recordings.
    pub fn at(&self, state: &State) -> Option<Self> {
        let State { dh, setups, tool_points, zeros, lengths, tool_rotations } = state.clone();
        let frame = |(previous_from_w, dh, unknown)| SetupFrame { previous_from_w, dh, unknown };
        let found = Unknowns {
            dh,
            setups: setups.into_iter().map(frame).collect(),
            values: SetUpValues { tool_points, zeros, lengths, tool_rotations },
            ..self.clone()
        };
        let sizes = |u: &Unknowns| {
            let v = &u.values;
            let of_values = [v.tool_points.len(), v.zeros.len(), v.lengths.len(), v.tool_rotations.len()];
            (u.dh.len(), u.setups.len(), of_values)
        };
        (sizes(&found) == sizes(self)).then_some(found)
    }

    /// The chain that a source's set-up sees, with constant deviations alone.
    pub fn chain(&self, machine: &Machine, setup: usize) -> Chain<f64> {
        let mut chain = Chain::new(machine, &self.dh);
        chain.set_previous_from_frame(machine.w_index(), self.setups[setup].pose());
        chain
    }

    /// The total of a block that has a prior, m and rad.
    pub fn total(&self, block: &Block) -> [f64; 6] {
        match block.role {
            Role::Dyad(j) => self.dh[j].to_array(),
            Role::Setup(s) => self.setups[s].dh.to_array(),
            Role::Part { set, dyad } => self.parts[set][dyad].to_array(),
            Role::Term(i) => [self.coefficients[i]; 6],
            Role::ToolPoint(_) | Role::Zero(_) | Role::Length(_) | Role::ToolRotation(_) => [0.0; 6],
        }
    }

    /// The unknowns after a step in the parameter vector, m and rad.
    pub fn stepped(&self, layout: &Layout, step: &DVector<f64>) -> Self {
        let mut next = self.clone();
        for block in &layout.blocks {
            let at = |k: usize| step[block.offset + k];
            match block.role {
                Role::Dyad(j) => next.dh[j] = self.dh[j] + Twist::from_array(std::array::from_fn(at)),
                Role::Setup(s) => {
                    let step = Twist::from_array(std::array::from_fn(at));
                    let frame = &mut next.setups[s];
                    if frame.unknown {
                        // Relinearised every step: the pose moves, no deviation is left.
                        frame.previous_from_w = frame.previous_from_w * Pose::exp(step);
                    } else {
                        frame.dh = frame.dh + step;
                    }
                }
                Role::ToolPoint(i) => {
                    next.values.tool_points[i] = next.values.tool_points[i] + Vec3(std::array::from_fn(at));
                }
                Role::Zero(i) => next.values.zeros[i] += at(0),
                Role::Length(i) => next.values.lengths[i] += at(0),
                Role::ToolRotation(i) => {
                    let turn = Pose::exp(Twist::new(Vec3([0.0; 3]), Vec3(std::array::from_fn(at))));
                    let rotation = &mut next.values.tool_rotations[i];
                    *rotation = *rotation * turn.rotation;
                }
                Role::Part { set, dyad } => {
                    let part = &mut next.parts[set][dyad];
                    *part = *part + Twist::from_array(std::array::from_fn(at));
                }
                Role::Term(i) => next.coefficients[i] += at(0),
            }
        }
        next
    }
}
