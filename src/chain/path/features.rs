//! What all rows along a path are made of, `docs/model.md` (14).
//!
//! Between two turns every dyad sees the same wrench, but for constant poses and for slides. So its six numbers are a constant matrix times
//! a few features: the wrench `(f, m)` as it comes into the span, and for each of the span's slides, displaced by `s`, what its force does to
//! moments: `s f` in the two directions across the way. Sums are taken over those, and made into sums over rows once, behind the samples.

use nalgebra::DMatrix;

use super::{Axis, Moved, Path, Row, Slide};
use crate::lie::{Mat3, Vec3, Wrench};
use crate::scalar::Scalar;

impl Path {
    /// How many features there are: span by span three of `f`, three of `m` and two of each slide.
    pub fn feature_count(&self) -> usize {
        self.spans.iter().map(|span| 6 + 2 * span.slides.len()).sum()
    }

    /// Features of the wrench `y_w` of frame `w`.
    #[inline(always)]
    pub fn features<T: Scalar>(&self, y_w: Wrench<T>, moved: &[Moved<T>], to: &mut (impl Row<T> + ?Sized)) {
        let (mut y, mut at) = (y_w, 0);
        for span in &self.spans {
            to.take(at, y.f.0);
            to.take(at + 3, y.m.0);
            at += 6;
            for Slide { joint, across: [a, b], .. } in &span.slides {
                let (s, like) = (moved[*joint].first, y.f.0[0]);
                to.take(at, [a.lift(like).dot(y.f) * s, b.lift(like).dot(y.f) * s]);
                at += 2;
            }
            if let Some(turn) = span.turn {
                let back = span.rotation.lift(y.f.0[0]).transpose();
                let m = y.m - span.shifted(moved).cross(y.f);
                y = Wrench { f: turn.undo(back * y.f, moved), m: turn.undo(back * m, moved) };
            }
        }
    }

    /// What each feature adds to a row, a row of the matrix for each: six columns of each dyad, and then `f` as frame `t` sees it.
    pub fn rows_by_feature(&self) -> DMatrix<f64> {
        let mut all = DMatrix::zeros(self.feature_count(), 6 * self.dyad_count() + 3);
        let zero = Vec3([0.0; 3]);
        let still = vec![Moved::none(0.0); self.joint_count().max(1)];
        let mut rows = all.row_iter_mut();
        let mut put = |row: Vec<f64>| {
            if let Some(mut to) = rows.next() {
                to.iter_mut().zip(row).for_each(|(to, x)| *to = x);
            }
        };
        for (n, span) in self.spans.iter().enumerate() {
            // Features are seen with the axis of the turn in front of the span along z, rows with the axis where it is.
            let here = match n.checked_sub(1).and_then(|before| self.spans[before].turn) {
                Some(turn) => self.axis(turn.joint).turned_z(),
                None => Mat3::identity(0.0),
            };
            let units = [0, 1, 2].map(|k| here.column(k));
            units.iter().for_each(|f| put(self.row_of_span(n, Wrench { f: *f, m: zero }, &still)));
            units.iter().for_each(|m| put(self.row_of_span(n, Wrench::couple(*m), &still)));
            for Slide { joint, across, .. } in &span.slides {
                let mut slid = still.clone();
                slid[*joint] = Moved { first: 1.0, second: 1.0 };
                for f in across.map(|f| here * f) {
                    let [there, here] =
                        [&slid, &still].map(|moved| self.row_of_span(n, Wrench { f, m: zero }, moved));
                    put(there.iter().zip(here).map(|(there, here)| there - here).collect());
                }
            }
        }
        all
    }

    fn axis(&self, joint: usize) -> Axis {
        let axes = self.steps.iter().filter_map(|step| step.joint);
        axes.fold(Axis::Z, |found, (number, axis)| if number == joint { axis } else { found })
    }

    /// The row where a wrench comes into one span, and none into the others.
    fn row_of_span(&self, span: usize, wrench: Wrench<f64>, moved: &[Moved<f64>]) -> Vec<f64> {
        let mut of_span =
            OfSpan { row: vec![0.0; 6 * self.dyad_count() + 3], wrench, turns_before: Some(span) };
        let start = of_span.wrench_here();
        let end = self.row(start, moved, &mut of_span);
        of_span.take(6 * self.dyad_count(), end.f.0);
        of_span.row
    }
}

/// A row that is added to in one span alone.
struct OfSpan {
    row: Vec<f64>,
    wrench: Wrench<f64>,
    /// How many turns are left before the span; none behind it.
    turns_before: Option<usize>,
}

impl OfSpan {
    fn wrench_here(&self) -> Wrench<f64> {
        if self.turns_before == Some(0) { self.wrench } else { Wrench::couple(Vec3([0.0; 3])) }
    }
}

impl Row<f64> for OfSpan {
    fn take<const N: usize>(&mut self, first: usize, numbers: [f64; N]) {
        self.row[..].take(first, numbers);
    }

    fn behind_turn(&mut self, _: Wrench<f64>) -> Wrench<f64> {
        self.turns_before = self.turns_before.and_then(|turns| turns.checked_sub(1));
        self.wrench_here()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chain::Chain;
    use crate::lie::{Pose, Twist};
    use crate::machine::{Machine, SHIPPED};

    #[test]
    fn features_make_the_rows_of_every_machine() {
        for (name, text) in SHIPPED {
            let machine = Machine::parse(name, text).expect("a machine that comes with the crate");
            let off =
                |n: usize| Twist::from_array(std::array::from_fn(|k| 0.1 * (1.0 + (6 * n + k) as f64).sin()));
            let dyads = machine.dyads().len();
            let mut chain = Chain::new(&machine, &(0..dyads).map(off).collect::<Vec<_>>());
            (0..dyads).step_by(2).for_each(|j| chain.set_carried(j, Pose::exp(off(7 + j))));
            let path = Path::new(&chain);
            let q: Vec<f64> = (0..machine.commands().len()).map(|c| (1.0 + c as f64).cos()).collect();
            let mut moved = vec![Moved::none(0.0); path.joint_count().max(1)];
            path.go_to(&q, &mut moved);
            let y_w = Wrench { f: Vec3([0.3, -0.8, 0.5]), m: Vec3([0.2, 0.7, -0.4]) };
            let (mut row, mut features) = (vec![0.0; 6 * dyads + 3], vec![0.0; path.feature_count()]);
            let end = path.row(y_w, &moved, &mut row[..]);
            row[..].take(6 * dyads, end.f.0);
            path.features(y_w, &moved, &mut features[..]);
            let made = path.rows_by_feature().tr_mul(&nalgebra::DVector::from_vec(features));
            let size = row.iter().fold(1.0f64, |most, x| most.max(x.abs()));
            for (c, (one, other)) in row.iter().zip(&made).enumerate() {
                assert!((one - other).abs() < 1e-13 * size, "{name}, column {c}: {one} {other}");
            }
        }
    }
}
