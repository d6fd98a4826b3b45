//! What hangs on a machine beside the chain that is measured: another arm, a counterweight, a cable carrier.

use std::collections::BTreeSet;

use super::at_value;
use super::number::Checked;
use super::read::{check_dyad, usable_name};
use super::{Dyad, Joint, JointKind, Machine, MachineFault};
use crate::error::Result;

/// Frames and joints that stand on a frame of the machine and weigh on it; nothing of them is measured or identified. Their joints are
/// extra columns of recordings, by name.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq)]
pub struct SideBranch {
    /// Frame of the machine that carries it, behind that frame's joint.
    pub on: String,
    /// Name of the machine as which its own recordings are made: their rows are of the same moments, and their columns say where it stands.
    /// Its joints then bear a common name before a point.
    pub recorded_as: Option<String>,
    /// From there outwards.
    pub dyads: Vec<Dyad>,
}

impl SideBranch {
    /// What all its joints' names have before a point: `right` of right.q1 and right.q2.
    pub fn prefix(&self) -> Option<&str> {
        let mut names = self.columns().map(|(name, _)| name.split_once('.').map(|(prefix, _)| prefix));
        let first = names.next()??;
        names.all(|name| name == Some(first)).then_some(first)
    }

    /// Names and units (`m`, `rad`) of the columns that say how it stands.
    pub fn columns(&self) -> impl Iterator<Item = (&str, &'static str)> {
        self.dyads.iter().filter_map(|dyad| dyad.joint.as_ref()).map(|joint| {
            let unit = match joint.kind {
                JointKind::Prismatic => "m",
                JointKind::Revolute => "rad",
            };
            (joint.name.as_str(), unit)
        })
    }
}

impl Machine {
    /// The same machine with what hangs on it beside the chain.
    ///
    /// # Errors
    /// If a frame or joint is named twice, stands on no frame of the machine, or states what only a chain that is measured can have.
    pub fn with_side_branches(self, side_branches: Vec<SideBranch>) -> Result<Self> {
        self.with_sides(side_branches).map_err(at_value)
    }

    pub(super) fn with_sides(mut self, side_branches: Vec<SideBranch>) -> Checked<Self> {
        let own = |dyad: &Dyad| {
            let joint = dyad.joint.as_ref().map(|joint| joint.name.clone());
            [Some(dyad.frame.clone()), joint].into_iter().flatten().collect::<Vec<_>>()
        };
        let mut names: BTreeSet<String> = self.dyads.iter().flat_map(own).collect();
        for (b, branch) in side_branches.iter().enumerate() {
            let path = format!("side_branches[{b}]");
            if self.frame_index(&branch.on).is_none() {
                let known = self.dyads.iter().map(|d| d.frame.as_str()).collect::<Vec<_>>().join(", ");
                let fault = MachineFault::UnknownFrame { frame: branch.on.clone(), known };
                return Err((format!("{path}.on"), fault));
            }
            if branch.recorded_as.is_some() && branch.prefix().is_none() {
                let what = "a side branch states as what it is recorded, but its joints have no common name before a point".into();
                return Err((format!("{path}.recorded_as"), MachineFault::UnnamedSideBranch { what }));
            }
            for (i, dyad) in branch.dyads.iter().enumerate() {
                self.check_side(dyad, &format!("{path}.dyads[{i}]"), &mut names)?;
            }
        }
        self.side_branches = side_branches;
        Ok(self)
    }

    fn check_side(&self, dyad: &Dyad, path: &str, names: &mut BTreeSet<String>) -> Checked<()> {
        usable_name(&format!("{path}.frame"), "frame", &dyad.frame)?;
        check_dyad(dyad, path, self.units)?;
        let twice = |what: &str, name: &str| MachineFault::NameTwice { what: what.into(), name: name.into() };
        if !names.insert(dyad.frame.clone()) {
            return Err((format!("{path}.frame"), twice("frame", &dyad.frame)));
        }
        let says = |field: &str, what: &str| {
            let what = format!("frame \"{}\" of a side branch states {what}", dyad.frame);
            Err((format!("{path}.{field}"), MachineFault::BadSideBranch { what }))
        };
        if dyad.tolerance.is_some() {
            return says("tolerance", "a tolerance");
        }
        let Some(joint) = &dyad.joint else { return Ok(()) };
        if joint.name != dyad.frame && !names.insert(joint.name.clone()) {
            return Err((format!("{path}.joint.name"), twice("joint", &joint.name)));
        }
        match (&joint.follows, &joint.nc) {
            (Some(_), _) => says("joint.follows", "what its joint follows"),
            (_, Some(_)) => says("joint.nc", "an NC word"),
            _ => Ok(()),
        }
    }

    /// The joint of a side branch that has this name.
    pub fn side_joint(&self, name: &str) -> Option<&Joint> {
        let dyads = self.side_branches.iter().flat_map(|side| &side.dyads);
        dyads.filter_map(|dyad| dyad.joint.as_ref()).find(|joint| joint.name == name)
    }

    /// Whether a side branch is carried by the joint of dyad `j`.
    pub fn carries(&self, j: usize, side: &SideBranch) -> bool {
        self.frame_index(&side.on).is_some_and(|on| on >= j && self.branch(on) == self.branch(j))
    }

    /// What hangs on the machine beside its chain.
    pub fn side_branches(&self) -> &[SideBranch] {
        &self.side_branches
    }
}
