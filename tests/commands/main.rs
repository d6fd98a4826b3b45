//! The command line: what the program prints and writes, and whether the documents say the same.

#[path = "../common/mod.rs"]
mod common;

mod browser;
mod calls;
mod cli;
mod compare;
mod compensate;
mod demo;
mod diagnose;
mod docs_convert;
mod docs_effects;
mod docs_equations;
mod docs_measure;
mod docs_recordings;
mod documents;
mod export;
mod files;
mod interrupted;
mod loads;
mod machines_in;
mod new;
mod outputs;
mod program;
mod report;
mod simulate;
mod streams;
mod verdict;
