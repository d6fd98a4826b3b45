//! Samples put together where joints stand alike, whenever that was: a function of where one or two joints stand is judged on sums over cells,
//! which cost the same however many samples there are.

use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, Mutex, OnceLock};

use super::equations::{Key, key};
use super::features::{AtPoint, Features, is_near};
use super::linear::Linear;
use super::panel::Panel;
use crate::effects::Candidate;
use crate::feature::{Feature, Samples};

/// About so many cells along one joint, and along each of two; for what is finer along one joint, each sample is a cell, next to its
/// neighbours there, or a few are.
const CELLS: usize = 512;
const SIDE: usize = 24;
const FINEST: usize = 8192;
/// Sums over cells are worth their memory from so many columns for each answer of the machine on.
const COLUMNS: usize = 4;

/// Joints by index of their dyad, and whether it matters from which side they came.
type Joints = BTreeMap<usize, bool>;

/// Samples by where some joints stand.
pub(super) struct Cells {
    /// Cell of each sample.
    pub(super) cell: Vec<usize>,
    /// Samples of each cell.
    pub(super) count: Vec<f64>,
    /// The sample that stands for each cell.
    middle: Vec<usize>,
    /// What features see of those, recording by recording.
    samples: Vec<Samples>,
}

/// All cells, and the features of each candidate on its cells over its grid, once they have been asked for.
pub(super) struct AllCells {
    of_joints: Mutex<Known>,
    kept: Vec<OnceLock<Option<InCells>>>,
}

/// Cells by the joints that they are of, and how many strips there are along each.
type Known = HashMap<(Joints, usize), Option<Arc<Cells>>>;

/// Cells, and the features of a candidate on them.
pub(super) type InCells = (Arc<Cells>, Features);

/// What an answer of the machine makes of a marginal and of the residuals, cell by cell.
pub(super) struct CellSums {
    pub(super) along: Vec<Arc<Panel>>,
    pub(super) toward: Vec<f64>,
}

impl AllCells {
    pub fn new(candidates: usize) -> Self {
        AllCells { of_joints: Mutex::default(), kept: (0..candidates).map(|_| OnceLock::new()).collect() }
    }

    /// Features of candidate `i` over its grid, if they are functions of where one or two joints stand that change little within a cell.
    pub fn features(&self, i: usize, candidate: &Candidate, linear: &Linear) -> Option<&InCells> {
        let first = || {
            let columns = candidate.grid.len() * candidate.coefficients.len();
            if columns < COLUMNS * answers(candidate).len() {
                return None;
            }
            let joints = joints(&candidate.features)?;
            let each = linear.lines.len().min(FINEST);
            let sizes = if joints.len() == 1 { &[CELLS, each][..] } else { &[SIDE] };
            sizes.iter().find_map(|strips| {
                let cells = self.cells(joints.clone(), *strips, linear)?;
                let samples = (&linear.samples[..], &cells.samples[..]);
                let follows = |column: &[f64]| cells.follows(column);
                let rms = |at: &AtPoint, feature: usize| cells.root_mean_square(at, feature);
                let features = Features::over(candidate, samples, None, follows, rms)?;
                Some((cells, features))
            })
        };
        self.kept[i].get_or_init(first).as_ref()
    }

    fn cells(&self, joints: Joints, strips: usize, linear: &Linear) -> Option<Arc<Cells>> {
        let mut known = self.of_joints.lock().ok()?;
        let new = |(joints, strips): &(Joints, usize)| Cells::new(joints, *strips, linear).map(Arc::new);
        known.entry((joints, strips)).or_insert_with_key(new).clone()
    }
}

/// The joints on whose position all these features depend, if on nothing else and on no more than two.
fn joints(features: &[Feature]) -> Option<Joints> {
    let mut all = Joints::new();
    for feature in features {
        for (joint, from_side) in feature.stands_on()? {
            *all.entry(joint).or_default() |= from_side;
        }
    }
    (1..=2).contains(&all.len()).then_some(all)
}

/// The answers of the machine that a candidate's coefficients need, each once.
pub(super) fn answers(candidate: &Candidate) -> Vec<Key> {
    let parts = candidate.coefficients.iter().flat_map(|c| &c.parts);
    let mut keys: Vec<Key> = parts.map(|part| key(part.slot, part.direction)).collect();
    keys.sort_unstable();
    keys.dedup();
    keys
}

impl Cells {
    /// So many strips along each joint.
    fn new(joints: &Joints, strips: usize, linear: &Linear) -> Option<Self> {
        let count = linear.lines.len();
        let mut places: Vec<(f64, Vec<f64>)> = vec![(0.0, Vec::new()); count];
        for (samples, span) in linear.samples.iter().zip(&linear.spans) {
            for (j, from_side) in joints {
                let columns = samples.joints[*j].as_ref()?;
                for (k, place) in places[span.samples.0..span.samples.1].iter_mut().enumerate() {
                    place.1.push(columns.position[k]);
                    // Each side of each joint is a digit.
                    place.0 = 3.0 * place.0 + if *from_side { columns.direction[k] } else { 0.0 };
                }
            }
        }
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by(|a, b| places[*a].0.total_cmp(&places[*b].0));
        let mut groups: Vec<Vec<usize>> = Vec::new();
        for side in order.chunk_by(|a, b| places[*a].0 == places[*b].0) {
            let mut strip_of: Vec<Vec<usize>> = vec![side.to_vec()];
            for joint in 0..joints.len() {
                strip_of = strip_of
                    .into_iter()
                    .flat_map(|mut group| {
                        group.sort_by(|a, b| places[*a].1[joint].total_cmp(&places[*b].1[joint]));
                        let size = group.len().div_ceil(strips).max(1);
                        group.chunks(size).map(<[usize]>::to_vec).collect::<Vec<_>>()
                    })
                    .collect();
            }
            groups.extend(strip_of);
        }
        Some(Self::of(groups, linear))
    }

    /// From the samples of each cell.
    fn of(mut groups: Vec<Vec<usize>>, linear: &Linear) -> Self {
        let span_of = |group: &Vec<usize>| {
            linear.spans.partition_point(|span| span.samples.1 <= group[group.len() / 2])
        };
        groups.sort_by_key(span_of);
        let mut cells = Cells {
            cell: vec![0; linear.lines.len()],
            count: groups.iter().map(|group| group.len() as f64).collect(),
            middle: groups.iter().map(|group| group[group.len() / 2]).collect(),
            samples: Vec::new(),
        };
        groups.iter().enumerate().for_each(|(c, group)| group.iter().for_each(|s| cells.cell[*s] = c));
        for (samples, span) in linear.samples.iter().zip(&linear.spans) {
            let inside = |sample: &&usize| (span.samples.0..span.samples.1).contains(*sample);
            let own: Vec<usize> = cells.middle.iter().filter(inside).map(|s| s - span.samples.0).collect();
            cells.samples.push(samples.chosen(&own));
        }
        cells
    }

    /// Whether a column changes little within a cell.
    fn follows(&self, column: &[f64]) -> bool {
        let middle = self.cell.iter().map(|cell| column[self.middle[*cell]]);
        is_near(column, middle)
    }

    /// Of a feature over all samples.
    fn root_mean_square(&self, features: &AtPoint, feature: usize) -> f64 {
        let count = features.runs.iter().flat_map(|(from, count)| &self.count[*from..from + count]);
        let square: f64 =
            features.columns[feature].iter().zip(count).map(|(x, n)| n * f64::from(*x).powi(2)).sum();
        (square / self.count.iter().sum::<f64>()).sqrt()
    }
}
