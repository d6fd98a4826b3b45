//! Calibrates the geometry of any serial or bifurcated machine from recordings, by local products of exponentials.
//!
//! # The equation that is solved
//!
//! A machine is two lists of dyads from the base outwards, to the workpiece frame `w` and to the tool frame `t`. Each dyad is an
//! initial pose `M_j` and a joint `exp(xi_j q_j)`; everything that is wrong with the machine is a small twist `dh_j`
//! between them (`docs/model.md`, (10) and (11)):
//!
//! ```math
//! w_from_t = (Π_workpiece M_j exp(dh_j) exp(xi_j q_j))⁻¹ (Π_tool M_j exp(dh_j) exp(xi_j q_j))
//!
//! find dh:   minimise  Σ loss((measured - model(dh, q)) / sigma)  +  ½ Σ (dh / tolerance)²
//! ```
//!
//! Nothing in the code knows a particular machine: machines are RON files ([`machine`], `docs/machines.md`).
//!
//! # Rooms
//!
//! One noun a room. Imports run one way: a room uses only rooms above it in this table, and a test holds it to that. Rooms without a link
//! are for this crate alone; the feature `internals` opens them to its own tests, without any promise.
//!
//! | room | noun |
//! | --- | --- |
//! | `wording` | how messages word what they count and quote |
//! | `decimal` | numbers as text, read and written |
//! | `few` | short columns, a value for each joint or axis |
//! | `scalar` | [`Scalar`]: what kinematics is generic over, `f64` and dual numbers |
//! | [`lie`] | SE(3) and se(3): exp, log, adjoints, Jacobians |
//! | [`units`] | units at the borders, and what lengths and angles have one of each |
//! | `meter` | how much of a file a pass has read |
//! | `residual` | how large residuals are: sums from which RMS, mean and largest follow |
//! | [`error`] | places in what a user wrote, faults with their mend |
//! | `foreign` | files of other programs that are no text, by how they begin |
//! | `document` | RON texts, and where in them each value stands |
//! | [`machine`] | dyads, joints, the machine file |
//! | [`chain`] | poses and Jacobian rows of a machine with given deviations |
//! | [`sensor`] | what instruments read, and how that depends on every unknown |
//! | `check` | every Jacobian against forward-mode autodiff |
//! | `columnar` | tables in columns, Parquet and Arrow, as text and back (feature `columnar`) |
//! | `rosbag` | bags of ROS 2: joints, poses and frames by topic (feature `rosbag`) |
//! | [`recording`] | CSV recordings, streamed |
//! | `motion` | directions of travel, velocities, the history of a path |
//! | `feature` | what a deviation depends on, as a number for each sample |
//! | `error_motion` | smooth deviations along the travel of a joint |
//! | `variation` | deviations that are not constant: pieces by direction, terms |
//! | [`effects`] | the physics that a kinematic model leaves out, as data |
//! | `calibration` | [`CalibratedMachine`]: a machine file with its deviations |
//! | [`location`] | the same geometry as ISO 230-1 location errors |
//! | [`identify`] | from recordings to deviations: alignment, solvers, what the data see |
//! | [`mistakes`] | recordings and machines that do not belong together, and why |
//! | [`describe`](mod@describe) | topology, equation in symbols, identifiability |
//! | [`predict`](mod@predict) | what a calibrated machine says an instrument would read |
//! | [`circular`] | ballbar recordings along circles and cones, ISO 230-4 |
//! | `rivals` | identification by other schemes, and a filter, judged side by side |
//! | [`diagnose`](mod@diagnose) | where model and recordings differ, and what physics was left out |
//! | [`inverse`] | commands that bring the tool to a pose, for any chain |
//! | `nc` | NC programs: blocks, words, modal state; written back byte for byte |
//! | [`compensate`](mod@compensate) | NC programs rewritten so that the actual machine cuts what they mean |
//! | [`simulate`] | recordings of machines whose errors are known: faults, tests, instruments |
//! | [`convert`](mod@convert) | recordings from foreign tables (feature `import`) |
//! | [`import`](mod@import) | machines from URDF, MJCF, DH tables and LinuxCNC (feature `import`) |
//! | [`export`](mod@export) | calibrated machines as URDF, MJCF, DH tables, parameters of controls (feature `import`) |
//! | `demo` | the reference machine, a simulated recording, and what a diagnosis says of it |
//! | `cli` | the command line, a thin face over all of it (feature `cli`) |
//!
//! # A complete example
//!
//! A single linear axis measured by a tracker: declare, simulate an error, calibrate, compare.
//!
//! ```
//! use kincal::identify::{CalibrateOptions, calibrate};
//! use kincal::recording::Recording;
//! use kincal::Machine;
//!
//! let machine = Machine::parse("slide.ron", r#"Machine(
//!     name: "slide", units: (length: mm, angle: deg),
//!     workpiece: [(frame: "w")],
//!     tool: [(frame: "x", joint: Prismatic(axis: "x", travel: (0, 500))), (frame: "t", at: (0, 0, 80))],
//! )"#)?;
//! // The axis runs 40 um low over 400 mm.
//! let csv = "# measurement: position\n\
//!            x[mm],px[mm],py[mm],pz[mm]\n\
//!            0,0.001,0.000,80.000\n\
//!            100,100.000,0.000,79.990\n\
//!            200,200.001,0.001,79.980\n\
//!            300,300.000,0.000,79.971\n\
//!            400,399.999,0.000,79.960\n";
//! let recordings = [Recording::from_bytes("slide.csv", csv.as_bytes(), &machine)?];
//! let (calibrated, fit) = calibrate(&machine, &recordings, CalibrateOptions::default())?;
//! let rms = fit.rms.m.expect("lengths were measured");
//! assert!(rms.geometric < 0.1 * rms.nominal);
//! // The carriage moves along a line that is pitched by 0.1 mrad against the workpiece.
//! let about_y = |frame: &str| calibrated.deviations()[machine.frame_index(frame).expect("a frame")].w.0[1];
//! assert!((about_y("x") - about_y("w") - 1e-4).abs() < 2e-6);
//! # Ok::<(), kincal::Error>(())
//! ```
#![forbid(unsafe_code)]
#![warn(missing_docs, clippy::unwrap_used)]
// What only tests use is used by nobody where they are not built.
#![cfg_attr(not(feature = "internals"), allow(dead_code, unused_imports))]
// Rooms of this crate explain themselves to its developers, and link to each other.
#![allow(rustdoc::private_intra_doc_links)]

/// `use` of items that a public room keeps to this crate and, by the feature `internals`, to its tests.
macro_rules! inner {
    ($(use $path:ident::$items:tt;)+) => {$(
        #[cfg(feature = "internals")]
        #[doc(hidden)]
        pub use $path::$items;
        #[cfg(not(feature = "internals"))]
        pub(crate) use $path::$items;
    )+};
}

mod calibration;
pub mod chain;
#[cfg(not(feature = "internals"))]
mod check;
#[cfg(feature = "internals")]
#[doc(hidden)]
pub mod check;
pub mod circular;
#[cfg(feature = "cli")]
mod cli;
mod columnar;
pub mod compensate;
#[cfg(feature = "import")]
pub mod convert;
mod decimal;
#[cfg(not(feature = "internals"))]
mod demo;
#[cfg(feature = "internals")]
#[doc(hidden)]
pub mod demo;
pub mod describe;
pub mod diagnose;
mod document;
pub mod effects;
pub mod error;
#[cfg(not(feature = "internals"))]
mod error_motion;
#[cfg(feature = "internals")]
#[doc(hidden)]
pub mod error_motion;
#[cfg(feature = "import")]
pub mod export;
#[cfg(not(feature = "internals"))]
mod feature;
#[cfg(feature = "internals")]
#[doc(hidden)]
pub mod feature;
mod few;
mod foreign;
pub mod identify;
#[cfg(feature = "import")]
pub mod import;
pub mod inverse;
pub mod lie;
pub mod location;
pub mod machine;
mod meter;
pub mod mistakes;
#[cfg(not(feature = "internals"))]
mod motion;
#[cfg(feature = "internals")]
#[doc(hidden)]
pub mod motion;
#[cfg(not(feature = "internals"))]
mod nc;
#[cfg(feature = "internals")]
#[doc(hidden)]
pub mod nc;
pub mod predict;
pub mod recording;
mod residual;
#[cfg(not(feature = "internals"))]
mod rivals;
#[cfg(feature = "internals")]
#[doc(hidden)]
pub mod rivals;
#[cfg(feature = "rosbag")]
mod rosbag;
mod scalar;
pub mod sensor;
pub mod simulate;
pub mod units;
#[cfg(not(feature = "internals"))]
mod variation;
#[cfg(feature = "internals")]
#[doc(hidden)]
pub mod variation;
mod wording;

pub use calibration::{CalibratedMachine, LeftOut};
pub use chain::{Chain, Sweep};
#[cfg(feature = "cli")]
#[doc(hidden)]
pub use cli::{face, run as run_command_line};
pub use error::{Error, Place, Result};
pub use machine::Machine;
/// The linear algebra of this crate's interface: [`lie`] converts to and from its poses and vectors.
pub use nalgebra;
/// Dual numbers: what a [`Scalar`] is besides `f64`, for derivatives of poses by any number that goes in.
pub use num_dual;
pub use recording::Recording;
pub use scalar::Scalar;

/// The README's examples run as tests.
#[doc = include_str!("../README.md")]
#[cfg(doctest)]
pub struct ReadmeDoctests;
