//! Bags of ROS 2: what a robot and a tracker have published, recorded in an MCAP file.
//!
//! A bag holds messages by topic, each with the text of its type. Read are positions of joints (`sensor_msgs/JointState`) and poses
//! (`geometry_msgs/PoseStamped`, `geometry_msgs/TransformStamped`, `nav_msgs/Odometry`, `tf2_msgs/TFMessage`); all other topics are known by
//! name, and no more. Moments are those in the headers of messages, ns; when a message came to the recorder is of no account.
//!
//! Everything is read in one pass, in memory that grows with what is kept of these messages, not with the cameras beside them.

mod bag;
mod cdr;
mod container;
mod definition;
mod frames;
mod idl;
mod message;
mod schema;
mod track;

pub(crate) use bag::{Bag, Holds, Joints, Poses, Topic};
pub(crate) use frames::{Link, Step, along};
pub(crate) use message::Posed;
pub(crate) use track::{Around, Track};

/// Why something in a bag is not read, and the mend.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Fault {
    pub what: String,
    pub mend: String,
}

impl Fault {
    fn new(what: impl Into<String>, mend: impl Into<String>) -> Fault {
        Fault { what: what.into(), mend: mend.into() }
    }
}
