//! What stands behind some lines of a program: all that decides how the next ones are written.

use super::ahead::Ahead;
use super::corrector::Corrected;
use super::interpreter::Interpreter;
use super::style::Style;
use crate::nc::MotionKind;

/// A program as it stands between two lines, for a machine whose errors have no history.
#[derive(Clone)]
pub(super) struct Standing<'a> {
    pub program: Interpreter<'a>,
    pub style: Style,
    /// Motion in force by what has been written.
    pub written_motion: Option<MotionKind>,
    /// What was corrected last.
    pub last: Option<Corrected>,
}

impl<'a> Standing<'a> {
    /// As if nothing had been corrected so far.
    pub fn of(ahead: Ahead<'a>) -> Self {
        Standing { program: ahead.program, style: ahead.style, written_motion: None, last: None }
    }

    /// One that goes ahead from here.
    pub fn ahead(&self) -> Ahead<'a> {
        Ahead::new(self.program.clone(), self.style.clone())
    }

    /// Whether what follows is written alike behind both, to the last bit.
    pub fn is_as(&self, other: &Standing) -> bool {
        self.written_motion == other.written_motion
            && self.style == other.style
            && self.last == other.last
            && self.program.is_as(&other.program)
    }
}
