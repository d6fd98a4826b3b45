//! What stands between a command and its joint: a motor that follows its command, late or not, then play, then a spring that friction winds.

use super::term::{Term, terms};
use super::weight::Pull;
use crate::calibration::CalibratedMachine;
use crate::effects::StoredEffect;
use crate::error::Result;
use crate::export::curve::Curve;
use crate::export::table::POINTS;
use crate::export::travel::poses;
use crate::lie::{Pose, Vec3};
use crate::machine::{Joint, JointKind, Machine, MassPoint};

/// Families that a coupling with play holds.
const PLAY: [&str; 2] = ["backlash", "crossed_play"];

/// Step of the simulation that the drives are made for, s.
pub(super) const STEP: f64 = 5e-4;
/// Natural frequency of a motor, critically damped; 1/s. One over the step: it settles within three.
pub(super) const MOTOR: f64 = 2000.0;
/// Natural frequency of a load on a spring that stands for nothing but lost motion, 1/s: it gives way by 0.4 um under 1 m/s².
const STIFF: f64 = 1500.0;
/// Natural frequency that no spring may have more of, 1/s.
const FASTEST: f64 = 2000.0;
/// Part of critical damping between motor and load: it damps what is between them, and not the motion.
const DAMPING: f64 = 0.7;
/// By how much a load is heavier than what it carries, and a motor than its load: neither gives way to what it moves.
const HEAVIER: f64 = 1000.0;
/// Deceleration up to which friction keeps a load with play from running ahead, m/s² or rad/s².
const HELD: f64 = 50.0;
/// Acceleration of gravity, m/s².
const GRAVITY: f64 = 9.80665;

/// The way from a command to its joint.
#[derive(Clone, Debug)]
pub(super) struct Drive {
    /// The joint; its command has the same name.
    pub joint: String,
    pub kind: JointKind,
    /// By how many seconds the motor hears its command late.
    pub delay: f64,
    /// Time constant of a low-pass behind it, s.
    pub low_pass: f64,
    /// Part of the velocity that is fed forward.
    pub forward: f64,
    /// Total width of the play, m or rad; 0 where there is none.
    pub play: f64,
    pub spring: Option<Spring>,
    /// What winds the spring besides the masses of the machine file, where weight does.
    pub pull: Option<Pull>,
    /// Friction on the load, each a force that is taken up along a length, N or Nm and m or rad.
    pub friction: Vec<(f64, f64)>,
    /// Inertia that the joint gets besides what it carries, kg or kg m².
    pub load: f64,
    /// The same of what stands between play and spring.
    pub gear: f64,
    /// Inertia of the motor.
    pub motor: f64,
    /// Coulomb friction that holds what hangs behind play.
    pub hold: f64,
    /// Effects that it holds.
    pub holds: Vec<String>,
}

/// A spring with its damper between motor and load.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spring {
    /// N/m or Nm/rad.
    pub stiffness: f64,
    pub damping: f64,
}

/// An effect at a joint that no drive holds, and why.
pub(super) struct Refused {
    pub what: String,
    pub because: &'static str,
}

/// Drives of all joints that do what their own command says, machine order.
pub(super) fn drives(calibrated: &CalibratedMachine) -> Result<(Vec<Drive>, Vec<Refused>)> {
    let machine = calibrated.machine();
    let (mut drives, mut refused) = (Vec::new(), Vec::new());
    let pulled = pulled(calibrated);
    for (j, joint) in machine.joints().filter(|(j, joint)| is_plain(machine, *j, joint)) {
        drives.push(drive(calibrated, j, joint, pulled.contains(&j), &mut refused)?);
    }
    Ok((drives, refused))
}

/// Whether a joint does what its own command says, and nothing else.
pub(super) fn is_plain(machine: &Machine, j: usize, joint: &Joint) -> bool {
    match machine.drive(j).map(|drive| &drive.terms[..]) {
        Some([(c, factor)]) => machine.commands()[*c] == joint.name && *factor == 1.0,
        _ => false,
    }
}

/// Joints whose spring may have weights of its own in the model: they would pull at every other spring too.
fn pulled(calibrated: &CalibratedMachine) -> Vec<usize> {
    let machine = calibrated.machine();
    let mut springs = Vec::new();
    for effect in calibrated.effects().iter().filter(|effect| !effect.of_setup) {
        let Some((j, joint)) = machine.joints().find(|(_, joint)| joint.name == effect.at) else { continue };
        let terms = terms(machine, j, joint, effect).unwrap_or_default();
        if terms.iter().any(|term| matches!(term, Term::Compliance(by) if *by > 0.0)) {
            let own = terms.iter().any(|term| matches!(term, Term::Load(_) | Term::Lever(..)));
            springs.push((j, own));
        }
    }
    match springs.iter().all(|(_, own)| *own) {
        true => springs.iter().map(|(j, _)| *j).min().into_iter().collect(),
        false => Vec::new(),
    }
}

/// What effects at one joint add up to.
#[derive(Default)]
struct Sums {
    lag: f64,
    /// Of `inertial_error`, where it was found.
    inertia: Option<(f64, String)>,
    friction: Vec<(f64, f64)>,
    compliance: f64,
    pull: Pull,
}

fn drive(
    calibrated: &CalibratedMachine,
    j: usize,
    joint: &Joint,
    pulled: bool,
    refused: &mut Vec<Refused>,
) -> Result<Drive> {
    let carried = Carried::new(calibrated, j, joint);
    let load = if carried.stated { HEAVIER * carried.most.max(1e-3) } else { 1.0 };
    let mut drive = Drive {
        joint: joint.name.clone(),
        kind: joint.kind,
        delay: 0.0,
        low_pass: 0.0,
        forward: 1.0,
        play: 0.0,
        spring: None,
        pull: None,
        friction: Vec::new(),
        load,
        gear: load,
        motor: HEAVIER * load,
        hold: 0.0,
        holds: Vec::new(),
    };
    let mut sums = Sums::default();
    for effect in calibrated.effects().iter().filter(|effect| effect.at == joint.name && !effect.of_setup) {
        let what = format!("{} at {}", effect.effect, effect.at);
        let because = if PLAY.contains(&effect.effect.as_str()) {
            let width = play(calibrated, effect, joint)?;
            match width {
                None => None,
                Some(_) if drive.play > 0.0 => Some("one play stands at this joint already"),
                Some(width) if width > 0.0 => {
                    drive.play = width;
                    drive.holds.push(what);
                    continue;
                }
                Some(_) => {
                    Some("the joint runs ahead of its command where it turns round: no play does that")
                }
            }
        } else {
            match terms(calibrated.machine(), j, joint, effect) {
                None => None,
                Some(terms) => match sums.take(&terms, &what, pulled) {
                    Err(because) => Some(because),
                    Ok(()) => {
                        drive.holds.push(what);
                        continue;
                    }
                },
            }
        };
        if let Some(because) = because {
            refused.push(Refused { what, because });
        }
    }
    drive.follow(&sums, refused, &carried);
    Ok(drive)
}

/// Width of a play that stands at a joint alone.
fn play(calibrated: &CalibratedMachine, effect: &StoredEffect, joint: &Joint) -> Result<Option<f64>> {
    let machine = calibrated.machine();
    let Some(command) = machine.commands().iter().position(|name| *name == joint.name) else {
        return Ok(None);
    };
    let mut bands = calibrated.variation().dead_bands.clone();
    bands.resize(machine.commands().len(), 0.0);
    // It was bound when the file was read.
    let Ok(alone) = CalibratedMachine::nominal(machine.clone()).with_effects(vec![effect.clone()], bands)
    else {
        return Ok(None);
    };
    // Differences of positions: what is below a picometre is rounding.
    let width = (1e12 * Curve::new(&alone, command, POINTS)?.backlash()).round() / 1e12;
    Ok((width != 0.0).then_some(width))
}

impl Sums {
    /// Adds an effect, or says why no drive holds it.
    fn take(&mut self, terms: &[Term], what: &str, pulled: bool) -> std::result::Result<(), &'static str> {
        let (mut weight, mut other) = (0.0, false);
        for term in terms {
            match term {
                Term::Friction { width, .. } if *width < 0.0 => {
                    return Err("the joint runs ahead of its direction of travel: no friction does that");
                }
                Term::Compliance(by) => weight += by,
                Term::Load(_) | Term::Lever(..) => other = true,
                _ => {}
            }
        }
        let weighs = other || terms.iter().any(|term| matches!(term, Term::Compliance(_)));
        if weighs && weight <= 0.0 {
            return Err(
                "the joint does not yield to the weight of the machine's masses: no spring does that",
            );
        }
        if weighs && self.compliance > 0.0 {
            return Err("one spring stands at this joint already");
        }
        if other && !pulled {
            return Err("its spring asks for other weights than another joint's, and all hang on one chain");
        }
        for term in terms {
            match *term {
                Term::Lag(by) => self.lag += by,
                Term::Inertia(by) => {
                    let before = self.inertia.as_ref().map_or(0.0, |(before, _)| *before);
                    self.inertia = Some((before + by, what.to_string()));
                }
                Term::Friction { width, take_up } => self.friction.push((width, take_up)),
                Term::Compliance(by) => self.compliance += by,
                Term::Load(by) => self.pull.load += by / weight,
                Term::Lever(by, dyad, direction) => self.pull.moments.push((dyad, direction, by / weight)),
            }
        }
        Ok(())
    }
}

impl Drive {
    /// Makes delay, low-pass, spring and friction of the sums. A command `c` delayed by `d` is `c - d v + d²/2 a`; low-passed with `T`,
    /// `c - T v + T² a`; a load on a spring of frequency `w` is behind by `a/w²`.
    fn follow(&mut self, sums: &Sums, refused: &mut Vec<Refused>, carried: &Carried) {
        // What of the acceleration a spring has to make.
        let mut give = 0.0;
        self.delay = sums.lag.max(0.0);
        if sums.lag < 0.0 {
            // A motor with more than its velocity fed forward leads.
            self.forward = 1.0 - sums.lag * MOTOR / 2.0;
        }
        if let Some((inertia, what)) = &sums.inertia {
            give = inertia + 0.5 * self.delay * self.delay;
            if self.play > 0.0 && sums.compliance <= 0.0 && sums.friction.is_empty() {
                let because =
                    "the joint has play, and the friction that holds its load there would wind this spring";
                refused.push(Refused { what: what.clone(), because });
                self.holds.retain(|held| held != what);
                give = 0.0;
            } else if give < 0.0 {
                // More rounding than by a delay: part of it is a low-pass.
                let low_pass = (-2.0 * give).sqrt();
                if low_pass <= self.delay {
                    (self.low_pass, self.delay) = (low_pass, self.delay - low_pass);
                } else {
                    let because = "the joint runs ahead of its acceleration by more than its lag does: no spring does that";
                    refused.push(Refused { what: what.clone(), because });
                    self.holds.retain(|held| held != what);
                }
                give = 0.0;
            }
        }
        if sums.compliance > 0.0 {
            let stiffness = sums.compliance.recip();
            // The masses of the model give way to their acceleration already.
            let rest = give * stiffness - carried.mean;
            let own = rest.max(stiffness / (FASTEST * FASTEST));
            self.pull = Some(sums.pull.clone());
            self.spring(stiffness, own, own + carried.most);
        } else if give > 1.0 / (FASTEST * FASTEST) || !sums.friction.is_empty() {
            let pace = give.recip().sqrt().min(STIFF);
            self.spring(self.load * pace * pace, self.load, self.load);
        }
        if let Some(spring) = self.spring {
            self.friction = sums
                .friction
                .iter()
                .map(|(width, take_up)| (0.5 * width * spring.stiffness, *take_up))
                .collect();
        }
        if self.play > 0.0 {
            let wound: f64 = self.friction.iter().map(|(force, _)| force).sum();
            let pull = if carried.stated || self.pull.is_some() { carried.pull } else { 0.0 };
            self.hold = HELD * (self.gear + self.load) + 2.0 * (pull + wound);
        }
    }

    fn spring(&mut self, stiffness: f64, own: f64, most: f64) {
        let damping = 2.0 * DAMPING * (stiffness * most).sqrt();
        // A motor that does not notice what winds the spring.
        self.motor = self.motor.max(HEAVIER * stiffness / (MOTOR * MOTOR));
        self.load = own;
        self.spring = Some(Spring { stiffness, damping });
    }

    /// Whether the joint hangs on a motor of its own.
    pub fn has_motor(&self) -> bool {
        self.play > 0.0 || self.spring.is_some()
    }

    /// Whether something stands between its play and its spring.
    pub fn has_gear(&self) -> bool {
        self.play > 0.0 && self.spring.is_some()
    }

    /// Whether more than the velocity is fed forward.
    pub fn leads(&self) -> bool {
        self.forward > 1.0
    }
}

/// The masses that the machine file states beyond a joint, over its travel; or those that stand for them where it states none.
struct Carried {
    stated: bool,
    /// Largest and mean moment of inertia about the joint, or mass; kg m² or kg.
    most: f64,
    mean: f64,
    /// No more than this is their pull on the joint, N or Nm.
    pull: f64,
}

impl Carried {
    fn new(calibrated: &CalibratedMachine, j: usize, joint: &Joint) -> Carried {
        let machine = calibrated.machine();
        let beyond = |of: &dyn Fn(usize) -> Option<MassPoint>| -> Vec<(usize, MassPoint)> {
            let all = (j..machine.dyads().len()).filter(|k| machine.branch(*k) == machine.branch(j));
            all.filter_map(|k| of(k).map(|mass| (k, mass))).filter(|(_, point)| point.mass > 0.0).collect()
        };
        let mut masses = beyond(&|k| machine.dyads()[k].mass);
        let stated = !masses.is_empty();
        if !stated {
            masses = beyond(&|k| (k > j).then_some(MassPoint { mass: 1.0, centre: Vec3([0.0; 3]) }));
        }
        let (mut most, mut sum, mut pull) = (0.0f64, 0.0, 0.0f64);
        let chain = calibrated.chain();
        let all = poses(calibrated, 50);
        for q in &all {
            let (sweep, moved) = (chain.sweep(q), machine.displacements(q));
            let j_from_b = sweep.b_from_frame(j).inverse();
            let (mut inertia, mut force) = (0.0, 0.0);
            for (k, point) in &masses {
                let motion = machine.dyads()[*k]
                    .joint
                    .as_ref()
                    .map_or(Pose::identity(0.0), |own| Pose::exp(own.twist().times(moved[*k])));
                let centre = (j_from_b * sweep.b_from_frame(*k) * motion).transform(point.centre);
                let arm = match joint.kind {
                    JointKind::Revolute => joint.axis.cross(centre).norm(),
                    JointKind::Prismatic => 1.0,
                };
                inertia += point.mass * arm * arm;
                force += point.mass * arm;
            }
            most = most.max(inertia);
            sum += inertia;
            pull = pull.max(GRAVITY * force);
        }
        Carried { stated, most, mean: sum / all.len() as f64, pull }
    }
}
