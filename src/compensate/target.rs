//! Where a block goes, out of its words.

use std::f64::consts::TAU;

use super::control::Control;
use super::fault::CompensateFault;
use super::places::Places;
use super::refusal::refuse;
use crate::error::Result;
use crate::few::Few;
use crate::nc::{Block, Dialect, Distance, How, Modes, Motion, MotionKind, Value, Word};

/// What a word means, modes included.
pub(super) fn meaning(how: How, modes: &Modes) -> How {
    match how {
        How::Modal if modes.distance == Some(Distance::Incremental) => How::Incremental,
        How::Modal => How::Absolute,
        how => how,
    }
}

/// Refuses words that say where the block goes in a way that is not followed.
pub(super) fn check(block: &Block, motion: &Motion, control: &Control, dialect: Dialect) -> Result<()> {
    let straight = matches!(motion.kind, MotionKind::Rapid | MotionKind::Linear | MotionKind::Unstated);
    // A single letter is none of these but I, J and K.
    let vectors = dialect == Dialect::Rs274 && control.tcp() && straight;
    let may_tell = |word: &&Word| match word.address.letter() {
        Some(letter) => vectors && matches!(letter, b'I'..=b'K'),
        None => true,
    };
    for word in block.words().iter().filter(may_tell) {
        let address = word.address.as_str();
        let polar = match dialect {
            Dialect::Siemens => matches!(address, "AP" | "RP"),
            Dialect::Heidenhain => matches!(address, "PR" | "PA"),
            Dialect::Rs274 => false,
        };
        if polar {
            let what = format!("polar coordinates (`{address}`)");
            return refuse(block, word.span.start, CompensateFault::OtherMotion { what });
        }
        let vector =
            matches!(address, "A2" | "B2" | "C2" | "A3" | "B3" | "C3" | "LEAD" | "TILT" | "TX" | "TY" | "TZ");
        let by_ijk = vectors && matches!(address, "I" | "J" | "K");
        let followed = || control.axes().iter().any(|a| a.address() == address);
        if ((vector && dialect != Dialect::Rs274) || by_ijk) && !followed() {
            let address = address.to_string();
            return refuse(block, word.span.start, CompensateFault::ToolVector { address });
        }
    }
    Ok(())
}

/// Program coordinates at the end of the block, m or rad. `from`: those at its start.
pub(super) fn of(
    block: &Block,
    motion: &Motion,
    control: &Control,
    modes: &Modes,
    places: &Places,
    from: &[f64],
) -> Result<Few<f64>> {
    let mut target = Few::from_slice(from);
    for (i, index) in motion.words.iter().enumerate() {
        let Some(index) = *index else { continue };
        let word = &block.words()[index];
        let address = || word.address.to_string();
        let Value::Number(number) = word.value else {
            let text = block.text(&word.value_span).chars().take(40).collect();
            let fault = CompensateFault::Expression { address: address(), text };
            return refuse(block, word.span.start, fault);
        };
        let value = control.si(i, number.value);
        let now = target[i];
        // Within a turn, the way that the word says.
        let upward = || (value - now).rem_euclid(TAU);
        target[i] = match meaning(word.how, modes) {
            How::Incremental if !places.is_placed(i) => {
                let fault = CompensateFault::UnknownStart { address: address() };
                return refuse(block, word.span.start, fault);
            }
            How::Incremental => now + value,
            How::Shortest if upward() > 0.5 * TAU => now + upward() - TAU,
            How::Shortest | How::Positive => now + upward(),
            How::Negative if upward() > 0.0 => now + upward() - TAU,
            How::Negative => now,
            _ => value,
        };
    }
    Ok(target)
}
