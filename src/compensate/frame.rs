//! Program frames that compose exactly: `TRANS`, `ROT` and their additive kin, `G52`, `G92`, `G68`.

use super::axis::Axis;
use super::code::has_g;
use crate::few::Few;
use crate::lie::{Pose, Vec3};
use crate::nc::{Block, Dialect, Kind, Plane, Token, Units, Value};

/// How coordinates of a block lie in the frame of the work offset.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Frame {
    /// Of X, Y, Z, m.
    pose: Pose<f64>,
    /// Of the other axes, m or rad, added.
    shift: Few<f64>,
    /// The part of `pose` and `shift` that `G52` gave, and the part of `G92`, by axis.
    local: Few<f64>,
    preset: Few<f64>,
    /// By how much coordinates as written are smaller than those that are meant, by axis: what rounding left of the numbers of `G92`.
    slip: Few<f64>,
    /// `G68`: inside the shifts.
    turn: Option<Pose<f64>>,
}

/// What a block made of the frame.
pub(super) enum Change {
    /// It is followed.
    Followed,
    /// It is not; the text at fault.
    Unknown(String),
    /// `G92` of an axis whose place is not known.
    Unplaced(usize),
}

impl Frame {
    pub fn new(axes: usize) -> Self {
        Frame {
            pose: Pose::identity(0.0),
            shift: Few::from_elem(0.0, axes),
            local: Few::from_elem(0.0, axes),
            preset: Few::from_elem(0.0, axes),
            slip: Few::from_elem(0.0, axes),
            turn: None,
        }
    }

    /// By how much the numbers of a program that is written are smaller than its coordinates, by axis, m or rad.
    pub fn slip(&self, axes: &[Axis]) -> Few<f64> {
        let mut outside = [0.0; 3];
        for (axis, slip) in axes.iter().zip(&self.slip) {
            if let Some(k) = axis.tip() {
                outside[k] = *slip;
            }
        }
        let inside = self.pose.rotation.transpose() * Vec3(outside);
        let mut slip = Few::from_slice(&self.slip);
        for (axis, slip) in axes.iter().zip(&mut slip) {
            *slip = axis.tip().map_or(*slip, |k| inside.0[k]);
        }
        slip
    }

    /// The number of a preset has been written smaller by `slip` than the place that it names.
    pub fn set_slip(&mut self, axis: usize, slip: f64) {
        self.slip[axis] = slip;
    }

    /// Whether nothing is turned.
    pub fn is_straight(&self) -> bool {
        let r = self.pose.rotation.0;
        (0..3).all(|i| (0..3).all(|j| r[i][j] == if i == j { 1.0 } else { 0.0 }))
    }

    /// Of X, Y, Z.
    pub fn pose(&self) -> Pose<f64> {
        self.pose
    }

    /// What is added to the other axes, m or rad; 0 for X, Y, Z.
    pub fn shift(&self, axis: usize) -> f64 {
        self.shift[axis]
    }

    /// Whether the rotation leaves component `k` alone.
    pub fn keeps(&self, k: usize) -> bool {
        (self.pose.rotation.0[k][k] - 1.0).abs() < 1e-12
    }

    /// Takes a block that changes the frame into account. `place`: where each axis stands in program coordinates,
    /// where that is known, m or rad.
    pub fn change(
        &mut self,
        block: &Block,
        dialect: Dialect,
        (axes, units): (&[Axis], Units),
        plane: Option<Plane>,
        place: &[Option<f64>],
    ) -> Change {
        match dialect {
            Dialect::Siemens => self.siemens(block, (axes, units), plane),
            Dialect::Rs274 => self.rs274(block, (axes, units), plane, place),
            Dialect::Heidenhain => {
                let text = String::from_utf8_lossy(block.bytes()).trim().to_string();
                // `PLANE RESET` takes away what was never let in.
                if text.to_ascii_uppercase().contains("PLANE RESET") {
                    Change::Followed
                } else {
                    Change::Unknown(text)
                }
            }
        }
    }

    fn siemens(&mut self, block: &Block, (axes, units): (&[Axis], Units), plane: Option<Plane>) -> Change {
        let named = |t: &&Token| matches!(t.kind, Kind::Name | Kind::Call);
        let Some(token) = block.tokens().iter().find(named) else {
            return Change::Unknown(String::from_utf8_lossy(block.bytes()).trim().to_string());
        };
        let text = block.text(&token.span);
        let name = block.name(token);
        let axis_words: Vec<usize> = (0..block.words().len())
            .filter(|w| {
                let address = &block.words()[*w].address;
                axes.iter().any(|a| *address == *a.address()) || *address == "RPL"
            })
            .collect();
        if axis_words.iter().any(|w| block.words()[*w].value == Value::Expression) {
            return Change::Unknown(text);
        }
        let count = axes.len();
        let bare = axis_words.is_empty();
        let additive = name.starts_with('A');
        let inner = match name.as_str() {
            "TRANS" | "ATRANS" => {
                let mut p = [0.0; 3];
                let mut shift = Few::from_elem(0.0, count);
                for (i, axis) in axes.iter().enumerate() {
                    let by = number(block, axis.address()).map_or(0.0, |v| axis.si(v, units));
                    match axis.tip() {
                        Some(k) => p[k] = by,
                        None => shift[i] = by,
                    }
                }
                if additive {
                    self.shift.iter_mut().zip(&shift).for_each(|(s, by)| *s += by);
                } else {
                    self.shift = shift;
                }
                Pose::translation(Vec3(p))
            }
            "ROT" | "AROT" => {
                let normal = match plane {
                    None | Some(Plane::Xy) => 2,
                    Some(Plane::Zx) => 1,
                    Some(Plane::Yz) => 0,
                };
                let angle = |address: &str| number(block, address).map(f64::to_radians);
                match angle("RPL") {
                    Some(in_plane) => about(normal, in_plane),
                    // Roll, pitch, yaw: about Z, then the new Y, then the new X.
                    None => ["Z", "Y", "X"]
                        .into_iter()
                        .zip([2, 1, 0])
                        .filter_map(|(address, k)| angle(address).map(|a| about(k, a)))
                        .fold(Pose::identity(0.0), |pose, turn| pose * turn),
                }
            }
            "SCALE" | "MIRROR" if bare => Pose::identity(0.0),
            "CYCLE800" if text.ends_with("()") => return Change::Followed,
            "TOROTOF" | "PAROTOF" => return Change::Followed,
            _ => return Change::Unknown(text),
        };
        if additive {
            self.pose = self.pose * inner;
        } else {
            // Every absolute one takes the place of all before it.
            if matches!(name.as_str(), "ROT" | "SCALE" | "MIRROR") {
                self.shift = Few::from_elem(0.0, count);
            }
            self.pose = inner;
        }
        Change::Followed
    }

    fn rs274(
        &mut self,
        block: &Block,
        (axes, units): (&[Axis], Units),
        plane: Option<Plane>,
        place: &[Option<f64>],
    ) -> Change {
        let text = String::from_utf8_lossy(block.bytes()).trim().to_string();
        let count = axes.len();
        let value = |i: usize| {
            let axis = &axes[i];
            match block.words().iter().find(|w| w.address == axis.address()) {
                None => Ok(None),
                Some(word) => word.number().map(|v| Some(axis.si(v, units))).ok_or(()),
            }
        };
        let values: Result<Vec<Option<f64>>, ()> = (0..count).map(value).collect();
        let Ok(values) = values else { return Change::Unknown(text) };
        let (local, preset) = (has_g(block, 52.0), has_g(block, 92.0));
        // Some controls keep both apart, to others they are one and the same.
        let in_force = |shift: &[f64]| shift.iter().any(|by| *by != 0.0);
        let presets = preset || has_g(block, 92.1) || has_g(block, 92.2);
        if local && in_force(&self.preset) || presets && in_force(&self.local) {
            return Change::Unknown(text);
        }
        if local || preset {
            if self.turn.is_some() {
                return Change::Unknown(text);
            }
            for (i, value) in values.into_iter().enumerate() {
                let Some(value) = value else { continue };
                if local {
                    self.local[i] = value;
                } else {
                    let Some(now) = place[i] else { return Change::Unplaced(i) };
                    self.preset[i] += now - value;
                }
            }
        } else if has_g(block, 92.1) || has_g(block, 92.2) {
            if self.turn.is_some() {
                return Change::Unknown(text);
            }
            self.preset = Few::from_elem(0.0, count);
            self.slip = Few::from_elem(0.0, count);
        } else if has_g(block, 68.0) {
            let (normal, first, second) = match plane {
                None | Some(Plane::Xy) => (2, "X", "Y"),
                Some(Plane::Zx) => (1, "Z", "X"),
                Some(Plane::Yz) => (0, "Y", "Z"),
            };
            let spatial = ["I", "J", "K"].iter().any(|a| block.words().iter().any(|w| w.address == **a));
            let at = |address: &str| {
                let axis = axes.iter().position(|a| a.address() == address)?;
                Some((axes[axis].tip()?, values[axis]?))
            };
            let (Some((k, u)), Some((l, v)), Some(angle), false) =
                (at(first), at(second), number(block, "R"), spatial)
            else {
                return Change::Unknown(text);
            };
            let mut centre = [0.0; 3];
            (centre[k], centre[l]) = (u, v);
            let centre = Vec3(centre);
            self.turn = Some(
                Pose::translation(centre) * about(normal, angle.to_radians()) * Pose::translation(-centre),
            );
        } else if has_g(block, 69.0) {
            self.turn = None;
        } else if has_g(block, 50.0) && block.words().iter().any(|w| w.address == "S") {
            return Change::Followed;
        } else {
            return Change::Unknown(text);
        }
        let mut shift = [0.0; 3];
        for (i, axis) in axes.iter().enumerate() {
            let by = self.local[i] + self.preset[i];
            match axis.tip() {
                Some(k) => shift[k] = by,
                None => self.shift[i] = by,
            }
        }
        let shift = Pose::translation(Vec3(shift));
        self.pose = self.turn.map_or(shift, |turn| shift * turn);
        Change::Followed
    }
}

/// A turn about the k-th axis.
fn about(k: usize, angle: f64) -> Pose<f64> {
    Pose::turn(Vec3(std::array::from_fn(|i| if i == k { 1.0 } else { 0.0 })), angle)
}

/// The word of an address as a number.
fn number(block: &Block, address: &str) -> Option<f64> {
    block.words().iter().find(|w| w.address == address).and_then(|w| w.number())
}
