//! Series that structure without a name is foretold by: motions that a place can make, times functions of what it knows,
//! `docs/diagnosis-method.md` (69).

use std::f64::consts::PI;

use nalgebra::DMatrix;

use super::coarse::Level;
use super::equations::Column;
use super::score::Rows;
use crate::effects::Place;
use crate::lie::Twist;
use crate::scalar::sines_cosines;
use crate::variation::Slot;

/// Orders of what is smooth, along a joint's travel or over time.
const SMOOTH: usize = 12;
/// Usual sizes of errors, m and rad.
const USUAL: (f64, f64) = (3e-6, 3e-5);

/// A way in which a place can move.
pub(super) type Motion = (Slot, Twist<f64>);

/// Translation along an axis of the frame, from 0 on, or from 3 on rotation about one.
pub(super) fn unit(k: usize) -> Twist<f64> {
    Twist::from_array(std::array::from_fn(|i| f64::from(u8::from(i == k))))
}

/// Motions at one place, times one series of curves.
pub(super) struct Series {
    pub place: Place,
    /// Another joint whose position it goes with.
    pub with: Option<usize>,
    pub motions: Vec<Motion>,
    pub curves: Vec<Vec<f64>>,
    /// Whether the curves jump, which blocks of samples might hide.
    pub jumps: bool,
}

/// A series that stands out.
#[derive(Clone, Copy, Debug)]
pub(super) struct Standing {
    pub place: Place,
    /// Another joint whose position it goes with.
    pub with: Option<usize>,
    /// Logarithm of its evidence.
    pub evidence: f64,
    /// Half the energy that it takes away.
    pub gain: f64,
}

impl Series {
    /// Of a joint that goes with another one, without blocks.
    pub fn of(joint: usize, with: usize, motions: Vec<Motion>, curves: Vec<Vec<f64>>) -> Self {
        Series { place: Place::Joint(joint), with: Some(with), motions, curves, jumps: true }
    }

    pub fn standing(&self, evidence: f64, gain: f64) -> Standing {
        Standing { place: self.place, with: self.with, evidence, gain }
    }

    /// The level on whose blocks its curves change little, the longest first.
    pub fn level(&self, rows: &Rows) -> Option<usize> {
        let follows = |level: &Level| self.curves.iter().all(|curve| level.follows(curve));
        let levels = rows.coarse.levels();
        (!self.jumps).then(|| levels.iter().position(follows)).flatten()
    }

    /// One whitened column for each motion and curve, times the size usual on machines.
    pub fn columns(&self, rows: &Rows) -> DMatrix<f64> {
        let answers = self.motions.iter().map(|(slot, direction)| rows.answer(*slot, *direction));
        let mut columns = self.products(answers.collect(), &self.curves, &rows.linear.sample);
        rows.whiten(&mut columns);
        columns
    }

    /// The same on the blocks of a level.
    pub fn on_blocks(&self, rows: &Rows, number: usize) -> DMatrix<f64> {
        let level = &rows.coarse.levels()[number];
        let answers =
            self.motions.iter().map(|(slot, direction)| rows.coarse_answer(number, *slot, *direction));
        let curves: Vec<Vec<f64>> = self.curves.iter().map(|curve| level.in_middles(curve)).collect();
        self.products(answers.collect(), &curves, &level.sample)
    }

    /// Every answer times every curve; `sample`: of each row.
    fn products(&self, answers: Vec<Column>, curves: &[Vec<f64>], sample: &[usize]) -> DMatrix<f64> {
        let mut columns = DMatrix::zeros(sample.len(), answers.len() * curves.len());
        let of =
            answers.iter().zip(&self.motions).flat_map(|(a, (_, d))| curves.iter().map(move |c| (a, d, c)));
        for (mut column, (answer, direction, curve)) in columns.column_iter_mut().zip(of) {
            let turns = direction.to_array()[3..].iter().any(|w| *w != 0.0);
            let size = if turns { USUAL.1 } else { USUAL.0 };
            for ((x, answer), sample) in column.iter_mut().zip(answer.iter()).zip(sample) {
                *x = size * answer * curve[*sample];
            }
        }
        columns
    }
}

/// `cos nπx` of what runs from 0 to 1, for these orders: any smooth function.
pub(super) fn series(x: &[f64], from: usize, to: usize) -> Vec<Vec<f64>> {
    let angles = |n: usize| x.iter().map(|x| n as f64 * PI * x).collect::<Vec<f64>>();
    (from..=to).map(|n| sines_cosines(&angles(n)).1).collect()
}

/// Chebyshev polynomials of what runs from 0 to 1: what is smooth needs few of them, and says something at the ends too.
pub(super) fn smooth(x: &[f64]) -> Vec<Vec<f64>> {
    let angles: Vec<f64> = x.iter().map(|x| (2.0 * x - 1.0).clamp(-1.0, 1.0).acos() / PI).collect();
    series(&angles, 1, SMOOTH)
}

/// From 0 to 1 over what there is, and how much that is; `None` where it stands still.
pub(super) fn over_range(x: &[f64]) -> Option<(Vec<f64>, f64)> {
    let low = x.iter().copied().fold(f64::INFINITY, f64::min);
    let range = x.iter().copied().fold(f64::NEG_INFINITY, f64::max) - low;
    (range > 1e-9).then(|| (x.iter().map(|x| (x - low) / range).collect(), range))
}
