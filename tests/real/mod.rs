//! Every test here needs the data sets: other people's recordings and tables, in the folder `shared` beside the project, or where
//! `KINCAL_DATA` says. None runs by default; one that runs and finds no data fails and says so. In other rooms such tests stand in a
//! module of the same name, so that `--skip data_sets::` leaves out all of them, as `.ci/run` does where there are no data.

mod concealed;
mod concealment;
mod left_out;
mod optimum;
mod peers;
mod physics;
mod recordings;
mod sets;
mod side_branches;
mod terms;
