//! SIMD lanes as a scalar: as many samples at a time as a register of the machine at hand holds.
//!
//! Which instructions there are is found when the program runs: a kernel implements [`pulp::WithSimd`], gets a token `S` for them, and
//! makes its first lanes with [`Lanes::load`] or [`Lanes::splat`]. Everything under a kernel must be `#[inline(always)]`: a function
//! that is not is compiled for the plainest machine, and costs tens of times as much.

use std::ops::{Add, Mul, Neg, Sub};

use pulp::{Arch, Simd, WithSimd};

use super::Scalar;
use super::elementary::ROUND;

/// `(sin r / r - 1) / r²` and `(cos r - 1 + r²/2) / r⁴` up to an eighth of a turn, from the highest power of `r²`: of all polynomials those
/// whose largest error is least (Remez), 3.4e-18 of the sine and 4.7e-20 of the cosine.
const SINE: [f64; 6] = [
    1.589_682_670_136_347_4e-10,
    -2.505_075_862_975_759_4e-8,
    2.755_731_369_505_555_8e-6,
    -1.984_126_982_981_637e-4,
    8.333_333_333_322_424e-3,
    -0.166_666_666_666_666_32,
];
const COSINE: [f64; 6] = [
    -1.135_966_977_004_655_3e-11,
    2.087_572_368_232_159_6e-9,
    -2.755_731_435_522_394_3e-7,
    2.480_158_728_949_175_2e-5,
    -1.388_888_888_887_413_8e-3,
    0.041_666_666_666_666_6,
];
/// `π/2` in three parts.
const HALF_PI: [f64; 3] = [1.570_796_326_734_125_6, 6.077_100_506_303_966e-11, 2.022_266_248_795_950_6e-21];

/// The most lanes that any register has.
pub(crate) const MOST_LANES: usize = 8;

/// Angles beyond this are no angles of a machine, rad.
const FARTHEST: f64 = 2e9;

/// One number for each lane. In memory it begins where a line of the cache does: across two of them it would be read and written twice.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct Lanes<S: Simd> {
    simd: S,
    values: S::f64s,
}

impl<S: Simd> Lanes<S> {
    /// How many lanes there are.
    pub const COUNT: usize = S::F64_LANES;

    /// The same number in every lane.
    #[inline(always)]
    pub fn splat(simd: S, value: f64) -> Self {
        Lanes { simd, values: simd.splat_f64s(value) }
    }

    /// From the beginning of a slice; lanes behind its end are zero.
    #[inline(always)]
    pub fn load(simd: S, from: &[f64]) -> Self {
        let values = match S::as_simd_f64s(from).0 {
            [first, ..] => *first,
            [] => simd.partial_load_f64s(from),
        };
        Lanes { simd, values }
    }

    /// Into the beginning of a slice; lanes behind its end are left out.
    #[inline(always)]
    pub fn store(self, to: &mut [f64]) {
        match S::as_mut_simd_f64s(to).0 {
            [first, ..] => *first = self.values,
            [] => self.simd.partial_store_f64s(to, self.values),
        }
    }

    /// Sum over the lanes.
    #[inline(always)]
    pub fn sum(self) -> f64 {
        self.simd.reduce_sum_f64s(self.values)
    }

    /// Whether every lane is below `limit`; one that is no number is not.
    #[inline(always)]
    pub fn all_below(self, limit: f64) -> bool {
        let simd = self.simd;
        let beyond = simd.not_m64s(simd.less_than_f64s(self.values, simd.splat_f64s(limit)));
        simd.first_true_m64s(beyond) >= S::F64_LANES
    }

    #[inline(always)]
    fn with(self, values: S::f64s) -> Self {
        Lanes { simd: self.simd, values }
    }

    /// Lane by lane, by a function that has no instruction of its own.
    #[inline(always)]
    fn each(self, mut function: impl FnMut(usize, f64) -> f64) -> Self {
        let mut all = [0.0; MOST_LANES];
        self.store(&mut all[..Self::COUNT]);
        for (k, x) in all[..Self::COUNT].iter_mut().enumerate() {
            *x = function(k, *x);
        }
        Self::load(self.simd, &all[..Self::COUNT])
    }

    #[inline(always)]
    fn series<const N: usize>(self, coefficients: &[f64; N]) -> Self {
        let mut sum = self.lift(coefficients[0]);
        for c in &coefficients[1..] {
            sum = sum.mul_add(self, self.lift(*c));
        }
        sum
    }

    /// Sine and cosine, to 1e-15, without a branch. Products are rounded once: so the angle beside whole quarter turns is exact for any
    /// number of them. No number where the angle is beyond what any machine turns.
    #[inline(always)]
    fn turned(self) -> (Self, Self) {
        let simd = self.simd;
        let is_near = simd.less_than_f64s(simd.abs_f64s(self.values), simd.splat_f64s(FARTHEST));
        let angle = self.with(simd.select_f64s(is_near, self.values, simd.splat_f64s(f64::NAN)));
        let rounded = angle.mul_add(self.lift(std::f64::consts::FRAC_2_PI), self.lift(ROUND));
        let n = rounded.offset(-ROUND);
        let mut r = angle;
        for part in HALF_PI {
            r = n.mul_add(self.lift(-part), r);
        }
        let square = r * r;
        let sine = (r * square).mul_add(square.series(&SINE), r);
        let cosine = square.mul_add(square.series(&COSINE).mul_add(square, self.lift(-0.5)), self.lift(1.0));
        let quarter = simd.transmute_u64s_f64s(rounded.values);
        let next = simd.add_u64s(quarter, simd.splat_u64s(1));
        let (s, c) = (cosine.where_bit(1, quarter, sine), sine.where_bit(1, quarter, cosine));
        ((-s).where_bit(2, quarter, s), (-c).where_bit(2, next, c))
    }

    /// These lanes where a bit is set, others elsewhere.
    #[inline(always)]
    fn where_bit(self, bit: u64, bits: S::u64s, otherwise: Self) -> Self {
        let (simd, bit) = (self.simd, self.simd.splat_u64s(bit));
        let is_set = simd.equal_u64s(simd.and_u64s(bits, bit), bit);
        self.with(simd.select_f64s(is_set, self.values, otherwise.values))
    }
}

impl<S: Simd> Add for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        self.with(self.simd.add_f64s(self.values, o.values))
    }
}

impl<S: Simd> Sub for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        self.with(self.simd.sub_f64s(self.values, o.values))
    }
}

impl<S: Simd> Mul for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        self.with(self.simd.mul_f64s(self.values, o.values))
    }
}

impl<S: Simd> Neg for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.with(self.simd.neg_f64s(self.values))
    }
}

impl<S: Simd> Scalar for Lanes<S> {
    #[inline(always)]
    fn lift(self, value: f64) -> Self {
        Self::splat(self.simd, value)
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        self.with(self.simd.mul_add_e_f64s(self.values, factor.values, addend.values))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.with(self.simd.sqrt_f64s(self.values))
    }
    #[inline(always)]
    fn recip(self) -> Self {
        self.with(self.simd.div_f64s(self.simd.splat_f64s(1.0), self.values))
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        if S::IS_SCALAR { (self.each(|_, x| x.sin()), self.each(|_, x| x.cos())) } else { self.turned() }
    }
    #[inline(always)]
    fn exp(self) -> Self {
        self.each(|_, x| x.exp())
    }
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        let mut all = [0.0; MOST_LANES];
        x.store(&mut all[..Self::COUNT]);
        self.each(|k, y| y.atan2(all[k]))
    }
    #[inline(always)]
    fn select_below(self, limit: f64, below: Self, otherwise: Self) -> Self {
        let mask = self.simd.less_than_f64s(self.values, self.simd.splat_f64s(limit));
        self.with(self.simd.select_f64s(mask, below.values, otherwise.values))
    }
}

/// Sines and cosines of a column of angles in rad, to 1e-15.
pub(crate) fn sines_cosines(angles: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let (mut sines, mut cosines) = (vec![0.0; angles.len()], vec![0.0; angles.len()]);
    Arch::new().dispatch(SinesCosines { angles, sines: &mut sines, cosines: &mut cosines });
    (sines, cosines)
}

struct SinesCosines<'a> {
    angles: &'a [f64],
    sines: &'a mut [f64],
    cosines: &'a mut [f64],
}

impl WithSimd for SinesCosines<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let count = S::F64_LANES;
        let results = self.sines.chunks_mut(count).zip(self.cosines.chunks_mut(count));
        for (angles, (sines, cosines)) in self.angles.chunks(count).zip(results) {
            let (sine, cosine) = Lanes::load(simd, angles).sin_cos();
            sine.store(sines);
            cosine.store(cosines);
        }
    }
}

#[cfg(test)]
mod tests {

    use super::*;

    /// The functions of the trait at some numbers, on whatever lanes there are.
    struct Everything<'a>(&'a [f64]);

    impl WithSimd for Everything<'_> {
        type Output = Vec<[f64; 8]>;
        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
            let mut all = Vec::new();
            for numbers in self.0.chunks(S::F64_LANES) {
                let x = Lanes::load(simd, numbers);
                let (sine, cosine) = x.sin_cos();
                let size = (x * x).offset(1.0);
                let rows = [
                    sine,
                    cosine,
                    x.scale(1e-7).exp(),
                    x.atan2(sine),
                    size.sqrt(),
                    size.recip(),
                    x.select_below(0.5, sine, -cosine),
                    x.mul_add(sine, cosine - x),
                ];
                let mut columns = [[0.0; MOST_LANES]; 8];
                for (row, column) in rows.into_iter().zip(&mut columns) {
                    row.store(&mut column[..numbers.len()]);
                }
                all.extend((0..numbers.len()).map(|k| columns.map(|column| column[k])));
            }
            all
        }
    }

    #[test]
    fn sines_and_cosines_are_those_of_the_standard_library() {
        for scale in [1e-3, 0.01, 1.0, 9.9] {
            let at: Vec<f64> = (-100_000..=100_000).map(|k| scale * (f64::from(k) + 0.3)).collect();
            let (sines, cosines) = sines_cosines(&at);
            for ((x, sine), cosine) in at.iter().zip(sines).zip(cosines) {
                let exact = x.sin_cos();
                assert!((sine - exact.0).abs() < 1e-15, "{x}: {sine} {}", exact.0);
                assert!((cosine - exact.1).abs() < 1e-15, "{x}: {cosine} {}", exact.1);
            }
        }
        let (sines, cosines) = sines_cosines(&[0.0, f64::NAN, 1e7]);
        assert!(sines[0] == 0.0 && cosines[0] == 1.0 && sines[1].is_nan());
        assert!((sines[2] - 1e7f64.sin()).abs() < 1e-15);
    }

    #[test]
    fn every_function_is_that_of_plain_numbers() {
        let near = (-2000..=2000).map(|k| 0.017 * f64::from(k));
        let numbers: Vec<f64> = near.chain([1e5, -9.9e5, 3e6, -1e9, 1.999e9, 0.0]).collect();
        for (x, found) in numbers.iter().zip(Arch::new().dispatch(Everything(&numbers))) {
            let ((sine, cosine), size) = (f64::sin_cos(*x), x * x + 1.0);
            let otherwise = if *x < 0.5 { sine } else { -cosine };
            let exact = [
                sine,
                cosine,
                (1e-7 * x).exp(),
                x.atan2(sine),
                size.sqrt(),
                1.0 / size,
                otherwise,
                x * sine + (cosine - x),
            ];
            for (k, (found, exact)) in found.iter().zip(exact).enumerate() {
                let bound = 4e-16 * exact.abs().max(if k == 7 { 3.0 * x.abs() } else { 1.0 }).max(1.0);
                assert!((found - exact).abs() <= bound, "function {k} of {x}: {found} {exact}");
            }
        }
    }

    #[test]
    fn what_is_no_number_stays_none() {
        assert!(Arch::new().dispatch(Everything(&[f64::NAN]))[0][0].is_nan());
        assert!(Arch::new().dispatch(Everything(&[f64::INFINITY]))[0][1].is_nan());
        let far = Arch::new().dispatch(Everything(&[1e12]))[0][0];
        assert!(far.is_nan() || (far - 1e12f64.sin()).abs() < 1e-15);
    }
}
