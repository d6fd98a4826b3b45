//! Where a block goes, out of its words.

use super::fault::CompensateFault;
use super::follower::{Follower, Status, refuse};
use crate::error::Result;
use crate::nc::{Block, Dialect, How, Motion, MotionKind, Units, Value};

impl Follower<'_> {
    /// Program coordinates at the end of the block, m or rad.
    pub fn target(&mut self, block: &Block, motion: &Motion) -> Result<Vec<f64>> {
        for word in block.words() {
            self.comma |= self.dialect == Dialect::Heidenhain && block.text(&word.value_span).contains(',');
            let address = word.address.as_str();
            let followed = self.control.axes.iter().any(|a| a.address == address);
            let polar = match self.dialect {
                Dialect::Siemens => matches!(address, "AP" | "RP"),
                Dialect::Heidenhain => matches!(address, "PR" | "PA"),
                Dialect::Rs274 => false,
            };
            if polar {
                let what = format!("polar coordinates (`{address}`)");
                return refuse(block, word.span.start, CompensateFault::OtherMotion { what });
            }
            let vector = matches!(
                address,
                "A2" | "B2" | "C2" | "A3" | "B3" | "C3" | "LEAD" | "TILT" | "TX" | "TY" | "TZ"
            );
            let straight =
                matches!(motion.kind, MotionKind::Rapid | MotionKind::Linear | MotionKind::Unstated);
            let by_ijk = self.dialect == Dialect::Rs274
                && self.control.tcp
                && straight
                && matches!(address, "I" | "J" | "K");
            if !followed && ((vector && self.dialect != Dialect::Rs274) || by_ijk) {
                let address = address.to_string();
                return refuse(block, word.span.start, CompensateFault::ToolVector { address });
            }
        }
        let mut target = self.meant.program.clone();
        for (i, index) in motion.words.iter().enumerate() {
            let Some(index) = *index else { continue };
            let word = &block.words()[index];
            let address = word.address.clone();
            let Value::Number(number) = word.value else {
                let text = block.text(&word.value_span).chars().take(40).collect();
                return refuse(block, word.span.start, CompensateFault::Expression { address, text });
            };
            let rotary = self.control.axes[i].rotary;
            let seen = &mut self.decimals[usize::from(rotary)];
            *seen = (*seen).max(number.decimals.min(6));
            let value = self.control.si(i, number.value);
            let now = target[i];
            let turn = std::f64::consts::TAU;
            let upward = (value - now).rem_euclid(turn);
            target[i] = match self.how(word.how) {
                How::Incremental if self.status[i] != Status::Placed => {
                    return refuse(block, word.span.start, CompensateFault::UnknownStart { address });
                }
                How::Incremental => now + value,
                // Within a turn, the way that the word says.
                How::Shortest if upward > 0.5 * turn => now + upward - turn,
                How::Shortest | How::Positive => now + upward,
                How::Negative if upward > 0.0 => now + upward - turn,
                How::Negative => now,
                _ => value,
            };
            self.status[i] = Status::Placed;
            self.ways.sure[i] = true;
        }
        Ok(target)
    }

    /// What a word means, modes included.
    pub fn how(&self, how: How) -> How {
        match how {
            How::Modal if self.state.modes().distance == Some(crate::nc::Distance::Incremental) => {
                How::Incremental
            }
            How::Modal => How::Absolute,
            how => how,
        }
    }

    /// Digits behind the point for an axis.
    pub fn places(&self, axis: usize) -> usize {
        let rotary = self.control.axes[axis].rotary;
        let least = if !rotary && self.control.units == Units::Inch { 4 } else { 3 };
        self.options.decimals.unwrap_or_else(|| self.decimals[usize::from(rotary)].max(least))
    }
}
