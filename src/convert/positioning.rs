//! How well an axis comes to targets: the figures of ISO 230-2.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// What was read at a target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Reading {
    pub line: usize,
    pub run: usize,
    /// mm or deg.
    pub target: f64,
    /// Whether the axis came in the positive sense.
    pub from_below: bool,
    /// Actual less target, m or rad.
    pub deviation: f64,
}

/// Figures of ISO 230-2:2014 of one axis, m or rad.
///
/// ```math
/// B_i = x̄_i↑ - x̄_i↓      R_i = max(2 s_i↑ + 2 s_i↓ + |B_i|, 4 s_i↑, 4 s_i↓)      A = max(x̄_i + 2 s_i) - min(x̄_i - 2 s_i)
/// ```
///
/// `x̄_i↑`, `s_i↑`: mean and standard uncertainty of the deviations (actual less target) at target i, approached in the positive sense.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Positioning {
    /// The joint.
    pub joint: String,
    /// Unit of all figures, `m` or `rad`.
    pub unit: String,
    /// How many targets there are.
    pub targets: usize,
    /// Fewest readings at a target, approached in the positive and in the negative sense.
    pub runs: [usize; 2],
    /// Of approaches in the positive sense, where there are any.
    pub forward: Option<OneWay>,
    /// Of approaches in the negative sense.
    pub backward: Option<OneWay>,
    /// Of both, where every target was approached in both.
    pub both: Option<BothWays>,
}

/// Unidirectional figures, m or rad.
#[non_exhaustive]
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct OneWay {
    /// A↑ or A↓, accuracy; `None` where a target was read only once.
    pub accuracy: Option<f64>,
    /// R↑ or R↓, repeatability.
    pub repeatability: Option<f64>,
    /// E↑ or E↓, systematic deviation.
    pub systematic: f64,
}

/// Bidirectional figures, m or rad.
#[non_exhaustive]
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BothWays {
    /// A, accuracy; `None` where a target was read only once in a sense.
    pub accuracy: Option<f64>,
    /// R, repeatability.
    pub repeatability: Option<f64>,
    /// E, systematic deviation.
    pub systematic: f64,
    /// B, the largest reversal value.
    pub reversal: f64,
    /// The mean reversal value, with its sign.
    pub mean_reversal: f64,
    /// M, the range of the mean bidirectional deviation.
    pub mean_deviation: f64,
}

/// Mean and spread of the readings at one target in one sense.
#[derive(Clone, Copy)]
struct Approach {
    count: usize,
    mean: f64,
    /// Standard deviation; `None` of a single reading.
    s: Option<f64>,
}

impl Approach {
    fn of(readings: &[f64]) -> Option<Approach> {
        let count = readings.len();
        let mean = readings.iter().sum::<f64>() / count as f64;
        let squares: f64 = readings.iter().map(|x| (x - mean).powi(2)).sum();
        let s = (count > 1).then(|| (squares / (count - 1) as f64).sqrt());
        (count > 0).then_some(Approach { count, mean, s })
    }
}

impl Positioning {
    /// Of readings at targets.
    pub(super) fn of(joint: &str, angular: bool, readings: &[Reading]) -> Positioning {
        let mut targets: BTreeMap<i64, [Vec<f64>; 2]> = BTreeMap::new();
        for reading in readings {
            // Targets that are one are written alike; a billionth of a mm or a degree tells others apart.
            let own = targets.entry((reading.target * 1e9).round() as i64).or_default();
            own[usize::from(!reading.from_below)].push(reading.deviation);
        }
        let all: Vec<[Option<Approach>; 2]> =
            targets.values().map(|senses| [0, 1].map(|way: usize| Approach::of(&senses[way]))).collect();
        let fewest = |way: usize| all.iter().map(|at| at[way].map_or(0, |own| own.count)).min().unwrap_or(0);
        let way = |way: usize| all.iter().map(|at| at[way]).collect::<Option<Vec<Approach>>>();
        let (up, down) = (way(0), way(1));
        Positioning {
            joint: joint.into(),
            unit: if angular { "rad" } else { "m" }.into(),
            targets: all.len(),
            runs: [fewest(0), fewest(1)],
            forward: up.as_deref().and_then(OneWay::of),
            backward: down.as_deref().and_then(OneWay::of),
            both: up.zip(down).and_then(|(up, down)| BothWays::of(&up, &down)),
        }
    }

    /// In lines for people, um or arcsec.
    pub fn in_words(&self) -> Vec<String> {
        let (per, unit) =
            if self.unit == "rad" { (1f64.to_degrees() * 3600.0, "arcsec") } else { (1e6, "um") };
        let number = |x: f64| three(x * per);
        let all = |list: &[(&str, Option<f64>)]| {
            let named = list.iter().filter_map(|(name, x)| Some(format!("{name} {}", number((*x)?))));
            named.collect::<Vec<_>>().join("  ")
        };
        let [up, down] = self.runs;
        let mut lines = vec![format!(
            "ISO 230-2, {}: {} targets, each approached {up} times in the positive sense and {down} times in the negative; {unit}",
            self.joint, self.targets
        )];
        if let Some(both) = &self.both {
            lines.push(format!(
                "  both senses  {}",
                all(&[
                    ("A", both.accuracy),
                    ("R", both.repeatability),
                    ("E", Some(both.systematic)),
                    ("B", Some(both.reversal)),
                    ("mean B", Some(both.mean_reversal)),
                    ("M", Some(both.mean_deviation)),
                ])
            ));
        }
        for (sense, way) in [("positive", &self.forward), ("negative", &self.backward)] {
            if let Some(way) = way {
                let figures = [("A", way.accuracy), ("R", way.repeatability), ("E", Some(way.systematic))];
                lines.push(format!("  {sense}     {}", all(&figures)));
            }
        }
        if up.max(down) < 5 {
            lines.push("  the standard asks for five runs in each sense".into());
        }
        lines
    }
}

/// Three digits that count.
fn three(x: f64) -> String {
    let digits = (2.0 - x.abs().max(1e-9).log10().floor()).clamp(0.0, 9.0) as usize;
    format!("{x:.digits$}")
}

fn range(values: impl Iterator<Item = f64>) -> f64 {
    let (low, high) =
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
    high - low
}

/// Ends of what two standard uncertainties to either side reach.
fn reach(at: &[Approach]) -> Option<Vec<f64>> {
    let ends = at.iter().map(|own| own.s.map(|s| [own.mean + 2.0 * s, own.mean - 2.0 * s]));
    Some(ends.collect::<Option<Vec<_>>>()?.concat())
}

fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, f64::max)
}

impl OneWay {
    fn of(at: &[Approach]) -> Option<OneWay> {
        let s = at.iter().map(|own| own.s).collect::<Option<Vec<f64>>>();
        (!at.is_empty()).then(|| OneWay {
            accuracy: reach(at).map(|ends| range(ends.into_iter())),
            repeatability: s.map(|all| 4.0 * largest(all.into_iter())),
            systematic: range(at.iter().map(|own| own.mean)),
        })
    }
}

impl BothWays {
    fn of(up: &[Approach], down: &[Approach]) -> Option<BothWays> {
        let pairs = || up.iter().zip(down);
        let reversals: Vec<f64> = pairs().map(|(a, b)| a.mean - b.mean).collect();
        let repeatability = |(a, b): (&Approach, &Approach)| {
            let (a, b, reversal) = (a.s?, b.s?, (a.mean - b.mean).abs());
            Some((2.0 * a + 2.0 * b + reversal).max(4.0 * a).max(4.0 * b))
        };
        let both = [up, down].concat();
        (!up.is_empty()).then(|| BothWays {
            accuracy: reach(&both).map(|ends| range(ends.into_iter())),
            repeatability: pairs()
                .map(repeatability)
                .collect::<Option<Vec<f64>>>()
                .map(|all| largest(all.into_iter())),
            systematic: range(both.iter().map(|own| own.mean)),
            reversal: largest(reversals.iter().map(|b| b.abs())),
            mean_reversal: reversals.iter().sum::<f64>() / reversals.len() as f64,
            mean_deviation: range(pairs().map(|(a, b)| 0.5 * (a.mean + b.mean))),
        })
    }
}
