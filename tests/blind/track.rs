//! What every joint has been through at each sample: the history that play, friction and warm-up depend on.

use super::body::Body;
use super::path::Run;

/// The history of one joint over all recordings of a case, one after the other.
#[derive(Clone, Debug)]
pub struct JointTrack {
    pub q: Vec<f64>,
    pub v: Vec<f64>,
    pub a: Vec<f64>,
    /// Direction of travel, -1 or 1; 0 for a joint that never moves.
    pub direction: Vec<f64>,
    /// Way gone since the last reversal; infinite before the first one.
    pub since: Vec<f64>,
    /// Way gone from the sample before within a recording, signed.
    pub step: Vec<f64>,
    pub low: f64,
    pub high: f64,
}

impl JointTrack {
    /// Where a sample lies between the ends of what is seen, 0 to 1.
    pub fn share(&self, k: usize) -> f64 {
        (self.q[k] - self.low) / self.span().max(1e-12)
    }

    pub fn span(&self) -> f64 {
        self.high - self.low
    }
}

/// All samples of a case on one clock; the judge's recording comes last.
#[derive(Clone, Debug)]
pub struct Track {
    pub time: Vec<f64>,
    /// First sample of each run, and one past the last.
    pub starts: Vec<usize>,
    /// How many samples belong to the recordings, without the judge's.
    pub recorded: usize,
    /// Of each link's joint.
    pub joints: Vec<Option<JointTrack>>,
    pub settled: bool,
}

impl Track {
    /// `runs`: the recordings and, last, the judge's path.
    pub fn of(body: &Body, runs: &[Run]) -> Self {
        let mut starts = vec![0];
        for run in runs {
            starts.push(starts[starts.len() - 1] + run.time.len());
        }
        let time = runs.iter().flat_map(|r| r.time.iter().copied()).collect();
        let joints = body.links.iter().map(|l| {
            let terms = &l.joint.as_ref()?.terms;
            let sum = |row: &Vec<f64>| terms.iter().map(|(c, f)| f * row[*c]).sum::<f64>();
            let of = |rows: fn(&Run) -> &Vec<Vec<f64>>| -> Vec<f64> {
                runs.iter().flat_map(|r| rows(r).iter().map(sum)).collect()
            };
            let stated = runs.iter().all(|r| r.stated.is_some());
            let stated: Option<Vec<f64>> =
                stated.then(|| runs.iter().flat_map(|r| r.stated.iter().flatten().copied()).collect());
            Some(history(of(|r| &r.commands), of(|r| &r.velocity), of(|r| &r.acceleration), &starts, stated))
        });
        Track {
            time,
            recorded: starts[starts.len() - 2],
            joints: joints.collect(),
            settled: runs.iter().any(|r| r.settled),
            starts,
        }
    }

    /// Time over the whole case, 0 to 1.
    pub fn age(&self, k: usize) -> f64 {
        let (from, to) = (self.time[0], self.time[self.time.len() - 1]);
        (self.time[k] - from) / (to - from)
    }

    /// Length of the recordings, without the judge's, s.
    pub fn seen_s(&self) -> f64 {
        self.time[self.recorded - 1] - self.time[0]
    }

    pub fn len(&self) -> usize {
        self.time.len()
    }
}

/// Directions hold through pauses and from one recording to the next; how the machine got from one to the next is not seen.
fn history(q: Vec<f64>, v: Vec<f64>, a: Vec<f64>, starts: &[usize], stated: Option<Vec<f64>>) -> JointTrack {
    let low = q.iter().copied().fold(f64::INFINITY, f64::min);
    let high = q.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut step: Vec<f64> = (0..q.len()).map(|k| if k == 0 { 0.0 } else { q[k] - q[k - 1] }).collect();
    starts.iter().filter(|s| **s < q.len()).for_each(|s| step[*s] = 0.0);
    let least = (high - low) * 1e-9 + 1e-12;
    let mut direction = vec![0.0; q.len()];
    let mut since = vec![f64::INFINITY; q.len()];
    let (mut now, mut way) = (0.0, f64::INFINITY);
    for k in 0..q.len() {
        let sign = match &stated {
            Some(stated) => stated[k],
            None if step[k].abs() > least => step[k].signum(),
            None => now,
        };
        if now != 0.0 && sign != now {
            way = 0.0;
        }
        way += step[k].abs();
        now = sign;
        (direction[k], since[k]) = (now, way);
    }
    // Before the first motion: as in the first motion.
    if let Some(first) = direction.iter().copied().find(|d| *d != 0.0) {
        direction.iter_mut().take_while(|d| **d == 0.0).for_each(|d| *d = first);
    }
    JointTrack { q, v, a, direction, since, step, low, high }
}
