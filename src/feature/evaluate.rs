//! Features over samples, column by column, for every kind of [`Scalar`].

use num_dual::DualSVec64;

use super::bind::Feature;
use super::node::{Column, Function, Node};
use super::{JointSamples, Samples};
use crate::scalar::Scalar;

/// What the parts of a feature that have history carry from one stretch of samples to the next.
#[derive(Clone, Debug)]
pub struct Memory<S>(Vec<Option<Past<S>>>);

#[derive(Clone, Copy, Debug)]
struct Past<S> {
    value: S,
    /// Position (m or rad) or time (s) at which it was reached.
    at: f64,
}

impl<S: Scalar> Memory<S> {
    /// Nothing seen yet.
    pub fn new(feature: &Feature) -> Self {
        Memory(vec![None; feature.memories])
    }
}

/// Number of a sample of a recording that others know nothing of: it comes after all of them.
const AFTERWARDS: f64 = 1e12;

/// One number for all samples, or one for each.
enum Value<S> {
    Constant(S),
    Column(Vec<S>),
}

impl<S: Scalar> Value<S> {
    fn map(self, f: impl Fn(S) -> S) -> Self {
        match self {
            Value::Constant(c) => Value::Constant(f(c)),
            Value::Column(mut column) => {
                column.iter_mut().for_each(|x| *x = f(*x));
                Value::Column(column)
            }
        }
    }

    fn zip(self, other: Self, f: impl Fn(S, S) -> S) -> Self {
        match (self, other) {
            (Value::Constant(a), Value::Constant(b)) => Value::Constant(f(a, b)),
            (Value::Column(mut a), Value::Constant(b)) => {
                a.iter_mut().for_each(|x| *x = f(*x, b));
                Value::Column(a)
            }
            (Value::Constant(a), Value::Column(mut b)) => {
                b.iter_mut().for_each(|y| *y = f(a, *y));
                Value::Column(b)
            }
            (Value::Column(mut a), Value::Column(b)) => {
                a.iter_mut().zip(&b).for_each(|(x, y)| *x = f(*x, *y));
                Value::Column(a)
            }
        }
    }

    fn at(&self, k: usize) -> S {
        match self {
            Value::Constant(c) => *c,
            Value::Column(column) => column[k],
        }
    }
}

/// One evaluation.
struct Pass<'a, S> {
    samples: &'a Samples,
    parameters: &'a [S],
    one: S,
    memory: &'a mut Memory<S>,
}

impl Feature {
    /// Its value at every sample; `one` is 1 of the kind of scalar wanted. What is missing from the samples (time, rates, a
    /// channel) makes NaN.
    ///
    /// `memory` carries play, take-up and low-passes on from the stretch before; stretches come in their order. The first
    /// stretch of a recording starts play and take-up anew, on the side of the first motion.
    ///
    /// # Panics
    /// If there are fewer parameters than it has.
    pub fn column<S: Scalar>(
        &self,
        samples: &Samples,
        parameters: &[S],
        one: S,
        memory: &mut Memory<S>,
    ) -> Vec<S> {
        let mut pass = Pass { samples, parameters, one, memory };
        match pass.evaluate(&self.node) {
            Value::Constant(c) => vec![c; samples.len],
            Value::Column(column) => column,
        }
    }

    /// Its values over whole recordings, stretches in their order, one after the other.
    pub fn over(&self, stretches: &[Samples], parameters: &[f64]) -> Vec<f64> {
        let mut memory = Memory::new(self);
        let mut all = Vec::new();
        stretches.iter().for_each(|samples| all.extend(self.column(samples, parameters, 1.0, &mut memory)));
        all
    }

    /// As [`Feature::over`], with the derivative by each parameter from dual numbers.
    ///
    /// # Panics
    /// If it has more than four parameters.
    pub fn with_derivatives(&self, stretches: &[Samples], parameters: &[f64]) -> (Vec<f64>, Vec<Vec<f64>>) {
        match parameters.len() {
            0 => (self.over(stretches, parameters), Vec::new()),
            1 => self.dual::<1>(stretches, parameters),
            2 => self.dual::<2>(stretches, parameters),
            3 => self.dual::<3>(stretches, parameters),
            4 => self.dual::<4>(stretches, parameters),
            n => panic!("{n} parameters; a family has at most four"),
        }
    }

    fn dual<const N: usize>(&self, stretches: &[Samples], parameters: &[f64]) -> (Vec<f64>, Vec<Vec<f64>>) {
        let seeded: Vec<DualSVec64<N>> = (parameters.iter().enumerate())
            .map(|(i, p)| DualSVec64::<N>::from_re(*p).derivative_of(i))
            .collect();
        let mut memory = Memory::new(self);
        let (mut values, mut derivatives) = (Vec::new(), vec![Vec::new(); N]);
        for samples in stretches {
            for dual in self.column(samples, &seeded, DualSVec64::<N>::from_re(1.0), &mut memory) {
                values.push(dual.re);
                let eps = dual.eps.unwrap_generic(nalgebra::Const::<N>, nalgebra::Const::<1>);
                derivatives.iter_mut().zip(eps.iter()).for_each(|(column, d)| column.push(*d));
            }
        }
        (values, derivatives)
    }

    /// Its value at one sample, for a feature without history of its own (directions and distances since reversals are columns).
    /// Slower than [`Feature::column`].
    pub fn at(&self, samples: &Samples, k: usize) -> f64 {
        let one = samples.only(k);
        self.column(&one, &[], 1.0, &mut Memory::new(self)).first().copied().unwrap_or(f64::NAN)
    }
}

/// A dual number with one derivative part set.
trait Seed {
    fn derivative_of(self, i: usize) -> Self;
}

impl<const N: usize> Seed for DualSVec64<N> {
    fn derivative_of(mut self, i: usize) -> Self {
        let mut eps = nalgebra::SVector::<f64, N>::zeros();
        eps[i] = 1.0;
        self.eps = num_dual::Derivative::some(eps);
        self
    }
}

impl<S: Scalar> Pass<'_, S> {
    fn joint(&self, j: usize) -> Option<&JointSamples> {
        self.samples.joints.get(j).and_then(Option::as_ref)
    }

    fn lifted(&self, column: &[f64]) -> Value<S> {
        if column.len() != self.samples.len {
            return Value::Constant(self.one.lift(f64::NAN));
        }
        Value::Column(column.iter().map(|x| self.one.lift(*x)).collect())
    }

    fn evaluate(&mut self, node: &Node) -> Value<S> {
        let one = self.one;
        match node {
            Node::Number(value) => Value::Constant(one.lift(*value)),
            Node::Parameter(index) => Value::Constant(self.parameters[*index]),
            Node::Joint(j, column) => {
                self.lifted(self.joint(*j).map_or(&[][..], |joint| joint.column(*column)))
            }
            Node::Late(j, by) => {
                let Some(joint) = self.joint(*j) else { return self.lifted(&[]) };
                let late = |(x, v): (&f64, &f64)| x - by * v;
                match joint.velocity.len() == joint.position.len() {
                    true => {
                        let column: Vec<f64> = joint.position.iter().zip(&joint.velocity).map(late).collect();
                        self.lifted(&column)
                    }
                    false => self.lifted(&joint.position),
                }
            }
            Node::Time(since) => {
                let time = self.samples.time.as_deref().unwrap_or(&[]);
                self.lifted(time).map(|t| t.offset(-since))
            }
            Node::Order(begins, of_beginning) => {
                let samples = self.samples;
                let Some((_, begin)) = begins.iter().find(|(name, _)| *name == samples.recording) else {
                    return Value::Constant(one.lift(AFTERWARDS));
                };
                match of_beginning {
                    true => Value::Constant(one.lift(*begin)),
                    false => self.lifted(&samples.number).map(|n| n.offset(*begin)),
                }
            }
            Node::Channel(name, _) => {
                self.lifted(self.samples.channels.get(name).map_or(&[][..], Vec::as_slice))
            }
            Node::Needing(_, e) => self.evaluate(e),
            Node::Only(recordings, e) => {
                let value = self.evaluate(e);
                match recordings.contains(&self.samples.recording) {
                    true => value,
                    false => Value::Constant(one.lift(0.0)),
                }
            }
            Node::Sum(list) => self.fold(list, 0.0, |a, b| a + b),
            Node::Product(list) => self.fold(list, 1.0, |a, b| a * b),
            Node::Quotient(pair) => {
                let below = self.evaluate(&pair[1]).map(S::recip);
                self.evaluate(&pair[0]).zip(below, |a, b| a * b)
            }
            Node::Power(e, n) => {
                let base = if *n < 0 { self.evaluate(e).map(S::recip) } else { self.evaluate(e) };
                base.map(|x| (0..n.unsigned_abs()).fold(x.lift(1.0), |product, _| product * x))
            }
            Node::Function(f, e) => {
                let f = *f;
                match (f, self.evaluate(e)) {
                    (Function::Sin, Value::Column(column)) => Value::Column(S::sin_cos_all(&column).0),
                    (Function::Cos, Value::Column(column)) => Value::Column(S::sin_cos_all(&column).1),
                    (Function::Exp, Value::Column(mut column)) => {
                        column.iter_mut().for_each(|x| *x = not_far_down(*x));
                        S::exp_all(&mut column);
                        Value::Column(column)
                    }
                    (Function::Bump, Value::Column(mut column)) => {
                        column.iter_mut().for_each(|x| *x = not_far_down((*x * *x).scale(-0.5)));
                        S::exp_all(&mut column);
                        Value::Column(column)
                    }
                    (_, value) => value.map(|x| function(f, x)),
                }
            }
            Node::Chebyshev(order, e) => {
                let order = *order;
                self.evaluate(e).map(|x| chebyshev(order, x))
            }
            Node::Between(e, from, to) => {
                let (middle, scale) = (0.5 * (from + to), 2.0 / (to - from));
                // Beyond the range a curve stays at its end: nothing was seen there, and polynomials run away.
                let within = |x: S| {
                    let x = x.offset(1.0).select_below(0.0, x.lift(-1.0), x);
                    (-x).offset(1.0).select_below(0.0, x.lift(1.0), x)
                };
                self.evaluate(e).map(|x| within(x.offset(-middle).scale(scale)))
            }
            Node::Play { joint, width, memory } => {
                let width = self.evaluate(width);
                self.follow(*joint, *memory, |past, q, direction, k| {
                    // docs/effects.md (45): the driven member stays where it is, within half the width of the drive.
                    let half = clip(width.at(k)).scale(0.5);
                    let q = half.lift(q);
                    let driven = carried(past.map_or(q - half.scale(direction), |past| past.value), q, half);
                    (driven, driven - q)
                })
            }
            Node::PlayOf { of, width, memory } => {
                let (of, width) = (self.evaluate(of), self.evaluate(width));
                self.play_of(&of, &width, *memory)
            }
            Node::TakeUp { joint, length, memory } => {
                let length = self.evaluate(length);
                self.follow(*joint, *memory, |past, q, direction, k| {
                    let Some(past) = past else {
                        let settled = one.lift(direction);
                        return (settled, settled);
                    };
                    // docs/effects.md (46): exact for any step, as long as the direction does not change within it.
                    let left = (length.at(k).recip().scale(-(q - past.at).abs())).exp();
                    let value = one.lift(direction) + (past.value - one.lift(direction)) * left;
                    (value, value)
                })
            }
            Node::Lag { of, time, memory } => {
                let (of, constant) = (self.evaluate(of), self.evaluate(time));
                self.lag(&of, &constant, *memory)
            }
        }
    }

    fn fold(&mut self, list: &[Node], empty: f64, f: impl Fn(S, S) -> S + Copy) -> Value<S> {
        let mut parts = list.iter();
        let Some(first) = parts.next() else { return Value::Constant(self.one.lift(empty)) };
        let mut all = self.evaluate(first);
        for part in parts {
            all = all.zip(self.evaluate(part), f);
        }
        all
    }

    /// A recursion along the path of a joint: `step` gets what was before, position, direction and index, and returns what to
    /// remember and the value.
    fn follow(
        &mut self,
        joint: usize,
        memory: usize,
        step: impl Fn(Option<Past<S>>, f64, f64, usize) -> (S, S),
    ) -> Value<S> {
        let samples = self.samples;
        let Some(Some(joint)) = samples.joints.get(joint) else {
            return Value::Constant(self.one.lift(f64::NAN));
        };
        let mut past = if samples.first { None } else { self.memory.0[memory] };
        let column = (joint.position.iter().zip(&joint.direction).enumerate())
            .map(|(k, (q, direction))| {
                let (keep, value) = step(past, *q, *direction, k);
                past = Some(Past { value: keep, at: *q });
                value
            })
            .collect();
        self.memory.0[memory] = past;
        Value::Column(column)
    }

    /// docs/effects.md (45), of what an expression drives; before the first sample nobody knows where it was, and it is taken for the middle.
    fn play_of(&mut self, of: &Value<S>, width: &Value<S>, memory: usize) -> Value<S> {
        let mut past = if self.samples.first { None } else { self.memory.0[memory] };
        let column = (0..self.samples.len)
            .map(|k| {
                let (q, half) = (of.at(k), clip(width.at(k)).scale(0.5));
                let value = carried(past.map_or(q, |past| past.value), q, half);
                past = Some(Past { value, at: 0.0 });
                value - q
            })
            .collect();
        self.memory.0[memory] = past;
        Value::Column(column)
    }

    /// docs/effects.md (47): a first-order low-pass over time, its input holding each sample's value since the one before; it goes on from one
    /// recording to the next, since what is warm stays warm.
    fn lag(&mut self, of: &Value<S>, constant: &Value<S>, memory: usize) -> Value<S> {
        let Some(time) = &self.samples.time else { return Value::Constant(self.one.lift(f64::NAN)) };
        let mut past = self.memory.0[memory];
        let column = (time.iter().enumerate())
            .map(|(k, t)| {
                let x = of.at(k);
                let value = match past.filter(|past| *t >= past.at) {
                    None => x,
                    Some(past) => {
                        let left = constant.at(k).recip().scale(-(t - past.at)).exp();
                        x + (past.value - x) * left
                    }
                };
                past = Some(Past { value, at: *t });
                value
            })
            .collect();
        self.memory.0[memory] = past;
        Value::Column(column)
    }
}

impl JointSamples {
    fn column(&self, column: Column) -> &[f64] {
        match column {
            Column::Position => &self.position,
            Column::Direction => &self.direction,
            Column::Velocity => &self.velocity,
            Column::Acceleration => &self.acceleration,
            Column::SinceReversal => &self.since_reversal,
            Column::Travelled => &self.travelled,
            Column::Gravity => &self.gravity,
            Column::Load => &self.load,
            Column::Weight(index) => self.weights.get(index).map_or(&[], Vec::as_slice),
        }
    }
}

/// What stands where it is, within half a width of its drive at `q`.
fn carried<S: Scalar>(driven: S, q: S, half: S) -> S {
    let (low, high) = (q - half, q + half);
    let driven = (driven - low).select_below(0.0, low, driven);
    (high - driven).select_below(0.0, high, driven)
}

/// No less than zero.
fn clip<S: Scalar>(x: S) -> S {
    x.select_below(0.0, x.lift(0.0), x)
}

/// Far down, where its exponential is nothing to anything, it stays what it is: numbers near underflow are slow.
#[inline(always)]
fn not_far_down<S: Scalar>(x: S) -> S {
    x.select_below(-200.0, x.lift(-200.0), x)
}

#[inline(always)]
fn function<S: Scalar>(f: Function, x: S) -> S {
    let number = |value: f64| x.lift(value);
    match f {
        Function::Sin => x.sin_cos().0,
        Function::Cos => x.sin_cos().1,
        Function::Exp => not_far_down(x).exp(),
        Function::Abs => x.select_below(0.0, -x, x),
        Function::Sign => x.select_below(0.0, number(-1.0), (-x).select_below(0.0, number(1.0), number(0.0))),
        Function::Positive => clip(x),
        Function::Step => x.select_below(0.0, number(0.0), number(1.0)),
        Function::Saturate => x * (x * x).offset(1.0).sqrt().recip(),
        Function::Bump => not_far_down((x * x).scale(-0.5)).exp(),
    }
}

/// `T_n` by its recursion, `docs/effects.md` (44).
fn chebyshev<S: Scalar>(order: u8, x: S) -> S {
    let (mut before, mut now) = (x.lift(1.0), x);
    if order == 0 {
        return before;
    }
    for _ in 1..order {
        (before, now) = (now, (x * now).scale(2.0) - before);
    }
    now
}
