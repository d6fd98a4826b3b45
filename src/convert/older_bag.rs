//! Bags of ROS that are no MCAP files: known, and refused with what makes one of them.

use std::path::Path;

use crate::error::{Error, Place, Result};

/// # Errors
/// [`Error::Input`] if a file is one of these.
pub(super) fn refuse(file: &Path, bytes: &[u8]) -> Result<()> {
    let name = file.display();
    let (what, mend) = if bytes.starts_with(b"#ROSBAG V") {
        let mend = format!(
            "`rosbags-convert --src '{name}' --dst NEW --dst-storage mcap` (pip install rosbags) makes a folder with an MCAP file of it"
        );
        ("this is a bag of ROS 1, which is not read", mend)
    } else if bytes.starts_with(b"SQLite format 3\0")
        && file.extension().is_some_and(|ending| ending == "db3")
    {
        let mend = "`rosbags-convert --src FOLDER --dst NEW --dst-storage mcap` (pip install rosbags), or `ros2 bag convert`, makes an MCAP file of the folder that it is in";
        ("this is a bag of ROS 2 in SQLite, which is not read", mend.into())
    } else {
        return Ok(());
    };
    Err(Error::mistake(Place::file(file), what, mend))
}
