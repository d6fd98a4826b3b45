//! What a machine's deviations depend on besides being constant: directions of travel, and features of the path.
//!
//! To `dh_j` of (10) comes what changes with the directions of travel of some axes, [`Directions`] and (29), and a sum of
//! coefficients times features, [`Term`] and (30). Equations: `docs/model.md`.

use crate::error_motion::ErrorMotions;
use crate::feature::Feature;
use crate::lie::Twist;
use crate::machine::Machine;

/// Where a part of a deviation acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Slot {
    /// Before the joint of dyad `j`, as its constant deviation does: `M_j exp(dh) exp(xi_j q_j)`.
    Before(usize),
    /// After the joint of dyad `j`, carried along: `M_j exp(xi_j q_j) exp(e)`.
    After(usize),
    /// On what the instrument reads: the six numbers of the direction are weights of readings 0 to 5.
    Reading,
}

/// One feature acting in one direction. `F`: the feature itself, or its index in a list.
#[derive(Clone, Debug, PartialEq)]
pub struct Part<F = Feature> {
    /// Where.
    pub slot: Slot,
    /// Along which twist in the frame of the slot.
    pub direction: Twist<f64>,
    /// How it changes from sample to sample.
    pub feature: F,
}

impl<F> Part<F> {
    /// By how much reading `i` itself changes with the feature; 0 for a part that acts on the machine.
    pub fn weight(&self, reading: usize) -> f64 {
        match self.slot {
            Slot::Reading => self.direction.to_array()[reading],
            Slot::Before(_) | Slot::After(_) => 0.0,
        }
    }
}

/// Parts that share one coefficient.
#[derive(Clone, Debug, PartialEq)]
pub struct Term {
    /// The parts.
    pub parts: Vec<Part>,
    /// By what the coefficient is scaled, in its own unit; with `prior`, the standard deviation of its prior.
    pub scale: f64,
    /// Whether there is a prior on it.
    pub prior: bool,
    /// Whether it belongs to a set-up, and is found again with that.
    pub of_setup: bool,
}

/// Everything that deviations depend on besides being constant, without values.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Varying {
    /// Directions of travel.
    pub directions: Option<Directions>,
    /// Features.
    pub terms: Vec<Term>,
}

/// Nothing varies.
pub(crate) static CONSTANT: Varying = Varying { directions: None, terms: Vec::new() };

impl Varying {
    /// The feature of every part of every term, in their order.
    pub fn features(&self) -> impl Iterator<Item = &Feature> {
        self.terms.iter().flat_map(|term| term.parts.iter().map(|part| &part.feature))
    }

    /// Whether the history of the path matters.
    pub fn is_constant(&self) -> bool {
        self.directions.is_none() && self.terms.is_empty()
    }
}

/// What deviations depend on, with the values found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Variation {
    /// What they depend on.
    pub varying: Varying,
    /// Direction parts by set and dyad, m and rad.
    pub parts: Vec<Vec<Twist<f64>>>,
    /// Coefficients of the terms.
    pub coefficients: Vec<f64>,
    /// Dead bands by command, m or rad; empty where nothing depends on history.
    pub dead_bands: Vec<f64>,
    /// Samples that each piece was found from, by piece.
    pub samples: Vec<u64>,
    /// Error motions of the axes, where room was left for them.
    pub motions: ErrorMotions,
}

impl Variation {
    /// Whether a piece was among the samples that the model was found from; a constant model has seen everything.
    pub fn has_seen(&self, piece: usize) -> bool {
        self.varying.directions.is_none() || self.samples.get(piece).is_some_and(|n| *n > 0)
    }

    /// Whether a piece that was found agrees with this one in every axis that moves: an axis that never moves stands for the mean of
    /// both its directions.
    pub fn has_seen_alike(&self, piece: usize) -> bool {
        let Some(directions) = &self.varying.directions else { return true };
        let pattern = directions.pattern(piece);
        let alike =
            |seen: usize| directions.pattern(seen).iter().zip(&pattern).all(|(s, p)| *p == 0 || s == p);
        (0..self.samples.len()).any(|seen| self.has_seen(seen) && alike(seen))
    }

    /// What the directions of a piece add to the constant deviation of every dyad, m and rad.
    pub fn direction_part(&self, piece: usize, dyads: usize) -> Vec<Twist<f64>> {
        let zero = vec![Twist::zero(0.0); dyads];
        let Some(directions) = &self.varying.directions else { return zero };
        (self.parts.iter().enumerate()).fold(zero, |sum, (set, parts)| {
            let factor = directions.factor(set, piece);
            sum.iter().zip(parts).map(|(a, b)| *a + b.times(factor)).collect()
        })
    }
}

/// Axes whose directions of travel a model is keyed on: a pattern of directions is a piece of it.
///
/// The deviation of dyad `j` in the pattern of signs `s` is `dh_j + Σ_S (Π_{i in S} s_i) D_{S,j}`, over the sets `S` of axes,
/// (29): what does not depend on direction is shared by all pieces, and what depends on it has its own, tighter prior. For up
/// to three axes all sets are there, so that every piece is free; for more, only the sets of one axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Directions {
    /// Commands.
    axes: Vec<usize>,
    /// Sets of axes, each by positions in `axes`; the empty set is the constant deviation and not among them.
    sets: Vec<Vec<usize>>,
}

/// Standard deviation of a direction part over the tolerance of its dyad: along the joint that turns round, across it, and of
/// anything else. Play along the axis is common; that a frame shifts when another axis turns round is not.
const ALONG: f64 = 0.5;
const ACROSS: f64 = 0.1;
const ELSEWHERE: f64 = 0.03;
/// More axes than these have no parts of several axes together.
const ALL_SETS: usize = 3;
/// More axes are not taken.
pub const MOST_AXES: usize = 7;

impl Directions {
    /// Pieces keyed on these commands.
    ///
    /// # Panics
    /// If there is none, one is named twice, or there are more than [`MOST_AXES`].
    pub fn new(axes: Vec<usize>) -> Self {
        assert!((1..=MOST_AXES).contains(&axes.len()), "one to {MOST_AXES} axes");
        assert!((0..axes.len()).all(|i| !axes[..i].contains(&axes[i])), "every axis once");
        let n = axes.len();
        let mut sets: Vec<Vec<usize>> =
            (1..1usize << n).map(|bits| (0..n).filter(|i| bits >> i & 1 == 1).collect()).collect();
        sets.retain(|set| n <= ALL_SETS || set.len() == 1);
        sets.sort_by_key(|set| set.len());
        Directions { axes, sets }
    }

    /// The commands.
    pub fn axes(&self) -> &[usize] {
        &self.axes
    }

    /// The sets of axes that have parts, by positions in [`Directions::axes`].
    pub fn sets(&self) -> &[Vec<usize>] {
        &self.sets
    }

    /// How many pieces there can be, those of axes that stand still included.
    pub fn piece_count(&self) -> usize {
        3usize.pow(self.axes.len() as u32)
    }

    /// The piece of these directions of all commands.
    #[inline]
    pub fn piece(&self, directions: &[i8]) -> usize {
        self.axes.iter().fold(0, |piece, c| 3 * piece + (directions[*c] + 1) as usize)
    }

    /// The directions of a piece's axes: -1, 0, +1.
    pub fn pattern(&self, mut piece: usize) -> Vec<i8> {
        let mut pattern: Vec<i8> = Vec::new();
        for _ in &self.axes {
            pattern.push((piece % 3) as i8 - 1);
            piece /= 3;
        }
        pattern.reverse();
        pattern
    }

    /// The factor of a set in a piece: the product of its axes' directions.
    pub fn factor(&self, set: usize, piece: usize) -> f64 {
        let pattern = self.pattern(piece);
        self.sets[set].iter().map(|i| f64::from(pattern[*i])).product()
    }

    /// Name of a piece from the axes' names: `AFCR` is A forward, C reverse; `0` for an axis that never moves.
    pub fn name(&self, machine: &Machine, piece: usize) -> String {
        let names: Vec<String> = self.axes.iter().map(|c| machine.commands()[*c].to_uppercase()).collect();
        let letter = |d: &i8| ["R", "0", "F"][(*d + 1) as usize];
        let joint = if names.iter().any(|n| n.chars().count() > 1) { "_" } else { "" };
        let parts: Vec<String> =
            names.iter().zip(&self.pattern(piece)).map(|(name, d)| format!("{name}{}", letter(d))).collect();
        parts.join(joint)
    }

    /// The axes of a set by name: `a`, `a and c`.
    pub fn set_name(&self, machine: &Machine, set: usize) -> String {
        let names: Vec<&str> =
            self.sets[set].iter().map(|i| machine.commands()[self.axes[*i]].as_str()).collect();
        names.join(" and ")
    }

    /// Standard deviation of half the play of the joint of dyad `j`, m or rad; `None` where no axis of these drives it alone.
    pub fn play(&self, machine: &Machine, j: usize) -> Option<f64> {
        let set =
            self.sets.iter().position(|set| matches!(set[..], [i] if drives(machine, self.axes[i], j)))?;
        let along = machine.dyads()[j].joint.as_ref()?.twist().to_array();
        let tolerance = self.tolerance(machine, set, j, 0.0);
        Some(along.iter().zip(tolerance).map(|(xi, t)| xi.abs() * t).fold(0.0, f64::max))
    }

    /// Standard deviation of the part of `set` on dyad `j`, m and rad; `but_play` is a factor on everything but play.
    pub fn tolerance(&self, machine: &Machine, set: usize, j: usize, but_play: f64) -> [f64; 6] {
        let tolerance = machine.tolerance(j).to_array();
        let own = match self.sets[set][..] {
            [i] => drives(machine, self.axes[i], j),
            _ => false,
        };
        let xi = match &machine.dyads()[j].joint {
            Some(joint) if own => joint.twist(),
            _ => return tolerance.map(|t| but_play * ELSEWHERE * t),
        };
        let along = xi.to_array();
        std::array::from_fn(|k| {
            let share = along[k].abs();
            tolerance[k] * (ALONG * share).hypot(but_play * ACROSS * (1.0 - share * share).max(0.0).sqrt())
        })
    }
}

/// Whether command `c` alone drives the joint of dyad `j`.
fn drives(machine: &Machine, c: usize, j: usize) -> bool {
    machine.drive(j).is_some_and(|drive| matches!(drive.terms[..], [(own, _)] if own == c))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_piece_has_its_own_index_and_the_factors_are_products_of_directions() {
        let directions = Directions::new(vec![3, 1]);
        let mut seen = vec![false; directions.piece_count()];
        for a in [-1, 0, 1] {
            for b in [-1, 0, 1] {
                let piece = directions.piece(&[0, b, 0, a]);
                assert!(!std::mem::replace(&mut seen[piece], true));
                assert_eq!(directions.pattern(piece), [a, b]);
                let factors: Vec<f64> = (0..3).map(|set| directions.factor(set, piece)).collect();
                assert_eq!(factors, [f64::from(a), f64::from(b), f64::from(a * b)]);
            }
        }
    }

    #[test]
    fn four_axes_and_more_have_parts_of_single_axes_only() {
        assert_eq!(Directions::new(vec![0, 1, 2, 3]).sets(), [[0], [1], [2], [3]]);
    }
}
