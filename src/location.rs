//! The geometry of a machine as ISO 230-1 location errors: squareness of linear axes, tilt and offset of rotary axes.
//!
//! Definitions, signs, datum and names are in `docs/location.md`. Every error is a function of the joint axes as lines in one
//! frame, at home (all commands zero), so that it does not depend on how deviations are shared out between neighbouring dyads.
//!
//! ```
//! use kincal::lie::{Twist, Vec3};
//! use kincal::location::location_errors;
//!
//! let machine = kincal::Machine::parse("cross.ron", r#"Machine(
//!     name: "cross", units: (length: mm, angle: deg),
//!     workpiece: [(frame: "x", joint: Prismatic(axis: "-x")), (frame: "w")],
//!     tool: [(frame: "y", joint: Prismatic(axis: "y")), (frame: "t", at: (0, 0, 200))],
//! )"#)?;
//! let mut deviations = vec![Twist::zero(0.0); 4];
//! deviations[2].w.0[2] = 50e-6; // the guideway of y turned about z
//! let found = location_errors(&machine, &deviations, Vec3([0.0; 3]), None);
//! assert_eq!(found.errors[0].name, "EC0Y");
//! assert!((found.errors[0].value - 50e-6).abs() < 1e-12);
//! assert!(!found.errors[0].identified, "nothing was measured");
//! # Ok::<(), kincal::Error>(())
//! ```

mod words;

use num_dual::Dual64;
use serde::{Deserialize, Serialize};

use crate::chain::{Chain, Sweep};
use crate::lie::{Twist, Vec3};
use crate::machine::{JointKind, Machine};
use crate::scalar::Scalar;
use crate::units::unbounded;
pub use words::Said;

/// At least this share of a location error must come from the data for it to be called identified: its standard error is then below a
/// third (√0.1) of what the tolerances alone allow.
pub const IDENTIFIED: f64 = 0.9;
/// No more than this part of the variance that the tolerances allow may lie where the data see nothing at all; it is there for
/// rounding only.
pub const UNSEEN: f64 = 1e-6;
/// Of the directions that move the tool a calibrated file lists those that keep more than this part of the variance that the tolerances
/// allow. It is less than what [`IDENTIFIED`] leaves, so that the list tells what is not identified (`docs/location.md`).
pub(crate) const LISTED: f64 = 0.09;
/// Directions closer than this to a coordinate direction bear its plain letter, rad.
const ALIGNED: f64 = 1e-3;
/// Sine of the angle between two linear axes below which they do not span a plane.
const PARALLEL: f64 = 0.1;
/// Components of an axis that differ by less are a tie.
const TIE: f64 = 1e-6;

/// What is known of a smooth function of the deviations, in its own unit squared. To first order, `docs/model.md` (24), (28).
#[non_exhaustive]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Functional {
    /// Variance that the tolerances alone allow.
    pub prior_variance: f64,
    /// Variance with the data (and the tolerances, where they act as a prior); infinite where nothing determines it.
    pub posterior_variance: f64,
    /// What part of the prior variance lies along combinations that the data do not see at all, 0 to 1.
    pub unseen: f64,
}

impl Functional {
    /// Nothing but the tolerances are known.
    pub fn prior_only(prior_variance: f64) -> Self {
        Functional { prior_variance, posterior_variance: prior_variance, unseen: 1.0 }
    }

    /// Share that comes from the data, `1 - posterior variance / prior variance`, 0 to 1.
    pub fn share(&self) -> f64 {
        if self.prior_variance > 0.0 {
            (1.0 - self.posterior_variance / self.prior_variance).clamp(0.0, 1.0)
        } else {
            0.0
        }
    }

    /// Whether a number may be told and entered: a share of at least [`IDENTIFIED`], and nothing of it where the data see nothing.
    /// Whatever is called identified, and whatever an export writes, is decided here.
    pub fn is_identified(&self) -> bool {
        self.share() >= IDENTIFIED && self.unseen <= UNSEEN
    }
}

/// Whoever knows how sure functions of the deviations are.
pub trait Knowledge {
    /// What is known of a function that does not depend on `w`. `by_dyad_scaled`: its six derivatives by the deviation of every dyad
    /// in machine order, each times its tolerance.
    fn of_deviations(&self, by_dyad_scaled: &[f64]) -> Functional;
}

/// One location error.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LocationError {
    /// Name, such as `EC0Y` or `EX0C`; `docs/location.md` has the extended ones.
    pub name: String,
    /// Name of the joint whose axis it is.
    pub axis: String,
    /// Unit vector of the machine coordinate system along which (m) or about which (rad) it is counted.
    pub direction: [f64; 3],
    /// Value, m or rad.
    pub value: f64,
    /// `m` or `rad`.
    pub unit: String,
    /// Standard error, tolerances and data together, m or rad; infinite (`null` in JSON) where nothing determines it.
    #[serde(deserialize_with = "unbounded")]
    pub std_error: f64,
    /// What share of it comes from the data, 0 to 1: `1 - posterior variance / prior variance`.
    pub share: f64,
    /// Whether it may be told, [`Functional::is_identified`].
    pub identified: bool,
}

/// All location errors of a machine with the datum that they refer to.
#[non_exhaustive]
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LocationErrors {
    /// Joint along which X (or whichever comes first) of the machine coordinate system lies.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub primary: Option<String>,
    /// Joint that fixes the turn about the primary axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub secondary: Option<String>,
    /// Point in frame `t` to which offsets of rotary axes refer, with all commands zero, m.
    pub reference_t_m: [f64; 3],
    /// The errors: linear axes, then rotary ones.
    pub errors: Vec<LocationError>,
    /// Why there are none, where ISO 230-1 location errors do not apply.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

/// Location errors of a machine with these deviations (one per dyad in machine order, m and rad).
///
/// `reference_t`: point of frame `t` (m) whose place at home is the datum for offsets of rotary axes. It should be a point that the
/// instrument has seen. `information`: what the data of a fit know, at those deviations; without it the tolerances are all that is
/// known, and nothing is identified. `w` is not needed: no location error depends on where the workpiece stands.
///
/// # Panics
/// If `deviations` has not one twist per dyad.
pub fn location_errors(
    machine: &Machine,
    deviations: &[Twist<f64>],
    reference_t: Vec3<f64>,
    information: Option<&dyn Knowledge>,
) -> LocationErrors {
    let none = |reason: String| LocationErrors {
        primary: None,
        secondary: None,
        reference_t_m: reference_t.0,
        errors: Vec::new(),
        reason: Some(reason),
    };
    let geometry = match Geometry::new(machine, reference_t) {
        Ok(geometry) => geometry,
        Err(reason) => return none(reason),
    };
    let home = vec![0.0; machine.commands().len()];
    let values = geometry.values(&Chain::new(machine, deviations).sweep(&home));
    let gradients = geometry.gradients(machine, deviations);
    let errors = (geometry.items.iter().zip(values).zip(gradients))
        .map(|((item, value), scaled)| {
            let known = match information {
                Some(information) => information.of_deviations(&scaled),
                None => Functional::prior_only(scaled.iter().map(|g| g * g).sum()),
            };
            LocationError {
                name: geometry.name(item),
                axis: geometry.axes[item.axis].joint.clone(),
                direction: item.direction.0,
                value,
                unit: if item.offset { "m" } else { "rad" }.into(),
                std_error: known.posterior_variance.sqrt(),
                share: known.share(),
                identified: known.is_identified(),
            }
        })
        .collect();
    let joint = |axis: usize| Some(geometry.axes[axis].joint.clone());
    LocationErrors {
        primary: joint(geometry.primary),
        secondary: joint(geometry.secondary),
        reference_t_m: reference_t.0,
        errors,
        reason: None,
    }
}

/// A joint as an axis of the standard.
struct Axis {
    dyad: usize,
    joint: String,
    rotary: bool,
    /// 0, 1, 2: X, Y, Z, or A, B, C.
    letter: usize,
    /// Unit vector in the joint's own frame, turned round where the joint is declared against its coordinate direction.
    local: Vec3<f64>,
    /// Declared direction, unit vector in the base, in the sense of its letter.
    along: Vec3<f64>,
    /// Declared origin of the joint's frame less the declared reference point, in the base, m.
    origin: Vec3<f64>,
    /// Whether another axis has the same letter.
    shared: bool,
}

/// One functional of the deviations.
struct Item {
    axis: usize,
    /// 0, 1, 2: the coordinate direction, or the one that was turned with the axis.
    letter: usize,
    primed: bool,
    direction: Vec3<f64>,
    offset: bool,
}

/// The location errors of a machine as functions of its chain at home.
struct Geometry {
    axes: Vec<Axis>,
    primary: usize,
    secondary: usize,
    reference_t: Vec3<f64>,
    items: Vec<Item>,
}

impl Geometry {
    fn new(machine: &Machine, reference_t: Vec3<f64>) -> Result<Self, String> {
        let home = vec![0.0; machine.commands().len().max(1)];
        let sweep = Chain::nominal(machine).sweep(&home);
        let reference_b = sweep.b_from_t().transform(reference_t);
        let mut axes: Vec<Axis> = machine
            .joints()
            .map(|(dyad, joint)| {
                let frame = sweep.b_from_frame(dyad);
                let declared = frame.rotation * joint.axis;
                let rotary = joint.kind == JointKind::Revolute;
                let letter = nearest(declared, &joint.name, rotary);
                let sense = if declared.0[letter] < 0.0 { -1.0 } else { 1.0 };
                Axis {
                    dyad,
                    joint: joint.name.clone(),
                    rotary,
                    letter,
                    local: joint.axis.times(sense),
                    along: declared.times(sense),
                    origin: frame.translation - reference_b,
                    shared: false,
                }
            })
            .collect();
        let same = |a: &Axis, b: &Axis| (a.rotary, a.letter) == (b.rotary, b.letter);
        let shared: Vec<bool> = axes.iter().map(|a| axes.iter().filter(|b| same(a, b)).count() > 1).collect();
        axes.iter_mut().zip(shared).for_each(|(axis, shared)| axis.shared = shared);

        // The first two of X, Y, Z that the machine has.
        let mut linear = (0..3).filter_map(|k| axes.iter().position(|a| !a.rotary && a.letter == k));
        let (Some(primary), Some(secondary)) = (linear.next(), linear.next()) else {
            let count = axes.iter().filter(|a| !a.rotary).count();
            return Err(format!(
                "ISO 230-1 location errors refer to a machine coordinate system that two linear axes span; {} has {}",
                machine.name(),
                match count {
                    0 => "none".into(),
                    1 => "one".to_string(),
                    n => format!("{n}, all along one direction"),
                }
            ));
        };
        if axes[primary].along.cross(axes[secondary].along).norm() < PARALLEL {
            return Err(format!("{} and {} are nearly parallel", axes[primary].joint, axes[secondary].joint));
        }
        let mut geometry = Geometry { axes, primary, secondary, reference_t, items: Vec::new() };
        geometry.items = geometry.list();
        Ok(geometry)
    }

    /// Which functionals there are: linear axes by letter, then rotary axes by letter.
    fn list(&self) -> Vec<Item> {
        let mut order: Vec<usize> = (0..self.axes.len()).collect();
        order.sort_by_key(|a| (self.axes[*a].rotary, self.axes[*a].letter));
        let normal = self.axes[self.primary].along.cross(self.axes[self.secondary].along);
        let mut items = Vec::new();
        for axis in order {
            if axis == self.primary {
                continue;
            }
            let own = &self.axes[axis];
            let mut square: Vec<(usize, Vec3<f64>)> =
                (0..3).filter(|k| *k != own.letter).map(|k| (k, own.square(k))).collect();
            if axis == self.secondary {
                // Its other inclination is what the turn about the primary axis is taken from.
                square.sort_by(|a, b| b.1.dot(normal).abs().total_cmp(&a.1.dot(normal).abs()));
                square.truncate(1);
            }
            for offset in if own.rotary { vec![true, false] } else { vec![false] } {
                items.extend(square.iter().map(|(letter, direction)| Item {
                    axis,
                    letter: *letter,
                    primed: (*direction - unit(*letter)).norm() > ALIGNED,
                    direction: *direction,
                    offset,
                }));
            }
        }
        items
    }

    fn name(&self, item: &Item) -> String {
        let axis = &self.axes[item.axis];
        let letter = |rotary: bool, k: usize| if rotary { ["A", "B", "C"][k] } else { ["X", "Y", "Z"][k] };
        let prime = if item.primed { "'" } else { "" };
        let direction = letter(!item.offset, item.letter);
        if axis.shared {
            format!("E{direction}{prime}0({})", axis.joint)
        } else {
            format!("E{direction}{prime}0{}", letter(axis.rotary, axis.letter))
        }
    }

    /// All location errors, m and rad, from a sweep with all commands zero; the equations of `docs/location.md`.
    fn values<S: Scalar>(&self, home: &Sweep<S>) -> Vec<S> {
        let direction = |axis: &Axis| {
            let frame = home.b_from_frame(axis.dyad);
            frame.rotation * axis.local.lift(frame.translation.0[0])
        };
        let (p, s) = (&self.axes[self.primary], &self.axes[self.secondary]);
        let actual = triad(direction(p), direction(s));
        let declared = triad(p.along, s.along);
        // From the base to the machine coordinate system: what turns the actual primary axis and plane to the declared ones.
        let to_machine = |v: Vec3<S>| {
            let turned = [0, 1, 2].map(|k| declared[k].lift(v.0[0]).times(actual[k].dot(v)));
            turned[0] + turned[1] + turned[2]
        };
        let t = home.b_from_t();
        let reference = t.transform(self.reference_t.lift(t.translation.0[0]));
        (self.items.iter())
            .map(|item| {
                let axis = &self.axes[item.axis];
                let u = to_machine(direction(axis));
                let like = u.0[0];
                let (along, n) = (axis.along.lift(like), item.direction.lift(like));
                if !item.offset {
                    return along.cross(u).dot(n);
                }
                let gap =
                    to_machine(home.b_from_frame(axis.dyad).translation - reference) - axis.origin.lift(like);
                // Where the line crosses the plane through its declared origin, square to its declared direction.
                (gap - u.times(gap.dot(along) * u.dot(along).recip())).dot(n)
            })
            .collect()
    }

    /// Of each location error its derivative by every component of every deviation, times that component's tolerance.
    fn gradients(&self, machine: &Machine, deviations: &[Twist<f64>]) -> Vec<Vec<f64>> {
        let home = vec![Dual64::from(0.0); machine.commands().len()];
        let mut gradients = vec![Vec::with_capacity(6 * deviations.len()); self.items.len()];
        let mut dual: Vec<[Dual64; 6]> =
            deviations.iter().map(|dh| dh.to_array().map(Dual64::from)).collect();
        for j in 0..deviations.len() {
            let tolerance = machine.tolerance(j).to_array();
            for (k, tolerance) in tolerance.into_iter().enumerate() {
                let held = dual[j][k];
                dual[j][k] = held.derivative();
                let twists: Vec<Twist<Dual64>> = dual.iter().map(|dh| Twist::from_array(*dh)).collect();
                let values = self.values(&Chain::new(machine, &twists).sweep(&home));
                dual[j][k] = held;
                for (gradient, value) in gradients.iter_mut().zip(values) {
                    gradient.push(value.eps * tolerance);
                }
            }
        }
        gradients
    }
}

impl Axis {
    /// Coordinate direction `k` after the smallest turn that takes the axis' own coordinate direction to its declared direction.
    fn square(&self, k: usize) -> Vec3<f64> {
        let (own, other) = (unit(self.letter), unit(k));
        let share = self.along.dot(other) / (1.0 + self.along.dot(own));
        other - (own + self.along).times(share)
    }
}

/// Unit vector along coordinate direction `k`.
fn unit(k: usize) -> Vec3<f64> {
    Vec3(std::array::from_fn(|i| if i == k { 1.0 } else { 0.0 }))
}

/// The coordinate direction that a declared axis lies nearest to; in a tie the one that the joint is named after, else the first.
fn nearest(declared: Vec3<f64>, joint: &str, rotary: bool) -> usize {
    let largest = declared.0.iter().fold(0.0f64, |m, c| m.max(c.abs()));
    let first = joint.chars().next().map(|c| c.to_ascii_uppercase());
    let letters = if rotary { ['A', 'B', 'C'] } else { ['X', 'Y', 'Z'] };
    let mut tied = (0..3).filter(|k| declared.0[*k].abs() > largest - TIE);
    let named = tied.clone().find(|k| first == Some(letters[*k]));
    named.or_else(|| tied.next()).unwrap_or(2)
}

/// Orthonormal directions: along `first`, square to it towards `second`, square to both.
fn triad<S: Scalar>(first: Vec3<S>, second: Vec3<S>) -> [Vec3<S>; 3] {
    let normal = first.cross(second);
    let (a, c) = (first.times(first.norm().recip()), normal.times(normal.norm().recip()));
    [a, c.cross(a), c]
}
