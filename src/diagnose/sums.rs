//! Waves that go by the sum of two joints' positions, as gears of a wrist do that turn with both: neither joint's own waves show them, nor
//! slow waves of the one times slow waves of the other, `docs/diagnosis-method.md` (69).

use std::f64::consts::TAU;

use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;

use super::course::Course;
use super::equations::judge;
use super::evidence::{Worth, evidence};
use super::linear::Span;
use super::score::{Field, Rows};
use super::series::{Motion, Series, Standing};

/// Waves over the range of each joint: the fewest, the most, and by how many they are apart.
const FEWEST: f64 = 0.5;
const MOST: f64 = 4.0;
const APART: f64 = 0.25;
/// Where they are known as finely as this, that will do.
const FINE: f64 = 0.02;
/// Samples are put together to about so many blocks, and so many of the best sums are looked at on all rows.
const BLOCKS: usize = 1500;
const LOOKED_AT: usize = 6;

/// Sine and cosine, sample by sample.
type Wave = [Vec<f64>; 2];

/// The place and the wave along the sum of its joint's position and another one's that have the most evidence.
pub(super) fn sums(rows: &Rows, field: &Field, courses: &[Course], overdispersion: f64) -> Option<Standing> {
    let (best, tried) = screened(rows, field, courses);
    let judged = |sum: Sum| Some((sum, sum.judged(rows, field, courses, overdispersion)?));
    let better = |x: &(Sum, Standing), y: &(Sum, Standing)| x.1.evidence.total_cmp(&y.1.evidence);
    let (mut sum, mut standing) = best.into_iter().filter_map(judged).max_by(better)?;
    // Between the numbers that were tried it may be better.
    let mut apart = 0.5 * APART;
    while apart > FINE {
        let around = [[apart, 0.0], [-apart, 0.0], [0.0, apart], [0.0, -apart]];
        let moved = around.map(|by| Sum { waves: [0, 1].map(|k| sum.waves[k] + by[k]), ..sum });
        let best = moved.into_iter().filter_map(judged).max_by(better);
        match best.filter(|(_, of)| of.evidence > standing.evidence) {
            Some(moved) => (sum, standing) = moved,
            None => apart *= 0.5,
        }
    }
    Some(Standing { evidence: standing.evidence - (tried as f64).ln(), ..standing })
}

/// The sums that seem to take away most, the best first, on blocks of samples and as if nothing were known besides; and how many were tried.
fn screened(rows: &Rows, field: &Field, courses: &[Course]) -> (Vec<Sum>, usize) {
    let blocks = Blocks::new(rows);
    let waves: Vec<Vec<Wave>> =
        courses.iter().map(|course| waves(&blocks.in_middles(&course.along))).collect();
    let back = rows.whitener.transposed(field.left.as_slice());
    let of_pair = |of: [usize; 2]| {
        let places = [false, true].map(|translates| {
            let motions = motions(&courses[of[0]], translates);
            (translates, blocks.screens(rows, &motions, &back))
        });
        let mut all: Vec<Sum> = Vec::new();
        for (i, first) in waves[of[0]].iter().enumerate() {
            for (j, second) in waves[of[1]].iter().enumerate() {
                for sign in [1.0, -1.0] {
                    let wave = joined(first, second, sign);
                    let [one, other] = [i, j].map(|k| FEWEST + k as f64 * APART);
                    all.extend(places.iter().map(|(translates, screens)| Sum {
                        of,
                        translates: *translates,
                        waves: [one, sign * other],
                        rough: screens.iter().map(|screen| screen.energy(&wave) - 2.0).sum(),
                    }));
                }
            }
        }
        let tried = all.len();
        (best_of(all), tried)
    };
    let pairs = (0..courses.len())
        .flat_map(|a| (0..courses.len()).filter(move |b| a != *b).map(move |b| [a, b]))
        .collect::<Vec<_>>();
    let found: Vec<(Vec<Sum>, usize)> = pairs.into_par_iter().map(of_pair).collect();
    let tried = found.iter().map(|(_, tried)| tried).sum();
    (best_of(found.into_iter().flat_map(|(best, _)| best).collect()), tried)
}

/// Those that are looked at, the best first.
fn best_of(mut sums: Vec<Sum>) -> Vec<Sum> {
    sums.sort_by(|x, y| y.rough.total_cmp(&x.rough));
    sums.truncate(LOOKED_AT);
    sums
}

/// A joint's own motion, or translations of the frame that it stands on.
fn motions(course: &Course, translates: bool) -> Vec<Motion> {
    if translates { course.translations() } else { vec![course.own()] }
}

/// A wave along the sum of two joints' positions.
#[derive(Clone, Copy)]
struct Sum {
    /// The courses of both; the first one's joint is the place.
    of: [usize; 2],
    /// Whether the frame that the joint stands on is displaced, and not the joint along its own motion.
    translates: bool,
    /// How many waves over either one's range.
    waves: [f64; 2],
    /// Energy that it takes away beside nothing, less what chance would.
    rough: f64,
}

impl Sum {
    /// What it is worth on all rows, beside what is known.
    fn judged(
        &self,
        rows: &Rows,
        field: &Field,
        courses: &[Course],
        overdispersion: f64,
    ) -> Option<Standing> {
        let [first, second] = self.of.map(|of| &courses[of]);
        let phases =
            first.along.iter().zip(&second.along).map(|(x, y)| self.waves[0] * x + self.waves[1] * y);
        let (sines, cosines) = phases.map(|phase| (TAU * phase).sin_cos()).unzip();
        let series =
            Series::of(first.joint, second.joint, motions(first, self.translates), vec![sines, cosines]);
        let columns = series.columns(rows);
        let (mut standing, count) = (None, columns.ncols());
        judge((&columns, count), &field.marginal, &field.left, &[0], &mut |_, equations| {
            let Worth { evidence, gain, .. } =
                evidence(&equations.gram, &equations.toward, count, overdispersion, 0);
            standing = Some(series.standing(evidence, gain));
        });
        standing
    }
}

/// All waves over a range that a position goes through from 0 to 1.
fn waves(along: &[f64]) -> Vec<Wave> {
    let count = ((MOST - FEWEST) / APART).round() as usize;
    let wave = |k: usize| {
        let number = FEWEST + k as f64 * APART;
        let (sines, cosines) = along.iter().map(|x| (TAU * number * x).sin_cos()).unzip();
        [sines, cosines]
    };
    (0..=count).map(wave).collect()
}

/// Sine and cosine of the sum of two phases, or of their difference.
fn joined([sa, ca]: &Wave, [sb, cb]: &Wave, sign: f64) -> Wave {
    let mut wave = [vec![0.0; sa.len()], vec![0.0; sa.len()]];
    let [sines, cosines] = &mut wave;
    for (k, (sine, cosine)) in sines.iter_mut().zip(cosines).enumerate() {
        *sine = sa[k] * cb[k] + sign * ca[k] * sb[k];
        *cosine = ca[k] * cb[k] - sign * sa[k] * sb[k];
    }
    wave
}

/// Samples of every recording put together.
struct Blocks {
    /// First sample of each, and behind its last one.
    ends: Vec<(usize, usize)>,
}

impl Blocks {
    fn new(rows: &Rows) -> Self {
        let spans = &rows.linear.spans;
        let count = spans.last().map_or(0, |span| span.samples.1);
        let size = count.div_ceil(BLOCKS).max(1);
        let cut = |span: &Span| {
            let (from, to) = span.samples;
            (from..to).step_by(size).map(move |first| (first, (first + size).min(to))).collect::<Vec<_>>()
        };
        Blocks { ends: spans.iter().flat_map(cut).collect() }
    }

    fn in_middles(&self, column: &[f64]) -> Vec<f64> {
        self.ends.iter().map(|(from, to)| column[(from + to) / 2]).collect()
    }

    /// For each motion what its answers, times a wave, lead to the residuals, and their squares; `back`: whitened residuals, whitened once more by the
    /// transposed. Squares leave the noise's memory aside, which all waves do alike.
    fn screens(&self, rows: &Rows, motions: &[Motion], back: &[f64]) -> Vec<Screen> {
        let one = |(slot, direction): &Motion| {
            let answer = rows.answer(*slot, *direction);
            let mut white = vec![0.0; answer.len()];
            rows.whitener.plain(&answer, &mut white);
            let count = self.ends.last().map_or(0, |block| block.1);
            let (mut toward, mut square) = (vec![0.0; count], vec![0.0; count]);
            for (row, sample) in rows.linear.sample.iter().enumerate() {
                toward[*sample] += answer[row] * back[row];
                square[*sample] += white[row] * white[row];
            }
            let sum = |of: &[f64]| -> Vec<f64> {
                self.ends.iter().map(|(from, to)| of[*from..*to].iter().sum()).collect()
            };
            Screen { toward: sum(&toward), square: sum(&square) }
        };
        motions.iter().map(one).collect()
    }
}

/// A motion's answers, block by block.
struct Screen {
    toward: Vec<f64>,
    square: Vec<f64>,
}

impl Screen {
    /// Energy that sine and cosine take away together, beside nothing.
    fn energy(&self, [sines, cosines]: &Wave) -> f64 {
        let (mut toward, mut gram) = ([0.0; 2], [0.0; 3]);
        for (((t, square), s), c) in self.toward.iter().zip(&self.square).zip(sines).zip(cosines) {
            toward[0] += t * s;
            toward[1] += t * c;
            gram[0] += square * s * s;
            gram[1] += square * s * c;
            gram[2] += square * c * c;
        }
        let toward = Vector2::from(toward);
        let gram = Matrix2::new(gram[0], gram[1], gram[1], gram[2]);
        gram.cholesky().map_or(0.0, |factor| toward.dot(&factor.solve(&toward)))
    }
}
