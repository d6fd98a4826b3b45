//! An axis as a program names it: its address, the joint behind it, its numbers in m and rad.

use crate::machine::{JointKind, Machine};
use crate::nc::Units;

/// An address that is followed.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    address: String,
    command: Option<(usize, f64)>,
    tip: Option<usize>,
    rotary: bool,
}

/// X, Y, Z.
const TIP: [&str; 3] = ["X", "Y", "Z"];

impl Axis {
    /// The axes of a machine, and X, Y, Z where it lacks one of them.
    pub fn all(machine: &Machine) -> Vec<Axis> {
        let tip = |address: &str| TIP.iter().position(|t| *t == address);
        let mut axes: Vec<Axis> = (0..machine.commands().len())
            .map(|c| {
                let joint = machine.command_joint(c);
                let word = joint.nc_word();
                let address = word.address.to_ascii_uppercase();
                let rotary = joint.kind == JointKind::Revolute;
                Axis { tip: tip(&address), address, command: Some((c, f64::from(word.sign))), rotary }
            })
            .collect();
        for (k, address) in TIP.into_iter().enumerate() {
            if !axes.iter().any(|a| a.address == address) {
                axes.push(Axis { address: address.into(), command: None, tip: Some(k), rotary: false });
            }
        }
        // The order in which people write them: X Y Z first.
        axes.sort_by_key(|a| (a.tip.map_or(3, |k| k), a.address.clone()));
        axes
    }

    /// As the program writes it, `X`, `C1`.
    pub fn address(&self) -> &str {
        &self.address
    }

    /// The joint that it commands, and the sign of the program's number against the displacement.
    pub fn command(&self) -> Option<(usize, f64)> {
        self.command
    }

    /// 0, 1, 2 for X, Y, Z: component of the tip where the tool centre point function is on.
    pub fn tip(&self) -> Option<usize> {
        self.tip
    }

    pub fn is_rotary(&self) -> bool {
        self.rotary
    }

    /// A programmed number of this axis, m or rad.
    pub fn si(&self, value: f64, units: Units) -> f64 {
        if self.rotary { value.to_radians() } else { length_si(value, units) }
    }

    /// m or rad as the program writes it.
    pub fn programmed(&self, si: f64, units: Units) -> f64 {
        match (self.rotary, units) {
            (true, _) => si.to_degrees(),
            (false, Units::Millimetre) => si * 1e3,
            (false, Units::Inch) => si * 1e3 / 25.4,
        }
    }
}

/// A programmed length, m.
pub(super) fn length_si(value: f64, units: Units) -> f64 {
    match units {
        Units::Millimetre => value / 1e3,
        Units::Inch => value * 25.4 / 1e3,
    }
}
