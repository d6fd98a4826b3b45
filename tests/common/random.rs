//! The random numbers of all tests. Two harnesses that are examples too draw by themselves: the blind one, whose cases share no code with
//! anything, and that of damaged texts, which draws integers.

use std::f64::consts::TAU;

use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

pub struct Random(StdRng);

impl Random {
    pub fn new(seed: u64) -> Self {
        Random(StdRng::seed_from_u64(seed))
    }

    /// Even between two numbers.
    pub fn between(&mut self, from: f64, to: f64) -> f64 {
        self.0.random_range(from..to)
    }

    /// Standard normal.
    pub fn normal(&mut self) -> f64 {
        let (u, v) = (self.between(f64::MIN_POSITIVE, 1.0), self.between(0.0, TAU));
        (-2.0 * u.ln()).sqrt() * v.cos()
    }
}

/// Standard normal numbers of a seed.
pub fn normals(seed: u64) -> impl FnMut() -> f64 {
    let mut random = Random::new(seed);
    move || random.normal()
}
