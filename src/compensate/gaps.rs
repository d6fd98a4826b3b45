//! What a program needs of the set-up and the set-up does not say: all of it at once, since one at a time
//! would cost a run each.

use super::fault::CompensateFault;

/// Tools and work offsets that moves depend on, each with the first line that does.
#[derive(Default)]
pub(super) struct Gaps {
    tools: Vec<(String, usize)>,
    offsets: Vec<(String, usize)>,
}

impl Gaps {
    /// Whether this is the want of something that a set-up would say.
    pub fn is_one(fault: &CompensateFault) -> bool {
        matches!(fault, CompensateFault::UnknownTool { .. } | CompensateFault::UnknownOffset { .. })
    }

    /// Keeps what the move at this line depends on.
    pub fn keep<'a>(&mut self, line: usize, faults: impl IntoIterator<Item = &'a CompensateFault>) {
        for fault in faults {
            let (known, name) = match fault {
                CompensateFault::UnknownTool { tool } => (&mut self.tools, tool),
                CompensateFault::UnknownOffset { name } => (&mut self.offsets, name),
                _ => continue,
            };
            if known.iter().all(|(other, _)| other != name) {
                known.push((name.clone(), line));
            }
        }
    }

    /// All of it as one fault, where there is more than one thing.
    pub fn together(self) -> Option<CompensateFault> {
        let Gaps { tools, offsets } = self;
        (tools.len() + offsets.len() > 1).then_some(CompensateFault::UnknownSetup { tools, offsets })
    }
}
