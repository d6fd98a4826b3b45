//! Location errors as people say them: `X and Y are 80 um/m out of square`.

use super::{IDENTIFIED, LocationError, LocationErrors};

/// A value less than this many standard errors from zero is none that anybody should act on.
const CLEAR: f64 = 2.0;

/// What an identified location error means, and what can be done about it.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Said {
    /// Name of the error after ISO 230-1.
    pub name: String,
    /// A sentence without its full stop.
    pub what: String,
    /// What to do about it.
    pub remedy: &'static str,
}

const SQUARE: &str =
    "align the guideway, or enter it as squareness compensation; `kincal compensate` takes it too";
const LEANS: &str =
    "align the axis; few controls hold a tilt (`kincal export` says which), `kincal compensate` takes it";
const PLACE: &str = "enter the place of the axis in the control: `kincal export CALIBRATED.ron --to FORMAT`";

impl LocationErrors {
    /// Why errors are not identified that come from the data for the most part, if there are any: a sentence without its full stop.
    pub fn caution(&self) -> Option<&'static str> {
        let any = self.errors.iter().any(|error| !error.identified && error.share >= IDENTIFIED);
        any.then_some(
            "not identified with 90 % and more: the rest lies where these recordings see nothing at all; a test of another kind shows it",
        )
    }

    /// What is identified and clearly not zero, in the order of the errors; errors with extended names stay in the table alone.
    pub fn in_words(&self) -> Vec<Said> {
        let clear = |error: &&LocationError| {
            error.identified && error.value.abs() > CLEAR * error.std_error && error.value != 0.0
        };
        self.errors.iter().filter(clear).filter_map(in_words).collect()
    }
}

/// The letters of `EC0Y`: direction and axis.
fn letters(name: &str) -> Option<(char, char)> {
    match name.chars().collect::<Vec<_>>()[..] {
        ['E', direction, '0', axis] => Some((direction, axis)),
        _ => None,
    }
}

/// `119 um/m`, `12.3 um`.
fn size(value: f64, unit: &str) -> String {
    let um = 1e6 * value.abs();
    let decimals = (2 - um.max(1e-3).log10().floor() as i32).clamp(0, 3) as usize;
    format!("{um:.decimals$} {}", if unit == "m" { "um" } else { "um/m" })
}

fn in_words(error: &LocationError) -> Option<Said> {
    let (direction, axis) = letters(&error.name)?;
    let index = |letter: char, of: &str| of.find(letter);
    let said = |what: String, remedy: &'static str| Some(Said { name: error.name.clone(), what, remedy });
    let size = size(error.value, &error.unit);
    if "XYZ".contains(direction) {
        let sign = if error.value < 0.0 { '-' } else { '+' };
        return said(
            format!("the axis of {axis} lies {size} towards {sign}{direction} of where it is declared"),
            PLACE,
        );
    }
    let about = index(direction, "ABC")?;
    let own = index(axis, "XYZ").or_else(|| index(axis, "ABC"))?;
    if about == own {
        return None;
    }
    let other = 3 - about - own;
    // Turned about `about`, `own` goes towards `other` where the three are right-handed, else away from it.
    let towards = if (about + 1) % 3 == own { error.value } else { -error.value };
    let other = ['X', 'Y', 'Z'][other];
    if "XYZ".contains(axis) {
        let (first, second) = if other < axis { (other, axis) } else { (axis, other) };
        let angle = if towards > 0.0 { "less" } else { "more" };
        said(
            format!("{first} and {second} are {size} out of square: {angle} than 90 deg between them"),
            SQUARE,
        )
    } else {
        let sign = if towards < 0.0 { '-' } else { '+' };
        said(format!("the axis of {axis} leans by {size} towards {sign}{other}"), LEANS)
    }
}
