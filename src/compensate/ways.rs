//! From where each axis comes: only a way between two known places gives a direction of travel.

use crate::few::Few;

use super::control::Control;
use super::places::Places;

/// What was known at the position that the machine was last told to go to.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Ways {
    /// By axis: whether it was known where it stood.
    sure: Few<bool>,
    /// By command: whether its position was known.
    known: Few<bool>,
}

impl Ways {
    /// Nothing has been told.
    pub fn new(axes: usize, commands: usize) -> Self {
        Ways { sure: Few::from_elem(false, axes), known: Few::from_elem(false, commands) }
    }

    /// By command: whether its position is known, and whether its way there from the position last told is.
    fn judge(&self, control: &Control, places: &Places) -> (Few<bool>, Few<bool>) {
        let axes = || control.axes().iter().enumerate();
        let mut known = Few::from_elem(false, self.known.len());
        let mut ways = Few::from_slice(&known);
        // As nearly everywhere in a program.
        if places.sure().iter().zip(&self.sure).all(|(now, before)| *now && *before) {
            for (_, axis) in axes() {
                let Some((c, _)) = axis.command() else { continue };
                (known[c], ways[c]) = (true, self.known[c]);
            }
            return (known, ways);
        }
        // Where the tip is programmed, the places of the linear joints follow from all of its words. A rotary axis that the
        // program has not named is taken as standing at zero until it does.
        let tip = control.tcp()
            && axes().all(|(i, axis)| match (axis.tip(), axis.is_rotary()) {
                (Some(_), _) => places.is_sure(i),
                (None, true) => places.is_sure(i) || !places.is_parked(i),
                (None, false) => true,
            });
        let turned =
            control.tcp() && axes().any(|(i, axis)| axis.is_rotary() && places.is_sure(i) && !self.sure[i]);
        for (i, axis) in axes() {
            let Some((c, _)) = axis.command() else { continue };
            let by_tip = control.tcp() && axis.tip().is_some();
            known[c] = if by_tip { tip } else { places.is_sure(i) };
            ways[c] = known[c] && self.known[c] && !(by_tip && turned);
        }
        (known, ways)
    }

    /// By command: whether the way from the position last told to the one in force is known.
    pub fn open(&self, control: &Control, places: &Places) -> Few<bool> {
        self.judge(control, places).1
    }

    /// Takes the way to the one in force; by command whether it is known.
    pub fn take(&mut self, control: &Control, places: &Places) -> Few<bool> {
        let (known, ways) = self.judge(control, places);
        self.known = known;
        self.sure.copy_from_slice(places.sure());
        ways
    }

    /// The places of these axes turn out to be known; the ways there were not.
    pub fn assure(&mut self, axes: impl Iterator<Item = usize>, control: &Control, places: &Places) {
        axes.for_each(|axis| self.sure[axis] = true);
        self.known = self.judge(control, places).0;
    }
}
