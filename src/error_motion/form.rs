//! The error motions of a calibrated machine in its file.

use serde::{Deserialize, Serialize};

use super::{ErrorMotions, HARMONICS, JointMotion};
use crate::lie::Twist;
use crate::machine::{
    Checked, JointKind, Machine, MachineFault, OF_CALIBRATION, Triple, in_unit, number, vec_to_si,
};
use crate::units::Unit;

/// The error motion of one joint, in the file's units.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(rename = "error_motion", deny_unknown_fields)]
pub(crate) struct MotionForm {
    joint: String,
    from: f64,
    period: f64,
    /// By harmonic.
    cosines: Vec<TwistForm>,
    sines: Vec<TwistForm>,
    /// Cosine and sine, times the direction of travel.
    #[serde(default)]
    play: (f64, f64),
}

#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
#[serde(rename = "twist", deny_unknown_fields)]
struct TwistForm {
    v: Triple,
    w: Triple,
}

fn unit(machine: &Machine, kind: JointKind) -> Unit {
    let units = machine.units();
    if kind == JointKind::Revolute { units.angle } else { units.length }
}

/// As the file has them.
pub(crate) fn forms(machine: &Machine, motions: &ErrorMotions) -> Vec<MotionForm> {
    let units = machine.units();
    let twist = |t: &Twist<f64>| TwistForm { v: in_unit(t.v, units.length), w: in_unit(t.w, units.angle) };
    let form = |motion: &JointMotion| {
        let joint = machine.dyads()[motion.dyad].joint.as_ref()?;
        let unit = unit(machine, joint.kind);
        Some(MotionForm {
            joint: joint.name.clone(),
            from: unit.write_si(motion.from),
            period: unit.write_si(motion.period),
            cosines: motion.cosines.iter().map(twist).collect(),
            sines: motion.sines.iter().map(twist).collect(),
            play: motion.play.map(|x| unit.write_si(x)).into(),
        })
    };
    motions.joints.iter().filter_map(form).collect()
}

/// Back from the file.
pub(crate) fn read(forms: &[MotionForm], machine: &Machine) -> Checked<ErrorMotions> {
    let units = machine.units();
    let checked = |path, value| number(path, value, OF_CALIBRATION);
    let mut joints: Vec<JointMotion> = Vec::new();
    for (i, form) in forms.iter().enumerate() {
        let path = format!("calibration.error_motions[{i}]");
        let bad =
            |field: &str, what: String| (format!("{path}.{field}"), MachineFault::BadErrorMotion { what });
        let Some((dyad, joint)) = machine.joints().find(|(_, joint)| joint.name == form.joint) else {
            return Err(bad("joint", format!("there is no joint \"{}\"", form.joint)));
        };
        if joints.iter().any(|other| other.dyad == dyad) {
            return Err(bad("joint", format!("joint \"{}\" is named twice", form.joint)));
        }
        checked(format!("{path}.from"), form.from)?;
        checked(format!("{path}.period"), form.period)?;
        if form.period <= 0.0 {
            return Err(bad("period", format!("its period is {}", form.period)));
        }
        let twists = |field: &str, all: &[TwistForm]| {
            if all.len() != HARMONICS {
                return Err(bad(field, format!("{} harmonics, expected {HARMONICS}", all.len())));
            }
            let mut twists = [Twist::zero(0.0); HARMONICS];
            for (h, (twist, form)) in twists.iter_mut().zip(all).enumerate() {
                *twist = Twist::new(
                    vec_to_si(&format!("{path}.{field}[{h}].v"), form.v, units.length, OF_CALIBRATION)?,
                    vec_to_si(&format!("{path}.{field}[{h}].w"), form.w, units.angle, OF_CALIBRATION)?,
                );
            }
            Ok(twists)
        };
        let (unit, at) = (unit(machine, joint.kind), |field: &str| format!("{path}.{field}"));
        joints.push(JointMotion {
            dyad,
            from: unit.to_si(form.from),
            period: unit.to_si(form.period),
            cosines: twists("cosines", &form.cosines)?,
            sines: twists("sines", &form.sines)?,
            play: [checked(at("play[0]"), form.play.0)?, checked(at("play[1]"), form.play.1)?]
                .map(|x| unit.to_si(x)),
        });
    }
    Ok(ErrorMotions { joints })
}
