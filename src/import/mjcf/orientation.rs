//! How a frame of MJCF is turned: quaternion, axis and angle, Euler angles, two axes, or where z points.

use roxmltree::Node;

use super::super::step::Move;
use super::super::xml::Source;
use super::settings::Settings;
use crate::error::Result;
use crate::lie::{Mat3, Pose, Vec3};

const WORDS: [&str; 5] = ["quat", "axisangle", "euler", "xyaxes", "zaxis"];

/// A vector of length 1; nothing where it has no direction.
pub(super) fn unit(v: Vec3<f64>) -> Option<Vec3<f64>> {
    let largest = v.0.iter().fold(0.0, |a: f64, x| a.max(x.abs()));
    // By the largest component first: squares of the smallest numbers vanish.
    let scaled = v.times(1.0 / largest);
    (largest > 0.0).then(|| scaled.times(1.0 / scaled.norm()))
}

/// The turn that an element states, or else the first of its defaults that states one.
pub(super) fn moves(source: &Source, settings: &Settings, node: Node, which: &[Node]) -> Result<Vec<Move>> {
    let stated = |n: &&Node| WORDS.iter().any(|word| n.attribute(*word).is_some());
    let Some(own) = which.iter().find(stated).copied() else { return Ok(Vec::new()) };
    let words: Vec<&str> = WORDS.into_iter().filter(|word| own.attribute(*word).is_some()).collect();
    if let [one, other, ..] = words[..] {
        let what = format!("<{}> states both `{one}` and `{other}`", own.tag_name().name());
        return Err(source.fault(own, what, "keep one of them"));
    }
    let no_direction = |word: &str| {
        let what = format!("`{word}` of <{}> has no direction", node.tag_name().name());
        source.fault(own, what, "write a vector that is not zero")
    };
    let turn = |rotation: Mat3<f64>| Move::Pose(Pose { rotation, translation: Vec3([0.0; 3]) });
    if let Some(quaternion) = source.finite::<4>(own, "quat")? {
        return Ok(vec![turn(of_quaternion(quaternion).ok_or_else(|| no_direction("quat"))?)]);
    }
    if let Some([x, y, z, angle]) = source.finite::<4>(own, "axisangle")? {
        let axis = unit(Vec3([x, y, z])).ok_or_else(|| no_direction("axisangle"))?;
        return Ok(vec![Move::Pose(Pose::turn(axis, settings.angle(angle)))]);
    }
    if let Some(angles) = source.finite::<3>(own, "euler")? {
        return Ok(of_euler(settings, angles));
    }
    if let Some([a, b, c, d, e, f]) = source.finite::<6>(own, "xyaxes")? {
        let x = unit(Vec3([a, b, c])).ok_or_else(|| no_direction("xyaxes"))?;
        let y = Vec3([d, e, f]);
        let y = unit(y - x.times(x.dot(y))).ok_or_else(|| no_direction("xyaxes"))?;
        return Ok(vec![turn(Mat3([x.0, y.0, x.cross(y).0]).transpose())]);
    }
    if let Some(z) = source.finite::<3>(own, "zaxis")? {
        return Ok(vec![turn(of_z(unit(Vec3(z)).ok_or_else(|| no_direction("zaxis"))?))]);
    }
    Ok(Vec::new())
}

/// Rotation of a quaternion (w, x, y, z) of any length.
fn of_quaternion(quaternion: [f64; 4]) -> Option<Mat3<f64>> {
    let largest = quaternion.iter().fold(0.0, |a: f64, x| a.max(x.abs()));
    if largest == 0.0 {
        return None;
    }
    let scaled = quaternion.map(|x| x / largest);
    let length = scaled.iter().map(|x| x * x).sum::<f64>().sqrt();
    let [w, x, y, z] = scaled.map(|x| x / length);
    Some(Mat3([
        [w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ]))
}

/// Small letters turn about axes that turn along, capitals about those that stand still.
fn of_euler(settings: &Settings, angles: [f64; 3]) -> Vec<Move> {
    let mut moves: Vec<Move> = Vec::new();
    for (letter, angle) in settings.euler.iter().zip(angles) {
        let axis = match letter.to_ascii_lowercase() {
            'x' => 0,
            'y' => 1,
            _ => 2,
        };
        let own = Move::Turn(axis, settings.angle(angle));
        let at = if letter.is_ascii_lowercase() { moves.len() } else { 0 };
        moves.insert(at, own);
    }
    moves
}

/// The smallest turn that takes z to this unit vector.
fn of_z(z: Vec3<f64>) -> Mat3<f64> {
    let up = Vec3([0.0, 0.0, 1.0]);
    let across = up.cross(z);
    let sine = across.norm();
    let axis = if sine < 1e-15 { Vec3([1.0, 0.0, 0.0]) } else { across.times(1.0 / sine) };
    Pose::turn(axis, sine.atan2(z.0[2])).rotation
}

/// The middle between two points, z pointing from the second to the first.
pub(super) fn between([a, b, c, d, e, f]: [f64; 6]) -> Vec<Move> {
    let (from, to) = (Vec3([a, b, c]), Vec3([d, e, f]));
    let rotation = unit(from - to).map_or(Mat3::identity(0.0), of_z);
    vec![Move::Pose(Pose { rotation, translation: (from + to).times(0.5) })]
}
