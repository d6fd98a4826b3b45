//! Other machines that recordings may be of: those that come with the program, and the same with its branches exchanged.

use super::thinned::{Sample, Thinned};
use crate::error::Result;
use crate::machine::{Machine, MachineForm};
use crate::recording::Recording;

/// The texts of the machines that come with the program; a test compares them with the folder.
const SHIPPED: [&str; 23] = [
    include_str!("../../machines/ac_head_head.ron"),
    include_str!("../../machines/ac_table_tilting.ron"),
    include_str!("../../machines/ac_table_tilting_paper.ron"),
    include_str!("../../machines/bc_head_head.ron"),
    include_str!("../../machines/bc_head_head_nutating.ron"),
    include_str!("../../machines/bc_head_table.ron"),
    include_str!("../../machines/bc_nutating_table.ron"),
    include_str!("../../machines/bc_table_tilting.ron"),
    include_str!("../../machines/dlr_justin_left.ron"),
    include_str!("../../machines/dlr_justin_right.ron"),
    include_str!("../../machines/fanuc_r2000ic_165f.ron"),
    include_str!("../../machines/four_axis_horizontal.ron"),
    include_str!("../../machines/franka_panda.ron"),
    include_str!("../../machines/hilti_jaibot.ron"),
    include_str!("../../machines/kinova_gen3_lite.ron"),
    include_str!("../../machines/kuka_iiwa14.ron"),
    include_str!("../../machines/linear_axis.ron"),
    include_str!("../../machines/puma560.ron"),
    include_str!("../../machines/rotary_axis.ron"),
    include_str!("../../machines/scara.ron"),
    include_str!("../../machines/six_r_arm.ron"),
    include_str!("../../machines/ur10.ron"),
    include_str!("../../machines/xyz_mill.ron"),
];

/// A machine in place of the one that was given.
pub(super) struct Other {
    /// As the part of a sentence that follows "with".
    pub what: String,
    pub mend: String,
    pub machine: Machine,
}

/// Every machine whose commands have the same names and kinds.
pub(super) fn others(machine: &Machine) -> Vec<Other> {
    let joints = |m: &Machine| {
        let mut all: Vec<(String, bool)> = (m.commands().iter().enumerate())
            .map(|(c, name)| (name.clone(), super::change::turns(m, c)))
            .collect();
        all.sort();
        all
    };
    let own = joints(machine);
    let mut all: Vec<Other> = (shipped().into_iter())
        .filter(|other| other.name() != machine.name() && joints(other) == own)
        .map(|other| Other {
            what: format!("machine {}", other.name()),
            mend: format!("take the file of {}", other.name()),
            machine: other,
        })
        .collect();
    all.extend(exchanged(machine).map(|other| Other {
        what: "the branches exchanged".into(),
        mend: "exchange `workpiece` and `tool` in the machine file: what carries the part, and what carries the tool".into(),
        machine: other,
    }));
    all
}

/// The machines that come with the program.
pub(super) fn shipped() -> Vec<Machine> {
    SHIPPED.iter().filter_map(|text| Machine::parse("shipped", text).ok()).collect()
}

/// The machine with its branches exchanged; none where something hangs beside the chain.
fn exchanged(machine: &Machine) -> Option<Machine> {
    let mut form: MachineForm<()> = machine.to_form();
    if !form.side_branches.is_empty() {
        return None;
    }
    std::mem::swap(&mut form.workpiece, &mut form.tool);
    form.workpiece.last_mut()?.frame = "w".into();
    form.tool.last_mut()?.frame = "t".into();
    Machine::from_form(&form).ok()
}

impl Other {
    /// The recordings as of this machine.
    pub fn recordings(&self, of: &Machine, thinned: &[Thinned]) -> Result<Vec<Recording>> {
        let from: Vec<usize> = (self.machine.commands().iter())
            .filter_map(|name| of.commands().iter().position(|own| own == name))
            .collect();
        let one = |thinned: &Thinned| {
            let mut other = thinned.clone();
            other.head.retain(|line| !line.trim_start_matches('#').trim_start().starts_with("machine"));
            let turned =
                |s: &Sample| Sample { commands: from.iter().map(|c| s.commands[*c]).collect(), ..s.clone() };
            other.samples = thinned.samples.iter().map(turned).collect();
            other.recording(&self.machine)
        };
        thinned.iter().map(one).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::{SHIPPED, shipped};

    #[test]
    fn every_machine_of_the_folder_is_tried() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/machines");
        let files = std::fs::read_dir(folder).expect("the folder").filter_map(Result::ok);
        let files = files.filter(|file| file.path().extension().is_some_and(|end| end == "ron")).count();
        assert_eq!((SHIPPED.len(), shipped().len()), (files, files));
    }
}
