//! Numbers as text, as the standard library reads and writes them, in a fraction of its time. Where that is not certain, it is asked.

mod fixed;
mod read;
mod scientific;

use smallvec::SmallVec;

pub(crate) use fixed::{Rounded, fixed};
pub(crate) use read::read;
pub(crate) use scientific::push;

/// A number as text, in ASCII; one of ordinary length takes no memory of its own.
pub(crate) type Text = SmallVec<[u8; 24]>;

/// Powers of ten that are exact.
const TENS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18,
    1e19, 1e20, 1e21, 1e22,
];

/// Two digits at a time.
const PAIRS: [[u8; 2]; 100] = pairs();

const fn pairs() -> [[u8; 2]; 100] {
    let mut all = [[0; 2]; 100];
    let mut k = 0;
    while k < 100 {
        all[k] = [b'0' + (k / 10) as u8, b'0' + (k % 10) as u8];
        k += 1;
    }
    all
}

/// A unit of the last of so many decimals.
pub(crate) fn unit(places: usize) -> f64 {
    TENS.get(places).map_or_else(|| 10f64.powi(-(places as i32)), |ten| 1.0 / ten)
}
