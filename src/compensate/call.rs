//! A call in a block: what it is called, and what is known of what it does.

use super::refusal::line_text;
use crate::nc::{Block, Kind};

/// What a call is called in messages and in the set-up: `M98 P1000`, `L6`, `CYCLE81`.
pub(super) fn name_of(block: &Block) -> String {
    let word = |address: &str| block.words().iter().find(|w| w.address == address);
    let text = |address: &str| word(address).map(|w| block.text(&w.span).to_ascii_uppercase());
    let callers = ["M98", "M198", "G65", "G66", "G66.1"];
    let calling = block.words().iter().map(|w| block.text(&w.span).to_ascii_uppercase());
    if let Some(code) = calling.into_iter().find(|t| callers.contains(&t.as_str())) {
        return text("P").map_or(code.clone(), |p| format!("{code} {p}"));
    }
    if let Some(l) = text("L") {
        return l;
    }
    let named = block.tokens().iter().find(|t| matches!(t.kind, Kind::Name | Kind::Call));
    named.map_or_else(|| line_text(block), |t| block.name(t))
}

/// Of a block with `MCALL`: the cycle that is called behind every block that moves from here on, if any.
pub(super) fn modal_of(block: &Block) -> Option<Option<String>> {
    let mut tokens = block.tokens().iter();
    tokens.any(|t| t.kind == Kind::Name && block.name(t) == "MCALL").then(|| {
        let called = tokens.next().map(|t| block.text(&t.span).to_ascii_uppercase());
        called.map(|text| text.split('(').next().unwrap_or_default().trim().to_string())
    })
}

/// Drilling cycles of Siemens: what they do lies on the tool axis at the place of the block.
pub(super) fn is_drilling(name: &str) -> bool {
    let number = name.strip_prefix("CYCLE").and_then(|n| n.parse::<u32>().ok());
    matches!(number, Some(81..=89 | 840))
}
