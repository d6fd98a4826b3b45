//! What stands for the reader of bags in a build without it.

use std::convert::Infallible;
use std::io::Read;
use std::path::Path;

use super::Request;
use super::map::Map;
use super::table::Table;
use crate::error::{Error, Place, Result};
use crate::foreign::{self, MCAP};
use crate::machine::Machine;

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
pub(super) fn read(
    file: &Path,
    _: Vec<(&Path, Box<dyn Read + '_>)>,
    _: Option<&Machine>,
    _: &Request,
) -> Result<Bagged> {
    let mend = foreign::of(file, MCAP).and_then(|it| it.mend).unwrap_or_default();
    let what = "this is a bag of ROS 2 (MCAP), which this build of kincal does not read";
    Err(Error::mistake(Place::file(file), what, mend))
}
