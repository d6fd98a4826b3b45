//! Program frames that compose exactly: `TRANS`, `ROT` and their additive kin, `G52`, `G92`, `G68`.

use super::control::Control;
use crate::lie::{Pose, Vec3};
use crate::nc::{Block, Dialect, Kind, Plane, Value};

/// How coordinates of a block lie in the frame of the work offset.
#[derive(Clone, Debug)]
pub(super) struct Frame {
    /// Of X, Y, Z, m.
    pub pose: Pose<f64>,
    /// Of the other axes, m or rad, added.
    pub shift: Vec<f64>,
    /// The part of `pose` and `shift` that `G52` gave, and the part of `G92`, by axis.
    local: Vec<f64>,
    preset: Vec<f64>,
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
            shift: vec![0.0; axes],
            local: vec![0.0; axes],
            preset: vec![0.0; axes],
            turn: None,
        }
    }

    pub fn is_straight(&self) -> bool {
        let r = self.pose.rotation.0;
        (0..3).all(|i| (0..3).all(|j| r[i][j] == if i == j { 1.0 } else { 0.0 }))
    }

    /// Whether the rotation leaves component `k` alone.
    pub fn keeps(&self, k: usize) -> bool {
        (self.pose.rotation.0[k][k] - 1.0).abs() < 1e-12
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

/// Whether the block has this G word.
pub(super) fn has_g(block: &Block, code: f64) -> bool {
    block.words().iter().any(|w| w.address == "G" && w.number() == Some(code))
}

/// Takes a block that changes the frame into account. `place`: where each axis stands in program coordinates,
/// where that is known, m or rad.
pub(super) fn change(
    control: &mut Control,
    block: &Block,
    dialect: Dialect,
    plane: Option<Plane>,
    place: &[Option<f64>],
) -> Change {
    match dialect {
        Dialect::Siemens => siemens(control, block, plane),
        Dialect::Rs274 => rs274(control, block, plane, place),
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

fn siemens(control: &mut Control, block: &Block, plane: Option<Plane>) -> Change {
    let named = |t: &&crate::nc::Token| matches!(t.kind, Kind::Name | Kind::Call);
    let Some(token) = block.tokens().iter().find(named) else {
        return Change::Unknown(String::from_utf8_lossy(block.bytes()).trim().to_string());
    };
    let text = block.text(&token.span);
    let name = block.name(token);
    let axis_words: Vec<usize> = (0..block.words().len())
        .filter(|w| {
            let address = &block.words()[*w].address;
            control.axes.iter().any(|a| a.address == *address) || address == "RPL"
        })
        .collect();
    if axis_words.iter().any(|w| block.words()[*w].value == Value::Expression) {
        return Change::Unknown(text);
    }
    let axes = control.axes.len();
    let bare = axis_words.is_empty();
    let additive = name.starts_with('A');
    let inner = match name.as_str() {
        "TRANS" | "ATRANS" => {
            let mut p = [0.0; 3];
            let mut shift = vec![0.0; axes];
            for (i, axis) in control.axes.iter().enumerate() {
                let by = number(block, &axis.address).map_or(0.0, |v| control.si(i, v));
                match axis.tip {
                    Some(k) => p[k] = by,
                    None => shift[i] = by,
                }
            }
            if additive {
                control.frame.shift.iter_mut().zip(&shift).for_each(|(s, by)| *s += by);
            } else {
                control.frame.shift = shift;
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
        control.frame.pose = control.frame.pose * inner;
    } else {
        // Every absolute one takes the place of all before it.
        if matches!(name.as_str(), "ROT" | "SCALE" | "MIRROR") {
            control.frame.shift = vec![0.0; axes];
        }
        control.frame.pose = inner;
    }
    Change::Followed
}

fn rs274(control: &mut Control, block: &Block, plane: Option<Plane>, place: &[Option<f64>]) -> Change {
    let text = String::from_utf8_lossy(block.bytes()).trim().to_string();
    let axes = control.axes.len();
    let value = |control: &Control, i: usize| {
        let address = &control.axes[i].address;
        match block.words().iter().find(|w| w.address == *address) {
            None => Ok(None),
            Some(word) => word.number().map(|v| Some(control.si(i, v))).ok_or(()),
        }
    };
    let values: Result<Vec<Option<f64>>, ()> = (0..axes).map(|i| value(control, i)).collect();
    let Ok(values) = values else { return Change::Unknown(text) };
    if has_g(block, 52.0) || has_g(block, 92.0) {
        if control.frame.turn.is_some() {
            return Change::Unknown(text);
        }
        for (i, value) in values.into_iter().enumerate() {
            let Some(value) = value else { continue };
            if has_g(block, 52.0) {
                control.frame.local[i] = value;
            } else {
                let Some(now) = place[i] else { return Change::Unplaced(i) };
                control.frame.preset[i] += now - value;
            }
        }
    } else if has_g(block, 92.1) || has_g(block, 92.2) {
        if control.frame.turn.is_some() {
            return Change::Unknown(text);
        }
        control.frame.preset = vec![0.0; axes];
    } else if has_g(block, 68.0) {
        let (normal, first, second) = match plane {
            None | Some(Plane::Xy) => (2, "X", "Y"),
            Some(Plane::Zx) => (1, "Z", "X"),
            Some(Plane::Yz) => (0, "Y", "Z"),
        };
        let spatial = ["I", "J", "K"].iter().any(|a| block.words().iter().any(|w| w.address == **a));
        let at = |address: &str| {
            let axis = control.axes.iter().position(|a| a.address == address)?;
            Some((control.axes[axis].tip?, values[axis]?))
        };
        let (Some((k, u)), Some((l, v)), Some(angle), false) =
            (at(first), at(second), number(block, "R"), spatial)
        else {
            return Change::Unknown(text);
        };
        let mut centre = [0.0; 3];
        (centre[k], centre[l]) = (u, v);
        let centre = Vec3(centre);
        control.frame.turn =
            Some(Pose::translation(centre) * about(normal, angle.to_radians()) * Pose::translation(-centre));
    } else if has_g(block, 69.0) {
        control.frame.turn = None;
    } else if has_g(block, 50.0) && block.words().iter().any(|w| w.address == "S") {
        return Change::Followed;
    } else {
        return Change::Unknown(text);
    }
    let mut shift = [0.0; 3];
    for (i, axis) in control.axes.iter().enumerate() {
        let by = control.frame.local[i] + control.frame.preset[i];
        match axis.tip {
            Some(k) => shift[k] = by,
            None => control.frame.shift[i] = by,
        }
    }
    let shift = Pose::translation(Vec3(shift));
    control.frame.pose = control.frame.turn.map_or(shift, |turn| shift * turn);
    Change::Followed
}
