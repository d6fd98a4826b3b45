//! Normal equations of a candidate's columns at one point of its grid, and how good it is there, `docs/diagnosis-method.md` (63).

use std::sync::Arc;

use nalgebra::{DMatrix, DMatrixView, DVector};

use super::evidence::{Worth, evidence, log_mean_exp};
use super::marginal::{Marginal, square, square_of};
use crate::effects::{Candidate, Coefficient};
use crate::feature::Dimension;
use crate::lie::Twist;
use crate::variation::Slot;

/// Coefficients of effects that are taken in may be this many times the usual size, and this many times the likeliest if that is
/// larger.
pub(super) const ROOM: f64 = 4.0;
pub(super) const ROOM_BEYOND: f64 = 2.0;
/// Numbers of columns that are built at a time: they stay in a core's cache.
pub(super) const BATCH: usize = 1 << 17;
/// A marginal that leaves less than this part of a column's square leaves next to nothing of it.
const BARELY: f64 = 1e-2;
/// More columns than this are multiplied by blocks.
const WIDE: usize = 5;
/// Root mean square below which a feature is next to nothing: of those that are numbers and have the size of one where they act, and
/// in SI of all others.
const FAINT: f64 = 1e-4;
const ROUNDING: f64 = 1e-12;

/// What is done with a point's normal equations.
type Take<'a> = dyn FnMut(usize, &Equations) + 'a;

/// Normal equations of columns beside a marginal.
pub(super) struct Equations {
    /// Gram matrix of what the marginal leaves of the columns.
    pub gram: DMatrix<f64>,
    /// The columns times the residuals.
    pub toward: DVector<f64>,
    /// Square norms of the columns themselves.
    whole: DVector<f64>,
}

impl Equations {
    /// `along`: what the marginal takes of the columns.
    pub fn of(columns: &DMatrixView<f64>, along: &DMatrixView<f64>, toward: DVector<f64>) -> Self {
        Self::with_square(squares(columns), along, toward)
    }

    /// The same of columns that lie one behind the other.
    fn of_slice(
        columns: &[f64],
        shape: (usize, usize),
        along: &DMatrixView<f64>,
        toward: DVector<f64>,
    ) -> Self {
        let own = match shape.1 > WIDE {
            true => square_of(columns, shape),
            false => squares(&DMatrixView::from_slice(columns, shape.0, shape.1)),
        };
        Self::with_square(own, along, toward)
    }

    fn with_square(own: DMatrix<f64>, along: &DMatrixView<f64>, toward: DVector<f64>) -> Self {
        let taken = match along.ncols() > WIDE {
            true => square(&along.into_owned()),
            false => squares(along),
        };
        Equations { whole: own.diagonal(), gram: own - taken, toward }
    }

    /// `own`: Gram matrix of the columns, `gram`: of what the marginal leaves of them.
    pub fn new(own: DMatrix<f64>, gram: DMatrix<f64>, toward: DVector<f64>) -> Self {
        Equations { whole: own.diagonal(), gram, toward }
    }

    /// `own`: Gram matrix of the columns.
    pub fn from_products(own: DMatrix<f64>, along: &DMatrix<f64>, toward: DVector<f64>) -> Self {
        Equations { whole: own.diagonal(), gram: own - along.tr_mul(along), toward }
    }

    /// Whether the marginal leaves next to nothing of one of the first columns, so that what is put together in blocks does not tell it.
    fn is_faint(&self, columns: usize) -> bool {
        (0..columns).any(|c| self.gram[(c, c)] < BARELY * self.whole[c])
    }
}

/// `aᵀ a` of few columns, half of it computed.
fn squares(a: &DMatrixView<f64>) -> DMatrix<f64> {
    let mut squares = DMatrix::zeros(a.ncols(), a.ncols());
    for i in 0..a.ncols() {
        for j in 0..=i {
            let product = a.column(i).dot(&a.column(j));
            (squares[(i, j)], squares[(j, i)]) = (product, product);
        }
    }
    squares
}

/// What tells a column: kind of slot, joint, direction.
pub(super) type Key = (usize, usize, [u64; 6]);

/// A column that several candidates share.
pub(super) type Column = Arc<Vec<f64>>;

/// A candidate at its best.
#[derive(Clone, Debug)]
pub(super) struct Score {
    /// Logarithm of its evidence over that of nothing, averaged over grid, sizes and lengths.
    pub evidence: f64,
    /// The same at the best point alone.
    pub at_best: f64,
    /// Where on its grid it is best.
    pub parameters: Vec<f64>,
    /// Other periods of a wave where it is nearly as good, as half or twice of it may be.
    pub also: Vec<Vec<f64>>,
    /// How many of its coefficients take part, from the first.
    pub coefficients: usize,
    /// Half the misfit energy that it takes away there.
    pub gain: f64,
    /// Its coefficients may be this many usual sizes large once it is taken in.
    pub room: f64,
}

/// Judges the first columns, so many for each of these points, beside a marginal.
pub(super) fn judge(
    (joined, k): (&DMatrix<f64>, usize),
    marginal: &Marginal,
    left: &DVector<f64>,
    points: &[usize],
    take: &mut Take,
) {
    let (rows, used) = (joined.nrows(), joined.columns(0, k * points.len()));
    let (along, toward) = (marginal.along(&used), used.tr_mul(left));
    for (b, i) in points.iter().enumerate() {
        let columns = &joined.as_slice()[b * k * rows..(b + 1) * k * rows];
        let toward = toward.rows(b * k, k).into_owned();
        take(*i, &Equations::of_slice(columns, (rows, k), &along.columns(b * k, k), toward));
    }
}

/// The best of a candidate at one point, over how many of its coefficients take part. `usual`: sizes beyond the usual one that are usual too.
pub(super) fn best(
    candidate: &Candidate,
    at: &[f64],
    lengths: &[usize],
    equations: &Equations,
    overdispersion: f64,
    usual: usize,
) -> Best {
    let lengths = if candidate.has_overtones(at) { lengths } else { &lengths[..1] };
    let Equations { gram, toward, .. } = equations;
    let of = |length: usize| evidence(gram, toward, length, overdispersion, usual);
    let told = |evidence: f64, length: usize, Worth { gain, size, .. }: Worth| {
        let room = if size > 1.0 { ROOM_BEYOND * size } else { ROOM };
        Best { evidence, length, gain, room, is_faint: equations.is_faint(length) }
    };
    if let [length] = lengths {
        let only = of(*length);
        return told(only.evidence, *length, only);
    }
    let all: Vec<Worth> = lengths.iter().map(|length| of(*length)).collect();
    let values: Vec<f64> = all.iter().map(|worth| worth.evidence).collect();
    let best = (0..all.len()).max_by(|a, b| values[*a].total_cmp(&values[*b])).unwrap_or(0);
    told(log_mean_exp(&values), lengths[best], all[best])
}

impl Score {
    /// How many times the usual size it is, from one on.
    pub fn times_usual(&self) -> f64 {
        if self.room > ROOM { self.room / ROOM_BEYOND } else { 1.0 }
    }

    /// Whether what it moves is a small twist: beyond one radian or metre there is nothing linear.
    pub fn is_small(&self, candidate: &Candidate) -> bool {
        let of_size = candidate.coefficients[..self.coefficients].iter().map(|coefficient| coefficient.size);
        of_size.fold(0.0, f64::max) * self.times_usual() < 1.0
    }
}

/// Candidate at one point of its grid.
#[derive(Clone, Debug)]
pub(super) struct Best {
    pub evidence: f64,
    pub length: usize,
    pub gain: f64,
    pub room: f64,
    /// Whether the marginal leaves next to nothing of one of its columns.
    pub is_faint: bool,
}

impl Best {
    /// As what is told of a candidate of one point.
    pub fn at(self, parameters: &[f64]) -> Score {
        Score {
            evidence: self.evidence,
            at_best: self.evidence,
            parameters: parameters.to_vec(),
            also: Vec::new(),
            coefficients: self.length,
            gain: self.gain,
            room: self.room,
        }
    }
}

pub(super) fn key(slot: Slot, direction: Twist<f64>) -> Key {
    let d = direction.to_array().map(f64::to_bits);
    match slot {
        Slot::Before(j) => (0, j, d),
        Slot::After(j) => (1, j, d),
        Slot::Reading => (2, 0, d),
    }
}

/// The usual size over the root mean square of the first part's feature.
pub(super) fn unit_size(coefficient: &Coefficient, features: &[Vec<f64>]) -> f64 {
    let is_number = is_of_number(coefficient);
    coefficient.parts.first().map_or(0.0, |part| {
        let feature = &features[part.feature];
        unit_of(coefficient.size, root_mean_square(feature, feature.len()), is_number)
    })
}

/// Of a feature that is given where it does not vanish, of so many samples.
pub(super) fn root_mean_square<X: Copy + Into<f64>>(feature: &[X], samples: usize) -> f64 {
    let square = |x: &X| (*x).into() * (*x).into();
    (feature.iter().map(square).sum::<f64>() / samples.max(1) as f64).sqrt()
}

/// The usual size over the root mean square of a feature; 0 where that is next to nothing at every sample: nobody can see it there, and its
/// coefficient could be anything.
pub(super) fn unit_of(size: f64, rms: f64, is_number: bool) -> f64 {
    if rms > if is_number { FAINT } else { ROUNDING } { size / rms } else { 0.0 }
}

/// Whether what it multiplies is a number without a unit.
pub(super) fn is_of_number(coefficient: &Coefficient) -> bool {
    is_travel(coefficient.dimension)
}

fn is_travel(dimension: Dimension) -> bool {
    [Dimension::LENGTH, Dimension::ANGLE].contains(&dimension)
}

/// How many coefficients may take part: all, or those of the first features from `least` on.
pub(super) fn lengths(candidate: &Candidate) -> Vec<usize> {
    let last = candidate.coefficients.iter().map(|c| c.order + 1).max().unwrap_or(0);
    (candidate.least.max(1)..=last.max(candidate.least.max(1)))
        .map(|orders| candidate.coefficients.iter().filter(|c| c.order < orders).count())
        .collect()
}
