//! What stands for the reader of bags in a build without it.

use std::convert::Infallible;
use std::io::Read;
use std::path::Path;

use super::Request;
use super::map::Map;
use super::table::Table;
use crate::error::{Error, Place, Result};
use crate::machine::Machine;

/// How a bag begins.
pub(super) const MAGIC: &[u8] = b"\x89MCAP0\r\n";

/// The table of a bag that nothing reads.
pub(super) struct Bagged {
    pub table: Table,
    pub request: Request,
    never: Infallible,
}

impl Bagged {
    pub fn settled(&mut self, _: &Map, _: Option<&Machine>) -> Result<Vec<String>> {
        match self.never {}
    }
}

pub(super) fn order(_: &mut Map) {}

/// # Errors
/// Always: how to build a reader.
pub(super) fn read(file: &Path, _: impl Read, _: Option<&Machine>, _: &Request) -> Result<Bagged> {
    let what = "this is a bag of ROS 2 (MCAP), which this build of kincal does not read";
    let mend = "build it with `--features rosbag`; the module for Python reads bags: `pip install ./python`";
    Err(Error::mistake(Place::file(file), what, mend))
}
