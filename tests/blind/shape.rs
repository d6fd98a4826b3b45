//! Curves over [0, 1] that effects follow: textbook polynomials, and shapes that are nobody's basis functions.

use super::random::Random;

/// A curve over [0, 1]; held at its ends outside.
#[derive(Clone, Debug)]
pub enum Curve {
    /// Legendre polynomials from degree `first`.
    Legendre { first: usize, weights: Vec<f64> },
    /// Gaussian hills: centre, width, height.
    Hills(Vec<(f64, f64, f64)>),
    /// A saturating change with a bow: steepness, place, bow.
    Saturating { steep: f64, at: f64, bow: f64 },
    /// Cubic through random values at random knots.
    Knots(Vec<(f64, f64)>),
    /// A smoothed random walk on an even grid.
    Walk(Vec<f64>),
}

impl Curve {
    /// A textbook curve: degrees `first` to `last`.
    pub fn textbook(random: &mut Random, first: usize, last: usize) -> Self {
        let weight = |k: usize, r: &mut Random| r.normal() / (1.0 + (k - first) as f64).sqrt();
        Curve::Legendre { first, weights: (first..=last).map(|k| weight(k, random)).collect() }
    }

    /// A curve from outside the textbook.
    pub fn wild(random: &mut Random) -> Self {
        match random.below(4) {
            0 => {
                let count = 2 + random.below(3);
                let hill = |r: &mut Random| (r.between(0.05, 0.95), r.between(0.08, 0.25), r.normal());
                Curve::Hills((0..count).map(|_| hill(random)).collect())
            }
            1 => Curve::Saturating {
                steep: random.between(4.0, 12.0),
                at: random.between(0.2, 0.8),
                bow: random.normal(),
            },
            2 => {
                let mut u: Vec<f64> = (0..3 + random.below(4)).map(|_| random.between(0.06, 0.94)).collect();
                u.extend([0.0, 1.0]);
                u.sort_by(f64::total_cmp);
                u.dedup_by(|a, b| (*a - *b).abs() < 0.06);
                Curve::Knots(u.into_iter().map(|u| (u, random.normal())).collect())
            }
            _ => {
                let n = 64;
                let mut walk = Vec::with_capacity(n);
                let mut at = 0.0;
                for _ in 0..n {
                    at += random.normal();
                    walk.push(at);
                }
                let reach = 3 + random.below(4) as i64;
                for _ in 0..3 {
                    walk = (0..n as i64)
                        .map(|i| {
                            let near = (i - reach).max(0)..=(i + reach).min(n as i64 - 1);
                            let count = near.clone().count() as f64;
                            near.map(|j| walk[j as usize]).sum::<f64>() / count
                        })
                        .collect();
                }
                Curve::Walk(walk)
            }
        }
    }

    /// Value at `u`.
    pub fn at(&self, u: f64) -> f64 {
        let u = u.clamp(0.0, 1.0);
        match self {
            Curve::Legendre { first, weights } => {
                weights.iter().enumerate().map(|(i, w)| w * legendre(first + i, 2.0 * u - 1.0)).sum()
            }
            Curve::Hills(hills) => {
                hills.iter().map(|(c, w, h)| h * (-0.5 * ((u - c) / w).powi(2)).exp()).sum()
            }
            Curve::Saturating { steep, at, bow } => (steep * (u - at)).tanh() + bow * (u * (1.0 - u)) * 2.0,
            Curve::Knots(knots) => through(knots, u),
            Curve::Walk(values) => {
                let x = u * (values.len() - 1) as f64;
                let i = (x as usize).min(values.len() - 2);
                let f = x - i as f64;
                let before = values[i.saturating_sub(1)];
                let behind = values[(i + 2).min(values.len() - 1)];
                catmull([before, values[i], values[i + 1], behind], f)
            }
        }
    }
}

/// Legendre polynomial of degree `k` at `x` in [-1, 1].
pub fn legendre(k: usize, x: f64) -> f64 {
    let (mut a, mut b) = (1.0, x);
    if k == 0 {
        return a;
    }
    for n in 1..k {
        (a, b) = (b, ((2 * n + 1) as f64 * x * b - n as f64 * a) / (n + 1) as f64);
    }
    b
}

fn catmull(v: [f64; 4], f: f64) -> f64 {
    let (m0, m1) = ((v[2] - v[0]) / 2.0, (v[3] - v[1]) / 2.0);
    hermite(v[1], v[2], m0, m1, f)
}

fn hermite(a: f64, b: f64, ma: f64, mb: f64, f: f64) -> f64 {
    let (f2, f3) = (f * f, f * f * f);
    a * (2.0 * f3 - 3.0 * f2 + 1.0) + ma * (f3 - 2.0 * f2 + f) + b * (3.0 * f2 - 2.0 * f3) + mb * (f3 - f2)
}

fn through(knots: &[(f64, f64)], u: f64) -> f64 {
    let i = knots.iter().rposition(|k| k.0 <= u).unwrap_or(0).min(knots.len() - 2);
    let slope = |i: usize| {
        let (a, b) = (knots[i.saturating_sub(1)], knots[(i + 1).min(knots.len() - 1)]);
        (b.1 - a.1) / (b.0 - a.0)
    };
    let width = knots[i + 1].0 - knots[i].0;
    let f = (u - knots[i].0) / width;
    hermite(knots[i].1, knots[i + 1].1, slope(i) * width, slope(i + 1) * width, f)
}
