//! Numbers as text, as the standard library reads and writes them, in a fraction of its time. Where that is not certain, it is asked.

mod fixed;
mod read;
mod scientific;

pub(crate) use fixed::fixed;
pub(crate) use read::read;
pub(crate) use scientific::push;
