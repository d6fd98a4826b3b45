//! Gravity that is stated in a frame which has to be found: what weighs depends on the frame, and the frame on what weighs.

use super::source::{Source, Sources};
use super::unknowns::{Layout, Unknowns};
use super::{Problem, is_of_setup, place};
use crate::error::Result;
use crate::lie::Pose;
use crate::machine::Machine;
use crate::variation::Varying;

/// Fits with gravity as the fit before has it, at most; and the angle below which nothing turns any more, rad.
const GRAVITY_ROUNDS: usize = 5;
const UPRIGHT: f64 = 1e-5;

/// Frames `w` of the set-ups as they stand before dyad `w`, where gravity hangs on them.
pub(super) type Frames = Option<Vec<Pose<f64>>>;

/// Fits again with gravity as the last fit has it, until frame `w` of no set-up turns any more: the weight of an arm tilts what the
/// frame is found from.
pub(super) fn upright<T>(fit: impl Fn(Option<&[Pose<f64>]>) -> Result<(T, Frames)>) -> Result<T> {
    let (mut found, mut frames) = fit(None)?;
    for _ in 1..GRAVITY_ROUNDS {
        let Some(before) = frames else { break };
        (found, frames) = fit(Some(&before))?;
        let turn = |(a, b): (&Pose<f64>, &Pose<f64>)| (a.inverse() * *b).log().w.norm();
        let turned = frames.iter().flatten().zip(&before).map(turn).fold(0.0, f64::max);
        if turned < UPRIGHT {
            break;
        }
    }
    Ok(found)
}

/// Frames `w` as they were found.
pub(super) fn frames(unknowns: &Unknowns) -> Vec<Pose<f64>> {
    unknowns.setups.iter().map(|setup| setup.pose()).collect()
}

/// Where gravity is stated in a frame `w` that nobody knows, that frame is found first, with constant deviations alone, unless
/// `frames` say where it stands: what weighs depends on it. Whether it does.
pub(super) fn turn_gravity(
    machine: &Machine,
    sources: &mut Sources,
    layout: &Layout,
    start: Unknowns,
    frames: Option<&[Pose<f64>]>,
) -> Result<bool> {
    let stated = |s: &Source| s.recording.header().gravity_w.is_some() && sources.frame_unknown[s.setup];
    if !(sources.has_weight() && sources.all.iter().any(stated)) {
        return Ok(false);
    }
    if let Some(frames) = frames {
        sources.turn_gravity(|setup| frames[setup])?;
        return Ok(true);
    }
    let (constant, start) =
        (Varying::default(), Unknowns { coefficients: vec![0.0; start.coefficients.len()], ..start });
    let mut problem = Problem::new(machine, sources, layout, &constant, is_of_setup);
    let frames = self::frames(&place(&mut problem, start)?.solution.unknowns);
    sources.turn_gravity(|setup| frames[setup])?;
    Ok(true)
}
