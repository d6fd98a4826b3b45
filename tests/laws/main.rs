//! Laws that hold for every machine, pose, recording and program: algebra against automatic differentiation, files there and back,
//! messages for what is at fault.

#[path = "../common/mod.rs"]
mod common;
#[path = "../mutated/mod.rs"]
mod mutated;
#[path = "../signatures/mod.rs"]
mod signatures_drawn;

mod arrays;
mod bad_effects;
mod bad_machines;
mod batch;
mod calibrated;
mod circular;
mod compensate;
mod convert;
mod convert_path;
mod convert_targets;
mod effects;
mod effects_in_files;
mod export;
mod export_controls;
mod export_drives;
mod export_motions;
mod export_springs;
mod features;
mod import;
mod import_dh;
mod import_linuxcnc;
mod import_mjcf;
mod interface;
mod inverse;
mod jacobians;
mod join;
mod lie;
mod location;
mod machines;
mod mutated_inputs;
mod nc;
mod partial;
mod recordings;
mod rooms;
mod signatures;
mod simulate;
