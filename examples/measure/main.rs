//! Measurements that no test judges; the data sets stand beside the project, or where `KINCAL_DATA` says.
//!
//! ```text
//! cargo run --release --features measure --example measure -- concealment --draws 60 --seed 7
//! cargo run --release --features measure --example measure -- losses
//! cargo run --release --features measure --example measure -- tolerances
//! cargo run --release --features measure --example measure -- terms kuka gravity_compliance@q2,lateral_compliance@q1
//! cargo run --release --features measure --example measure -- columns
//! ```

mod columns;
#[path = "../../tests/common/mod.rs"]
mod common;
#[path = "../../tests/real/data_sets/concealed.rs"]
mod concealed;
mod concealment;
#[path = "../../tests/real/data_sets/left_out.rs"]
mod left_out;
#[path = "../../tests/real/data_sets/sets.rs"]
mod sets;
mod side_by_side;
#[path = "../../tests/real/data_sets/terms.rs"]
mod terms;

use std::path::PathBuf;

use clap::{Parser, Subcommand};

/// Measures what no test judges.
#[derive(Parser)]
struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    /// Conceals effects in real recordings and counts how many the diagnosis names.
    Concealment(concealment::Arguments),
    /// What each loss leaves on rows left out, mm.
    Losses,
    /// The same by the tolerance of frames that state none.
    Tolerances,
    /// Fits the sets whose names begin with SET with effects that are given.
    Terms {
        set: String,
        /// `effect@joint,...`, several lists apart by `|`.
        terms: String,
        /// A file of further families.
        #[arg(long, value_name = "FILE")]
        effects: Option<PathBuf>,
        /// Prints no coefficients.
        #[arg(long)]
        quiet: bool,
    },
    /// How long the columns of all candidate effects take.
    Columns,
}

fn main() {
    match Arguments::parse().what {
        What::Concealment(arguments) => concealment::run(&arguments),
        What::Losses => side_by_side::losses(),
        What::Tolerances => side_by_side::tolerances(),
        What::Terms { set, terms, effects, quiet } => {
            side_by_side::given(&set, &terms, effects.as_deref(), quiet);
        }
        What::Columns => columns::run(),
    }
}
