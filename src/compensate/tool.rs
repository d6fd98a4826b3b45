//! The tool in the spindle, and the length that the control counts with.

use super::fault::CompensateFault;
use super::setup::Setup;
use crate::nc::{Block, Dialect, Modes};

/// Which tool is in the spindle, and which one the control counts with.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Tool {
    in_spindle: Option<String>,
    called: Option<String>,
    by_m6: bool,
    /// RS-274: the name of the length in force, `None` without.
    counted: Option<String>,
}

/// Lengths of the tool, m.
#[derive(Clone, Debug)]
pub(super) struct Lengths {
    counted: f64,
    tip: f64,
    fault: Option<CompensateFault>,
}

impl Lengths {
    /// The one that the control counts with, m.
    pub fn counted(&self) -> f64 {
        self.counted
    }

    /// That of the tool in the spindle, m.
    pub fn tip(&self) -> f64 {
        self.tip
    }

    /// A length that is asked for and not known.
    pub fn fault(self) -> Option<CompensateFault> {
        self.fault
    }
}

/// A name without quotes.
fn named(name: &str) -> String {
    name.trim().trim_matches('"').to_string()
}

impl Tool {
    /// `in_spindle`: the tool that is there before the program names one.
    pub fn new(in_spindle: Option<String>) -> Self {
        Tool { in_spindle, ..Tool::default() }
    }

    pub fn in_spindle(&self) -> Option<&str> {
        self.in_spindle.as_deref()
    }

    /// T, M6, G43, H, D; whether the length that counts may have changed. `before`: modes before this block.
    pub fn change(&mut self, block: &Block, dialect: Dialect, before: &Modes, modes: &Modes) -> bool {
        let word = |address: &str| block.words().iter().find(|w| w.address == address);
        let m6 = block.words().iter().any(|w| w.address == "M" && w.number() == Some(6.0));
        let called = modes.tool != before.tool || word("T").is_some();
        if called {
            self.called = modes.tool.clone();
        }
        if m6 || (called && !self.by_m6) {
            self.by_m6 |= m6;
            self.in_spindle = self.called.clone();
        }
        let counts = block.words().iter().filter(|w| w.address == "G").find_map(|w| match w.number() {
            Some(43.0 | 43.4 | 43.5) => Some(true),
            Some(49.0) => Some(false),
            _ => None,
        });
        if dialect == Dialect::Rs274 {
            let h = word("H").map(|w| block.text(&w.value_span));
            match (counts, h) {
                (Some(true), Some(h)) => self.counted = Some(h),
                (Some(true), None) => {
                    let known = self.counted.take();
                    self.counted = self.in_spindle.clone().or(known).or(Some("H".into()));
                }
                (Some(false), _) => self.counted = None,
                (None, Some(h)) if self.counted.is_some() => self.counted = Some(h),
                _ => {}
            }
        }
        let edge = match dialect {
            Dialect::Rs274 => word("H"),
            Dialect::Siemens => word("D"),
            Dialect::Heidenhain => None,
        };
        called || m6 || counts.is_some() || edge.is_some()
    }

    /// Lengths of the tool that is there and of the one that the control counts with.
    pub fn lengths(&self, setup: &Setup, dialect: Dialect, modes: &Modes) -> Lengths {
        let mut fault = None;
        let unknown = |tool: &str| Some(CompensateFault::UnknownTool { tool: named(tool) });
        let mut length_of = |tool: &str, edge: Option<f64>| {
            let by_edge =
                edge.filter(|d| *d > 1.0).and_then(|d| setup.length(&format!("{} D{d}", named(tool))));
            by_edge.or_else(|| setup.length(tool)).unwrap_or_else(|| {
                fault = unknown(tool);
                0.0
            })
        };
        let tool = self.in_spindle.as_deref();
        let (counted, tip) = match dialect {
            Dialect::Rs274 => {
                let name = self.counted.as_deref();
                let counted = name.map_or(0.0, |h| length_of(h, None));
                let tip = match (tool, name) {
                    (Some(tool), Some(_)) => setup.length(tool).unwrap_or(counted),
                    (Some(tool), None) => length_of(tool, None),
                    (None, Some(_)) => counted,
                    (None, None) => setup.reference_length(),
                };
                (counted, tip)
            }
            Dialect::Siemens => {
                let there = tool.map(|tool| length_of(tool, modes.length_offset));
                let counts = modes.length_offset != Some(0.0);
                (there.filter(|_| counts).unwrap_or(0.0), there.unwrap_or(setup.reference_length()))
            }
            Dialect::Heidenhain => {
                let there = tool.map(|tool| length_of(tool, None));
                (there.unwrap_or(0.0), there.unwrap_or(setup.reference_length()))
            }
        };
        Lengths { counted, tip, fault }
    }
}
