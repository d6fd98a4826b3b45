//! What every family of the library does to a ballbar's trace: pictures and the page that shows them, `docs/effects/`.
//!
//! `cargo run --release --features measure --example signatures` writes them, `tests/laws/signatures.rs` compares.

mod page;
mod picture;
mod scene;
mod sign;
mod trace;

use kincal::effects::{Clock, Family, Library};

/// A file of `docs/effects/` with its text.
pub struct Drawn {
    pub file: String,
    pub text: String,
}

/// Whether a family has a picture of its own: entries that say the same of recordings without a clock have not.
fn is_pictured(family: &Family) -> bool {
    matches!(family.clock, Clock::Any | Clock::One)
}

/// All pictures, then the page.
pub fn draw(library: &Library) -> Vec<Drawn> {
    let scenes = scene::all();
    let ready = trace::Ready::all(library, &scenes);
    let mut drawn = Vec::new();
    let mut shown: Vec<page::Shown> = Vec::new();
    for (index, family) in library.families().iter().enumerate().filter(|(_, family)| is_pictured(family)) {
        let trace = trace::of(library, index, &ready);
        let before = shown.iter().filter(|shown| shown.family.name == family.name).count();
        let file = match before {
            0 => format!("{}.svg", family.name),
            n => format!("{}_{}.svg", family.name, n + 1),
        };
        drawn.push(Drawn { file: file.clone(), text: picture::draw(&family.name, &trace) });
        shown.push(page::Shown { family, sign: sign::of(&trace), conditions: trace.conditions, file });
    }
    drawn.push(Drawn { file: "README.md".into(), text: page::write(&shown) });
    drawn
}
