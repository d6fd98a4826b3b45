//! How much of a wave gets through whitening: noise that remembers weighs fast waves more than slow ones.

use pulp::Arch;

/// The energy is asked at so many frequencies and one.
const KNOTS: usize = 1000;
/// Knots that are turned on from one another before sines are taken anew.
const TURNED: usize = 64;

/// A row that a wave passes on its way to being white.
pub(super) struct Passed {
    pub energy: f64,
    /// What noise remembers here, and what of that is rounding.
    pub rho: f64,
    pub rounded: f64,
    /// How far the wave has come since the row that is remembered, at a factor of one.
    pub advance: f64,
}

/// Adds the energy of these rows, and a constant, at every factor of the phase.
pub(super) fn add_energies(rows: &[Passed], constant: f64, factors: &[f64], energies: &mut [f64]) {
    // It changes as slowly with the factor as the phase advances from row to row: even knots are enough.
    let low = factors.iter().copied().fold(f64::INFINITY, f64::min);
    let high = factors.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let apart = ((high - low) / KNOTS as f64).max(f64::MIN_POSITIVE);
    let knots = Arch::new().dispatch(|| at_knots(rows, low, apart));
    for (sum, factor) in energies.iter_mut().zip(factors) {
        let at = (factor - low) / apart;
        let first = (at as usize).min(KNOTS - 1);
        *sum += constant + knots[first] + (at - first as f64) * (knots[first + 1] - knots[first]);
    }
}

/// So many rows at a time, side by side.
const LANES: usize = 8;
type Lanes = [f64; LANES];

/// The same of eight rows: energy, the sum and the part of the cosine of what passes noise and rounding, and where the wave is.
struct Abreast {
    energy: Lanes,
    noise: [Lanes; 2],
    rounding: [Lanes; 2],
    advance: Lanes,
    turn: [Lanes; 2],
    step: [Lanes; 2],
}

impl Abreast {
    fn new(rows: &[Passed], apart: f64) -> Self {
        let lanes = |of: &dyn Fn(&Passed) -> f64| std::array::from_fn(|l| rows.get(l).map_or(0.0, of));
        let passes =
            |part: fn(&Passed) -> f64| [lanes(&|row| 1.0 + part(row).powi(2)), lanes(&|row| 2.0 * part(row))];
        let advance = lanes(&|row| row.advance);
        let mut rounding = passes(|row| row.rounded);
        rounding[0][rows.len()..].fill(1.0);
        let noise = passes(|row| row.rho);
        let step = cis(advance.map(|advance| apart * advance));
        Abreast { energy: lanes(&|row| row.energy), noise, rounding, advance, turn: cis([0.0; LANES]), step }
    }

    /// Adds the energies, and turns the waves on.
    #[inline(always)]
    fn add(&mut self, sums: &mut Lanes) {
        let ([sine, cosine], [by_sine, by_cosine]) = (&mut self.turn, &self.step);
        for l in 0..LANES {
            let passes = |[whole, part]: &[Lanes; 2]| whole[l] - part[l] * cosine[l];
            sums[l] += self.energy[l] * passes(&self.noise) / passes(&self.rounding);
            (sine[l], cosine[l]) = (
                sine[l] * by_cosine[l] + cosine[l] * by_sine[l],
                cosine[l] * by_cosine[l] - sine[l] * by_sine[l],
            );
        }
    }
}

/// Energy of all rows at [`KNOTS`] and one even factors from `low` on: each cosine follows from the one before by a turn.
#[inline(always)]
fn at_knots(rows: &[Passed], low: f64, apart: f64) -> Vec<f64> {
    let mut all: Vec<Abreast> = rows.chunks(LANES).map(|rows| Abreast::new(rows, apart)).collect();
    let mut knots = Vec::with_capacity(KNOTS + 1);
    for knot in 0..=KNOTS {
        if knot % TURNED == 0 {
            let factor = low + knot as f64 * apart;
            all.iter_mut().for_each(|rows| rows.turn = cis(rows.advance.map(|advance| factor * advance)));
        }
        let mut sums = [0.0; LANES];
        all.iter_mut().for_each(|rows| rows.add(&mut sums));
        knots.push(sums.iter().sum());
    }
    knots
}

fn cis(angles: Lanes) -> [Lanes; 2] {
    [angles.map(f64::sin), angles.map(f64::cos)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn energies_at_many_factors_are_those_of_each() {
        let row = |k: u32| Passed {
            energy: 1.0 + f64::from(k % 5),
            rho: 0.1 * f64::from(k % 10),
            rounded: 0.02 * f64::from(k % 7),
            advance: 1e-3 * f64::from(k % 11),
        };
        let rows: Vec<Passed> = (0..203).map(row).collect();
        let factors: Vec<f64> = (0..5000).map(|k| 20.0 + 0.37 * f64::from(k)).collect();
        let of = |row: &Passed, factor: f64| {
            let passes = |part: f64| 1.0 + part * part - 2.0 * part * (factor * row.advance).cos();
            row.energy * passes(row.rho) / passes(row.rounded)
        };
        let mut energies = vec![1.0; factors.len()];
        add_energies(&rows, 2.0, &factors, &mut energies);
        for (factor, energy) in factors.iter().zip(energies) {
            let exact = 3.0 + rows.iter().map(|row| of(row, *factor)).sum::<f64>();
            assert!((energy / exact - 1.0).abs() < 1e-4, "{factor}: {energy} {exact}");
        }
    }
}
