//! The tool in the spindle, and the length that the control counts with.

use super::fault::CompensateFault;
use super::follower::Follower;
use super::named;
use crate::nc::{Block, Dialect, Modes};

/// Which tool is in the spindle, and which one the control counts with.
#[derive(Clone, Debug, Default)]
pub(super) struct Tool {
    pub in_spindle: Option<String>,
    pub called: Option<String>,
    pub by_m6: bool,
    /// RS-274: the name of the length in force, `None` without.
    pub counted: Option<String>,
}

impl Follower<'_> {
    /// T, M6, G43, H, D; whether the length that counts may have changed.
    pub fn tools(&mut self, block: &Block, before: &Modes) -> bool {
        let modes = self.state.modes().clone();
        let word = |address: &str| block.words().iter().find(|w| w.address == address);
        let m6 = block.words().iter().any(|w| w.address == "M" && w.number() == Some(6.0));
        let called = modes.tool != before.tool || word("T").is_some();
        if called {
            self.tool.called = modes.tool.clone();
        }
        if m6 || (called && !self.tool.by_m6) {
            self.tool.by_m6 |= m6;
            self.tool.in_spindle = self.tool.called.clone();
        }
        let counts = block.words().iter().filter(|w| w.address == "G").find_map(|w| match w.number() {
            Some(43.0 | 43.4 | 43.5) => Some(true),
            Some(49.0) => Some(false),
            _ => None,
        });
        if self.dialect == Dialect::Rs274 {
            let h = word("H").map(|w| block.text(&w.value_span));
            match (counts, h) {
                (Some(true), Some(h)) => self.tool.counted = Some(h),
                (Some(true), None) => {
                    let known = self.tool.counted.take();
                    self.tool.counted = self.tool.in_spindle.clone().or(known).or(Some("H".into()));
                }
                (Some(false), _) => self.tool.counted = None,
                (None, Some(h)) if self.tool.counted.is_some() => self.tool.counted = Some(h),
                _ => {}
            }
        }
        let touched = called || m6 || counts.is_some() || word("H").is_some() || word("D").is_some();
        if touched {
            self.lengths(&modes);
        }
        touched
    }

    /// Lengths of the tool that is there and of the one that the control counts with.
    pub fn lengths(&mut self, modes: &Modes) {
        let setup = self.control.setup;
        self.tool_fault = None;
        let unknown = |tool: &str| Some(CompensateFault::UnknownTool { tool: named(tool) });
        let mut length_of = |tool: &str, edge: Option<f64>| {
            let by_edge =
                edge.filter(|d| *d > 1.0).and_then(|d| setup.length(&format!("{} D{d}", named(tool))));
            by_edge.or_else(|| setup.length(tool)).unwrap_or_else(|| {
                self.tool_fault = unknown(tool);
                0.0
            })
        };
        let tool = self.tool.in_spindle.as_deref();
        match self.dialect {
            Dialect::Rs274 => {
                let counted = self.tool.counted.as_deref();
                self.control.length = counted.map_or(0.0, |h| length_of(h, None));
                self.control.tip_length = match (tool, counted) {
                    (Some(tool), Some(_)) => setup.length(tool).unwrap_or(self.control.length),
                    (Some(tool), None) => length_of(tool, None),
                    (None, Some(_)) => self.control.length,
                    (None, None) => setup.reference_length(),
                };
            }
            Dialect::Siemens => {
                let there = tool.map(|tool| length_of(tool, modes.length_offset));
                self.control.tip_length = there.unwrap_or(setup.reference_length());
                let counts = modes.length_offset != Some(0.0);
                self.control.length = there.filter(|_| counts).unwrap_or(0.0);
            }
            Dialect::Heidenhain => {
                let there = tool.map(|tool| length_of(tool, None));
                self.control.tip_length = there.unwrap_or(setup.reference_length());
                self.control.length = there.unwrap_or(0.0);
            }
        }
    }
}
