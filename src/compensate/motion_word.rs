//! The word that says how a block moves.

use crate::error::Result;
use crate::nc::{Block, Motion};

/// Where it stands, as an index of words.
pub(super) fn motion_word(block: &Block) -> Option<usize> {
    block
        .words()
        .iter()
        .position(|w| w.address == "G" && matches!(w.number(), Some(n) if [0.0, 1.0, 2.0, 3.0].contains(&n)))
}

/// Where the motion of the block is told in messages: the byte of its motion word.
pub(super) fn motion_byte(block: &Block) -> usize {
    motion_word(block).map_or(0, |w| block.words()[w].span.start)
}

/// The word before which a motion word may stand: the first axis, else the first word.
pub(super) fn first_of(block: &Block, motion: &Motion) -> usize {
    let centre = ["I", "J", "K", "R", "CR", "AR", "TURN"];
    let of_arc = block.words().iter().position(|w| centre.contains(&w.address.as_str()));
    motion.words.iter().flatten().copied().chain(of_arc).min().unwrap_or(0)
}

/// Makes a line of an arc's block: `G1`, without centre, radius and turns.
pub(super) fn straighten(block: &mut Block, motion: &Motion) -> Result<()> {
    match motion_word(block) {
        Some(word) => {
            let text = block.words()[word].write_like(1.0, None);
            block.replace(word, &text)?;
        }
        None => block.insert_before(first_of(block, motion), "G", "1")?,
    }
    let of_arc = ["I", "J", "K", "R", "CR", "AR", "TURN", "P"];
    let found: Vec<usize> =
        (0..block.words().len()).filter(|w| of_arc.contains(&block.words()[*w].address.as_str())).collect();
    found.into_iter().try_for_each(|word| block.remove(word))
}
