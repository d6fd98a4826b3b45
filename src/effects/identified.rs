//! A candidate with its numbers: sizes by name, a sentence, a RON text that needs no library.

use serde::{Deserialize, Serialize};

use super::candidate::Candidate;
use super::family::{Family, Meaning, Output};
use super::place::Place;
use super::quantity::in_words;
use crate::feature::{Binding, Dimension, Expression, Feature, Samples, Unbound};
use crate::lie::{Twist, Vec3};
use crate::machine::Machine;
use crate::variation::{Part, Slot};

/// An effect that was found.
#[derive(Clone, Debug)]
pub struct Identified<'a> {
    /// Its family.
    pub family: &'a Family,
    /// The family at its place.
    pub candidate: &'a Candidate,
    /// One number for each of [`Candidate::coefficients`], SI.
    pub coefficients: Vec<f64>,
    /// One number for each of [`Candidate::parameters`], SI.
    pub parameters: Vec<f64>,
    /// Their covariance, coefficients before parameters, SI; `None` where it is not known.
    pub covariance: Option<Vec<Vec<f64>>>,
}

/// A number that is reported.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename = "size", deny_unknown_fields)]
pub struct SizeOf {
    /// Its name.
    pub name: String,
    /// SI.
    pub value: f64,
    /// As `rad` or `m/s`.
    pub unit: String,
    /// Standard uncertainty, SI.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub std_error: Option<f64>,
    /// Unit for people, where it is not the usual one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shown: Option<String>,
}

impl SizeOf {
    /// As a machinist would say it.
    pub fn in_words(&self) -> String {
        let dimension = Dimension::parse(&self.unit, None).unwrap_or(Dimension::ONE);
        in_words(self.value, self.std_error, dimension, self.shown.as_deref())
    }
}

/// What one output gives: name, unit, value.
type Row = (String, Dimension, f64);

impl Identified<'_> {
    /// Every number that the family reports, with its standard uncertainty; peaks are those over these samples.
    pub fn sizes(&self, samples: &[Samples]) -> Vec<SizeOf> {
        let columns = self.columns(samples, &self.parameters);
        let rows = self.rows(&self.coefficients, &self.parameters, &columns);
        let errors =
            self.covariance.as_ref().map(|covariance| self.errors(samples, &columns, rows.len(), covariance));
        let shown = self.shown(rows.len());
        (rows.into_iter().enumerate())
            .map(|(i, (name, dimension, value))| SizeOf {
                name,
                value,
                unit: dimension.to_string(),
                std_error: errors.as_ref().map(|e| e[i]),
                shown: shown[i].clone(),
            })
            .collect()
    }

    fn shown(&self, rows: usize) -> Vec<Option<String>> {
        let mut shown = Vec::with_capacity(rows);
        for output in &self.family.coefficients {
            shown.extend(vec![output.shown.clone(); self.count(output)]);
        }
        shown
    }

    fn count(&self, output: &Output) -> usize {
        match &output.is {
            Meaning::Components(order) => self.of_order(*order).count(),
            Meaning::Curve => self.coefficients.len(),
            _ => 1,
        }
    }

    fn columns(&self, samples: &[Samples], parameters: &[f64]) -> Vec<Vec<f64>> {
        match self.family.coefficients.iter().any(|o| o.is == Meaning::Peak) {
            true => self.candidate.features.iter().map(|f| f.over(samples, parameters)).collect(),
            false => Vec::new(),
        }
    }

    /// `docs/effects.md` (49): to first order, by differences of a thousandth of each standard uncertainty.
    fn errors(
        &self,
        samples: &[Samples],
        columns: &[Vec<f64>],
        rows: usize,
        covariance: &[Vec<f64>],
    ) -> Vec<f64> {
        let count = self.coefficients.len();
        let slopes: Vec<Vec<f64>> = (0..count + self.parameters.len())
            .map(|i| {
                let step = 1e-3 * covariance[i][i].max(0.0).sqrt();
                if step == 0.0 || !step.is_finite() {
                    return vec![0.0; rows];
                }
                let moved = |by: f64| {
                    let (mut c, mut p) = (self.coefficients.clone(), self.parameters.clone());
                    match i < count {
                        true => c[i] += by,
                        false => p[i - count] += by,
                    }
                    match i < count {
                        true => self.rows(&c, &p, columns),
                        false => self.rows(&c, &p, &self.columns(samples, &p)),
                    }
                };
                let (up, down) = (moved(step), moved(-step));
                up.iter().zip(&down).map(|(u, d)| (u.2 - d.2) / (2.0 * step)).collect()
            })
            .collect();
        let n = slopes.len();
        let variance = |r: usize| -> f64 {
            (0..n).map(|i| (0..n).map(|k| slopes[i][r] * covariance[i][k] * slopes[k][r]).sum::<f64>()).sum()
        };
        (0..rows).map(|r| variance(r).max(0.0).sqrt()).collect()
    }

    /// Coefficients of the feature of this order, by index.
    fn of_order(&self, order: usize) -> impl Iterator<Item = usize> + '_ {
        self.candidate.coefficients.iter().enumerate().filter(move |(_, c)| c.order == order).map(|(i, _)| i)
    }

    fn rows(&self, c: &[f64], p: &[f64], columns: &[Vec<f64>]) -> Vec<Row> {
        let mut rows = Vec::new();
        for output in &self.family.coefficients {
            self.row(output, c, p, columns, &mut rows);
        }
        rows
    }

    fn row(&self, output: &Output, c: &[f64], p: &[f64], columns: &[Vec<f64>], rows: &mut Vec<Row>) {
        let found = &self.candidate.coefficients;
        let first = |order: usize| self.of_order(order).next();
        let unit = |order: usize| first(order).map_or(Dimension::ONE, |i| found[i].dimension);
        let norm = |order: usize| self.of_order(order).map(|i| c[i] * c[i]).sum::<f64>().sqrt();
        let index = |name: &str| self.candidate.parameters.iter().position(|q| q.name == name);
        let parameter = |name: &str| {
            index(name).map_or((Dimension::ONE, f64::NAN), |i| (self.candidate.parameters[i].dimension, p[i]))
        };
        let name = || output.name.clone();
        match &output.is {
            Meaning::Coefficient(order) => {
                let several = self.of_order(*order).count() > 1;
                let value = if several { norm(*order) } else { first(*order).map_or(f64::NAN, |i| c[i]) };
                rows.push((name(), unit(*order), value));
            }
            Meaning::Magnitude(order) => rows.push((name(), unit(*order), norm(*order))),
            Meaning::Amplitude(sine, cosine) => {
                let pairs = self.pairs(*sine, *cosine, c);
                let (ss, cc) = (
                    pairs.iter().map(|(s, _)| s * s).sum::<f64>(),
                    pairs.iter().map(|(_, c)| c * c).sum::<f64>(),
                );
                let sc: f64 = pairs.iter().map(|(s, c)| s * c).sum();
                // The larger singular value of the matrix with columns s and c.
                let largest = 0.5 * (ss + cc) + (0.25 * (ss - cc) * (ss - cc) + sc * sc).sqrt();
                rows.push((name(), unit(*sine), largest.sqrt()));
            }
            Meaning::Phase(sine, cosine) => {
                let pairs = self.pairs(*sine, *cosine, c);
                let largest = pairs.iter().copied().max_by(|a, b| a.0.hypot(a.1).total_cmp(&b.0.hypot(b.1)));
                let phase = largest.map_or(f64::NAN, |(s, c)| c.atan2(s));
                rows.push((name(), Dimension::ANGLE, phase));
            }
            Meaning::Parameter(of) => {
                let (dimension, value) = parameter(of);
                rows.push((name(), dimension, value));
            }
            Meaning::TurnOver(of) => {
                let (dimension, value) = parameter(of);
                rows.push((name(), Dimension::ANGLE.over(dimension), std::f64::consts::TAU / value));
            }
            Meaning::Reciprocal(of) => {
                let (dimension, value) = parameter(of);
                rows.push((name(), Dimension::ONE.over(dimension), value.recip()));
            }
            Meaning::Constant(value) => rows.push((name(), Dimension::ONE, *value)),
            Meaning::Peak => rows.push((name(), self.unit_of_deviation(), self.peak(c, columns))),
            Meaning::Components(order) => {
                for i in self.of_order(*order) {
                    let own = &found[i].direction;
                    let name = if own.is_empty() { output.name.clone() } else { own.clone() };
                    rows.push((name, found[i].dimension, c[i]));
                }
            }
            Meaning::Curve => {
                for (coefficient, value) in found.iter().zip(c) {
                    let direction = &coefficient.direction;
                    let dot = if direction.is_empty() || direction.starts_with('@') { "" } else { "_" };
                    rows.push((
                        format!("c{}{dot}{direction}", coefficient.order),
                        coefficient.dimension,
                        *value,
                    ));
                }
            }
        }
    }

    /// Coefficients of sine and cosine for every direction.
    fn pairs(&self, sine: usize, cosine: usize, c: &[f64]) -> Vec<(f64, f64)> {
        self.of_order(sine).zip(self.of_order(cosine)).map(|(s, k)| (c[s], c[k])).collect()
    }

    /// Whether a coefficient counts for peaks: translations, where there are any, else all.
    fn counts(&self, i: usize) -> bool {
        let translation = |i: usize| {
            let coefficient = &self.candidate.coefficients[i];
            coefficient.parts.first().is_some_and(|part| part.direction.v.norm() > 0.0)
        };
        translation(i) || !(0..self.coefficients.len()).any(translation)
    }

    fn unit_of_deviation(&self) -> Dimension {
        let part = (0..self.coefficients.len()).find(|i| self.counts(*i)).and_then(|i| {
            let coefficient = &self.candidate.coefficients[i];
            coefficient.parts.first()
        });
        match part {
            Some(part) if part.slot == Slot::Reading => self.unit_of_readings(),
            Some(part) if part.direction.v.norm() > 0.0 => Dimension::LENGTH,
            Some(_) => Dimension::ANGLE,
            None => Dimension::ONE,
        }
    }

    /// Of what stands on readings: those of angles have coefficients in rad, or in rad for each s.
    fn unit_of_readings(&self) -> Dimension {
        let angles = [Dimension::ANGLE, Dimension::ANGLE.over(Dimension::TIME)];
        match self.candidate.coefficients.iter().any(|c| angles.contains(&c.dimension)) {
            true => Dimension::ANGLE,
            false => Dimension::LENGTH,
        }
    }

    /// Largest length of the deviation over the samples.
    fn peak(&self, c: &[f64], columns: &[Vec<f64>]) -> f64 {
        let Some(len) = columns.first().map(Vec::len) else { return f64::NAN };
        let counted: Vec<usize> = (0..c.len()).filter(|i| self.counts(*i)).collect();
        let square = |k: usize| -> f64 {
            let mut sum = [0.0; 6];
            for i in &counted {
                let Some(part) = self.candidate.coefficients[*i].parts.first() else { continue };
                let value = c[*i] * columns[part.feature][k];
                for (s, d) in sum.iter_mut().zip(part.direction.to_array()) {
                    *s += value * d;
                }
            }
            sum.iter().map(|s| s * s).sum()
        };
        (0..len).map(square).fold(0.0, f64::max).sqrt()
    }

    /// One sentence for a machinist, with these sizes in it.
    pub fn sentence(&self, machine: &Machine, sizes: &[SizeOf]) -> String {
        self.with_sizes(&self.family.sentence, machine, sizes)
    }

    /// What to do about it, with these sizes in it.
    pub fn remedy(&self, machine: &Machine, sizes: &[SizeOf]) -> String {
        self.with_sizes(&self.family.remedy, machine, sizes)
    }

    fn with_sizes(&self, text: &str, machine: &Machine, sizes: &[SizeOf]) -> String {
        let mut text = text.replace("{at}", &self.candidate.place.name(machine));
        if let Some(partner) = self.candidate.place.partner(machine) {
            text = text.replace("{partner}", &partner);
        }
        for size in sizes {
            text = text.replace(&format!("{{{}}}", size.name), &size.in_words());
        }
        text
    }

    /// The effect as it is kept in files: expressions instead of names.
    pub fn stored(&self, machine: &Machine, sizes: &[SizeOf]) -> StoredEffect {
        let triple = |v: Vec3<f64>| (v.0[0], v.0[1], v.0[2]);
        let frame = |j: usize| machine.dyads()[j].frame.clone();
        let terms = (self.candidate.coefficients.iter().zip(&self.coefficients))
            .enumerate()
            .map(|(i, (coefficient, value))| StoredTerm {
                value: *value,
                unit: coefficient.dimension.to_string(),
                std_error: self.covariance.as_ref().map(|c| c[i][i].max(0.0).sqrt()),
                parts: (coefficient.parts.iter())
                    .map(|part| StoredPart {
                        slot: match part.slot {
                            Slot::Before(j) => StoredSlot::Before(frame(j)),
                            Slot::After(j) => StoredSlot::After(frame(j)),
                            Slot::Reading => StoredSlot::Reading,
                        },
                        v: triple(part.direction.v),
                        w: triple(part.direction.w),
                        feature: self.candidate.features[part.feature]
                            .with(&self.parameters)
                            .to_expression(machine, &[]),
                    })
                    .collect(),
            })
            .collect();
        StoredEffect {
            effect: self.candidate.effect.clone(),
            at: self.candidate.place.name(machine),
            with: self.candidate.place.partner(machine),
            says: self.sentence(machine, sizes),
            instrument: None,
            of_setup: self.family.each_setup,
            sizes: sizes.to_vec(),
            terms,
        }
    }
}

/// An effect in a calibrated file, SI. It needs no library.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename = "effect", deny_unknown_fields)]
pub struct StoredEffect {
    /// Name of the family.
    pub effect: String,
    /// Joint, frame, or `measurement`.
    pub at: String,
    /// The other joint of a pair.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub with: Option<String>,
    /// What it is, in a sentence.
    #[serde(default)]
    pub says: String,
    /// The kind of measurement whose readings it changes, where it belongs to the instrument and not to the machine.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub instrument: Option<String>,
    /// Whether it belongs to where the machine stands: every set-up has terms of its own, and a new one has to be found.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub of_setup: bool,
    /// Its sizes.
    #[serde(default)]
    pub sizes: Vec<SizeOf>,
    /// The deviation: a sum.
    pub terms: Vec<StoredTerm>,
}

/// A coefficient with what it multiplies.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename = "term", deny_unknown_fields)]
pub struct StoredTerm {
    /// The coefficient, SI.
    pub value: f64,
    /// Its unit, such as `rad` or `m/s`.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub unit: String,
    /// Its standard uncertainty.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub std_error: Option<f64>,
    /// Its parts.
    pub parts: Vec<StoredPart>,
}

/// Direction times feature in a slot.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename = "part", deny_unknown_fields)]
pub struct StoredPart {
    /// Where it stands.
    pub slot: StoredSlot,
    /// Linear part of the direction.
    pub v: (f64, f64, f64),
    /// Angular part of the direction.
    pub w: (f64, f64, f64),
    /// The feature.
    pub feature: Expression,
}

/// A slot by the name of its frame.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum StoredSlot {
    /// Before the joint of this frame.
    Before(String),
    /// Behind the joint of this frame.
    After(String),
    /// On the reading.
    Reading,
}

impl StoredEffect {
    /// Coefficients with their parts on a machine.
    ///
    /// # Errors
    /// A frame or joint that the machine does not have; a number that is none.
    pub fn bind(&self, machine: &Machine) -> Result<Vec<(f64, Vec<Part>)>, Unbound> {
        let travel = vec![None; machine.dyads().len()];
        let (own, partner, time) = (None, None, None);
        let binding = Binding { machine, own, partner, travel: &travel, time, begins: &[], parameters: &[] };
        let frame =
            |name: &String| machine.frame_index(name).ok_or_else(|| Unbound::UnknownFrame(name.clone()));
        let part = |part: &StoredPart| {
            let slot = match &part.slot {
                StoredSlot::Before(name) => Slot::Before(frame(name)?),
                StoredSlot::After(name) => Slot::After(frame(name)?),
                StoredSlot::Reading => Slot::Reading,
            };
            let ((a, b, c), (d, e, f)) = (part.v, part.w);
            let direction = [a, b, c, d, e, f];
            let endless = |e: &Expression| match e {
                Expression::Number(x)
                | Expression::Value(x, _)
                | Expression::TimeSince(x)
                | Expression::Late(x) => !x.is_finite(),
                Expression::OrderIn(begins) | Expression::BeginningIn(begins) => {
                    begins.iter().any(|(_, n)| !n.is_finite())
                }
                Expression::Between(_, from, to) => !(to > from && (to - from).is_finite()),
                _ => false,
            };
            if part.feature.any(&endless) || direction.iter().any(|x| !x.is_finite()) {
                return Err(Unbound::Number);
            }
            let direction = Twist::from_array(direction);
            Ok(Part { slot, direction, feature: Feature::bind(&part.feature, &binding)? })
        };
        let term = |term: &StoredTerm| match term.value.is_finite() {
            true => Ok((term.value, term.parts.iter().map(part).collect::<Result<_, _>>()?)),
            false => Err(Unbound::Number),
        };
        self.terms.iter().map(term).collect()
    }

    /// The place on a machine.
    pub fn place(&self, machine: &Machine) -> Option<Place> {
        let joint = |name: &str| machine.joints().find(|(_, joint)| joint.name == name).map(|(j, _)| j);
        match (self.at.as_str(), &self.with) {
            ("measurement", _) => Some(Place::Measurement),
            (at, Some(with)) => Some(Place::Pair(joint(at)?, joint(with)?)),
            (at, None) => joint(at).map(Place::Joint).or_else(|| machine.frame_index(at).map(Place::Frame)),
        }
    }
}
