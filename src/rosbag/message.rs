//! Messages that are read, by type.

use super::cdr::{Cdr, Wrong};

/// A type of messages that is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    JointState,
    Pose,
    Transform,
    Odometry,
    Frames,
}

impl Kind {
    /// By the name of the type, `package/msg/Type` or `package/Type`.
    pub fn named(name: &str) -> Option<Kind> {
        Some(match super::definition::plain(name).as_str() {
            "sensor_msgs/JointState" => Kind::JointState,
            "geometry_msgs/PoseStamped" => Kind::Pose,
            "geometry_msgs/TransformStamped" => Kind::Transform,
            "nav_msgs/Odometry" => Kind::Odometry,
            "tf2_msgs/TFMessage" => Kind::Frames,
            _ => return None,
        })
    }
}

/// Position and rotation of one frame in another one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Posed {
    /// m.
    pub position: [f64; 3],
    /// Quaternion, scalar part first.
    pub quaternion: [f64; 4],
}

impl Posed {
    /// Whether it says anything: trackers that have lost their target send zeros or NaN.
    pub fn is_given(&self) -> bool {
        let finite = self.position.iter().chain(&self.quaternion).all(|x| x.is_finite());
        finite && self.quaternion.iter().any(|x| *x != 0.0)
    }
}

/// Moment and frame of a message.
pub(super) struct Header<'a> {
    /// ns.
    pub stamp: i64,
    pub frame: &'a str,
}

/// Names and positions; the latter are empty where only velocities or efforts are sent.
pub(super) struct JointState<'a> {
    pub stamp: i64,
    pub names: Vec<&'a str>,
    pub positions: Vec<f64>,
}

/// A pose with its frames; `child` is empty where the message names none.
pub(super) struct Stamped<'a> {
    pub header: Header<'a>,
    pub child: &'a str,
    pub pose: Posed,
}

fn header<'a>(cdr: &mut Cdr<'a>) -> Result<Header<'a>, Wrong> {
    let (seconds, nanoseconds) = (cdr.i32()?, cdr.u32()?);
    if nanoseconds >= 1_000_000_000 {
        return Err(format!("its stamp has {nanoseconds} ns beside its seconds"));
    }
    let stamp = i64::from(seconds) * 1_000_000_000 + i64::from(nanoseconds);
    Ok(Header { stamp, frame: frame(cdr.text()?) })
}

/// Frames had a slash before their names once.
fn frame(name: &str) -> &str {
    name.strip_prefix('/').unwrap_or(name)
}

fn posed(cdr: &mut Cdr) -> Result<Posed, Wrong> {
    let position = cdr.f64s()?;
    let [x, y, z, w] = cdr.f64s()?;
    Ok(Posed { position, quaternion: [w, x, y, z] })
}

fn transform<'a>(cdr: &mut Cdr<'a>) -> Result<Stamped<'a>, Wrong> {
    Ok(Stamped { header: header(cdr)?, child: frame(cdr.text()?), pose: posed(cdr)? })
}

pub(super) fn joint_state(message: &[u8]) -> Result<JointState<'_>, Wrong> {
    let mut cdr = Cdr::new(message)?;
    let stamp = header(&mut cdr)?.stamp;
    let names: Vec<&str> = (0..cdr.count(4)?).map(|_| cdr.text()).collect::<Result<_, _>>()?;
    let positions = cdr.numbers()?;
    let (_velocities, _efforts) = (cdr.numbers()?, cdr.numbers()?);
    cdr.end()?;
    if !positions.is_empty() && positions.len() != names.len() {
        return Err(format!("it has {} names and {} positions", names.len(), positions.len()));
    }
    Ok(JointState { stamp, names, positions })
}

/// The pose of a message of one of the three types that hold one.
pub(super) fn stamped(kind: Kind, message: &[u8]) -> Result<Stamped<'_>, Wrong> {
    let mut cdr = Cdr::new(message)?;
    let stamped = match kind {
        Kind::Pose => Stamped { header: header(&mut cdr)?, child: "", pose: posed(&mut cdr)? },
        Kind::Odometry => {
            let stamped = transform(&mut cdr)?;
            // Covariance, velocities, their covariance.
            let _: [f64; 36 + 6 + 36] = cdr.f64s()?;
            stamped
        }
        _ => transform(&mut cdr)?,
    };
    cdr.end()?;
    Ok(stamped)
}

pub(super) fn frames(message: &[u8]) -> Result<Vec<Stamped<'_>>, Wrong> {
    let mut cdr = Cdr::new(message)?;
    let all = (0..cdr.count(64)?).map(|_| transform(&mut cdr)).collect::<Result<_, _>>()?;
    cdr.end()?;
    Ok(all)
}
