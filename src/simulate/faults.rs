//! What is wrong with a simulated machine, as a RON file says it; `docs/simulate.md` teaches the form.

mod form;

use std::path::Path;

use crate::document::Document;
use crate::effects::StoredEffect;
use crate::error::{Error, Result};
use crate::lie::{Twist, Vec3};
use crate::machine::{JointKind, Machine};
use crate::units::Unit;
use form::{BacklashForm, FaultsForm, Triple, WidthForm};

/// Where the form of such a file is taught.
const GUIDE: &str = "docs/simulate.md shows the form of a faults file";

/// Faults of one machine, m and rad.
#[non_exhaustive]
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Faults {
    /// Deviations `dh` of initial poses: index of the dyad, twist in its own frame, `M exp(dh)`, `docs/model.md` (10).
    pub deviations: Vec<(usize, Twist<f64>)>,
    /// Increments of the factors of `w_from_t`: `F exp(d)`, where `F` is `M` on the tool branch and its inverse on the other.
    pub factors: Vec<(usize, Twist<f64>)>,
    /// Displaced joint axes: index of the dyad, twist `d` by which its axis is displaced, `Ad(exp(d)) xi`.
    pub twists: Vec<(usize, Twist<f64>)>,
    /// Constant errors of joint displacements: index of the dyad, m or rad.
    pub displacements: Vec<(usize, f64)>,
    /// Play of joints: index of the dyad.
    pub backlash: Vec<(usize, Width)>,
    /// Named effects; every one fits the machine.
    pub effects: Vec<StoredEffect>,
}

/// Total width of play, m or rad, constant or by the displacement of the joint; below zero counts as zero.
#[derive(Clone, Debug, PartialEq)]
pub enum Width {
    /// The same everywhere.
    Constant(f64),
    /// `Σ c_i q^i`, q in m or rad.
    Polynomial(Vec<f64>),
    /// `mean + Σ_k cos_k cos(2π k q / period) + sin_k sin(2π k q / period)`, k from 1.
    Harmonics {
        /// Mean width.
        mean: f64,
        /// Amplitudes of the cosines.
        cos: Vec<f64>,
        /// Amplitudes of the sines.
        sin: Vec<f64>,
        /// Period, m or rad.
        period: f64,
    },
    /// Positions (rising) with their widths; linear between them, constant beyond.
    Points(Vec<(f64, f64)>),
}

impl Width {
    /// Width where the joint stands at `q`, m or rad.
    pub fn at(&self, q: f64) -> f64 {
        match self {
            Width::Constant(width) => *width,
            Width::Polynomial(coefficients) => coefficients.iter().rev().fold(0.0, |sum, c| sum * q + c),
            Width::Harmonics { mean, cos, sin, period } => {
                let angle = std::f64::consts::TAU * q / period;
                let sum = |amplitudes: &[f64], f: fn(f64) -> f64| -> f64 {
                    amplitudes.iter().enumerate().map(|(k, a)| a * f((k + 1) as f64 * angle)).sum()
                };
                mean + sum(cos, f64::cos) + sum(sin, f64::sin)
            }
            Width::Points(points) => {
                let after = points.partition_point(|(position, _)| *position <= q);
                let Some((from, low)) = after.checked_sub(1).map(|i| points[i]) else {
                    return points.first().map_or(0.0, |(_, width)| *width);
                };
                let Some((to, high)) = points.get(after) else { return low };
                low + (high - low) * (q - from) / (to - from)
            }
        }
    }
}

impl Faults {
    /// Reads a faults file for a machine.
    ///
    /// # Errors
    /// [`Error::File`], or [`Error::Input`] with line and column.
    pub fn open(path: impl AsRef<Path>, machine: &Machine) -> Result<Faults> {
        Faults::from_document(&Document::open(path)?.guided(GUIDE), machine)
    }

    /// Reads from a text; `file` is only the name that messages use.
    ///
    /// # Errors
    /// As [`Faults::open`].
    pub fn parse(file: impl AsRef<Path>, text: &str, machine: &Machine) -> Result<Faults> {
        Faults::from_document(&Document::new(file, text.to_string())?.guided(GUIDE), machine)
    }

    fn from_document(document: &Document, machine: &Machine) -> Result<Faults> {
        let form: FaultsForm = document.read()?;
        Reader { machine, form: &form }
            .faults()
            .map_err(|Fail { path, message, mend }| Error::mistake(document.place_of(&path), message, mend))
    }
}

/// A value that cannot stand: its path in the file, what is wrong, the mend.
struct Fail {
    path: String,
    message: String,
    mend: String,
}

fn fail<T>(
    path: impl Into<String>,
    message: impl Into<String>,
    mend: impl Into<String>,
) -> std::result::Result<T, Fail> {
    Err(Fail { path: path.into(), message: message.into(), mend: mend.into() })
}

struct Reader<'a> {
    machine: &'a Machine,
    form: &'a FaultsForm,
}

type Checked<T> = std::result::Result<T, Fail>;

impl Reader<'_> {
    fn faults(&self) -> Checked<Faults> {
        let (machine, form) = (self.machine, self.form);
        if let Some(name) = form.machine.as_ref().filter(|name| *name != machine.name()) {
            return fail(
                "machine",
                format!("faults are those of machine \"{name}\", not of \"{}\"", machine.name()),
                "use them with their own machine file, or correct `machine:`",
            );
        }
        let mut faults = Faults::default();
        for (list, name, into) in [
            (&form.deviations, "deviations", &mut faults.deviations),
            (&form.factors, "factors", &mut faults.factors),
        ] {
            for (i, entry) in list.iter().enumerate() {
                let j = self.frame(format!("{name}[{i}].frame"), &entry.frame)?;
                into.push((j, self.twist(&format!("{name}[{i}]"), entry.v, entry.w)?));
            }
            self.once(name, into.iter().map(|(j, _)| *j), "frame")?;
        }
        for (i, entry) in form.twists.iter().enumerate() {
            let j = self.joint(format!("twists[{i}].joint"), &entry.joint)?;
            faults.twists.push((j, self.twist(&format!("twists[{i}]"), entry.v, entry.w)?));
        }
        self.once("twists", faults.twists.iter().map(|(j, _)| *j), "joint")?;
        for (i, entry) in form.displacements.iter().enumerate() {
            let j = self.joint(format!("displacements[{i}].joint"), &entry.joint)?;
            let offset = self.number(format!("displacements[{i}].offset"), entry.offset, self.unit(j))?;
            faults.displacements.push((j, offset));
        }
        self.once("displacements", faults.displacements.iter().map(|(j, _)| *j), "joint")?;
        for (i, entry) in form.backlash.iter().enumerate() {
            let j = self.joint(format!("backlash[{i}].joint"), &entry.joint)?;
            faults.backlash.push((j, self.width(&format!("backlash[{i}]"), j, entry)?));
        }
        self.once("backlash", faults.backlash.iter().map(|(j, _)| *j), "joint")?;
        for (i, effect) in form.effects.iter().enumerate() {
            const MEND: &str = "write it as `diagnose -o` writes effects into a calibrated file";
            let path = format!("effects[{i}]");
            let named = format!("effect {} at {}", effect.effect, effect.at);
            let bound = match effect.bind(machine) {
                Ok(bound) => bound,
                Err(unbound) => return fail(path, format!("{named}: {unbound}"), MEND),
            };
            let mut parts = bound.iter().flat_map(|(_, parts)| parts);
            if let Some((name, unit)) = parts.find_map(|part| part.feature.channels().into_iter().next()) {
                let what = format!("{named} depends on {name}[{unit}], which is not simulated");
                return fail(
                    path,
                    what,
                    "leave it out; if that is a joint of a side branch, leave the branch out of the machine file",
                );
            }
            faults.effects.push(effect.clone());
        }
        Ok(faults)
    }

    fn once(&self, list: &str, dyads: impl Iterator<Item = usize>, what: &str) -> Checked<()> {
        let dyads: Vec<usize> = dyads.collect();
        for (i, j) in dyads.iter().enumerate() {
            if dyads[..i].contains(j) {
                let dyad = &self.machine.dyads()[*j];
                let joint = dyad.joint.as_ref().filter(|_| what == "joint");
                let name = joint.map_or(&dyad.frame, |joint| &joint.name);
                return fail(
                    format!("{list}[{i}].{what}"),
                    format!("{what} \"{name}\" stands twice in `{list}`"),
                    "keep one of them",
                );
            }
        }
        Ok(())
    }

    fn frame(&self, path: String, name: &str) -> Checked<usize> {
        let known = || self.machine.dyads().iter().map(|d| d.frame.as_str()).collect::<Vec<_>>().join(", ");
        match self.machine.frame_index(name) {
            Some(j) => Ok(j),
            None => fail(
                path,
                format!("frame \"{name}\" is not one of the machine's"),
                format!("frames of this machine: {}", known()),
            ),
        }
    }

    fn joint(&self, path: String, name: &str) -> Checked<usize> {
        let known = || self.machine.joints().map(|(_, j)| j.name.as_str()).collect::<Vec<_>>().join(", ");
        match self.machine.joints().find(|(_, joint)| joint.name == name) {
            Some((j, _)) => Ok(j),
            None => fail(
                path,
                format!("joint \"{name}\" is not one of the machine's"),
                format!("joints of this machine: {}", known()),
            ),
        }
    }

    fn is_prismatic(&self, j: usize) -> bool {
        self.machine.dyads()[j].joint.as_ref().is_some_and(|joint| joint.kind == JointKind::Prismatic)
    }

    /// Unit of what is wrong with joint `j`.
    fn unit(&self, j: usize) -> Unit {
        let units = self.form.units.units();
        if self.is_prismatic(j) { units.length } else { units.angle }
    }

    /// Unit of where joint `j` stands.
    fn position_unit(&self, j: usize) -> Unit {
        let units = self.form.positions.units();
        if self.is_prismatic(j) { units.length } else { units.angle }
    }

    fn number(&self, path: String, value: f64, unit: Unit) -> Checked<f64> {
        let si = unit.to_si(value);
        if si.is_finite() && si.abs() < 1e6 {
            return Ok(si);
        }
        fail(
            path,
            format!("{value:?} {unit} is not a usable number"),
            "write a plain number below 1e6 m or 1e6 rad",
        )
    }

    fn vector(&self, path: String, (x, y, z): Triple, unit: Unit) -> Checked<Vec3<f64>> {
        let mut vector = [x, y, z];
        for (i, value) in vector.iter_mut().enumerate() {
            *value = self.number(format!("{path}[{i}]"), *value, unit)?;
        }
        Ok(Vec3(vector))
    }

    fn twist(&self, path: &str, v: Triple, w: Triple) -> Checked<Twist<f64>> {
        let units = self.form.units.units();
        Ok(Twist::new(
            self.vector(format!("{path}.v"), v, units.length)?,
            self.vector(format!("{path}.w"), w, units.angle)?,
        ))
    }

    fn width(&self, path: &str, j: usize, entry: &BacklashForm) -> Checked<Width> {
        const ONE: &str = "write either `width: 60` or `by_position: ...`";
        let unit = self.unit(j);
        match (entry.width, &entry.by_position) {
            (Some(width), None) => {
                let si = self.number(format!("{path}.width"), width, unit)?;
                match si >= 0.0 {
                    true => Ok(Width::Constant(si)),
                    false => fail(
                        format!("{path}.width"),
                        format!("width of play is {width} {unit}"),
                        "write a width of zero or more",
                    ),
                }
            }
            (None, Some(form)) => self.by_position(&format!("{path}.by_position"), j, form, unit),
            (Some(_), Some(_)) => fail(path, "`width` stands beside `by_position`", ONE),
            (None, None) => fail(path, "backlash has no width", ONE),
        }
    }

    fn by_position(&self, path: &str, j: usize, form: &WidthForm, unit: Unit) -> Checked<Width> {
        let position = self.position_unit(j);
        let list = |name: &str, values: &[f64]| -> Checked<Vec<f64>> {
            let one = |(i, x): (usize, &f64)| self.number(format!("{path}{name}[{i}]"), *x, unit);
            values.iter().enumerate().map(one).collect()
        };
        match form {
            WidthForm::Polynomial(coefficients) if coefficients.is_empty() => {
                fail(path, "polynomial has no coefficient", "write the width at zero first: Polynomial([60])")
            }
            WidthForm::Polynomial(coefficients) => {
                let per_si = 1.0 / position.to_si(1.0);
                let terms = list("", coefficients)?.into_iter().enumerate();
                Ok(Width::Polynomial(terms.map(|(i, c)| c * per_si.powi(i as i32)).collect()))
            }
            WidthForm::Harmonics(form) => {
                let period = match form.period {
                    Some(period) => self.number(format!("{path}.period"), period, position)?,
                    None if self.is_prismatic(j) => {
                        return fail(
                            path,
                            "harmonics of a linear axis have no period",
                            "add `period: ...`, the screw's lead",
                        );
                    }
                    None => std::f64::consts::TAU,
                };
                if period <= 0.0 {
                    return fail(
                        format!("{path}.period"),
                        "period is not above zero",
                        "write a length or angle above zero",
                    );
                }
                Ok(Width::Harmonics {
                    mean: self.number(format!("{path}.mean"), form.mean, unit)?,
                    cos: list(".cos", &form.cos)?,
                    sin: list(".sin", &form.sin)?,
                    period,
                })
            }
            WidthForm::Points(points) => {
                let mut out: Vec<(f64, f64)> = Vec::new();
                for (i, (at, width)) in points.iter().enumerate() {
                    let at = self.number(format!("{path}[{i}][0]"), *at, position)?;
                    let width_si = self.number(format!("{path}[{i}][1]"), *width, unit)?;
                    if width_si < 0.0 {
                        return fail(
                            format!("{path}[{i}][1]"),
                            format!("width of play is {width} {unit}"),
                            "write a width of zero or more",
                        );
                    }
                    if out.last().is_some_and(|(before, _)| *before >= at) {
                        return fail(
                            format!("{path}[{i}]"),
                            "positions do not rise",
                            "sort the points by position",
                        );
                    }
                    out.push((at, width_si));
                }
                if out.is_empty() {
                    return fail(path, "there is no point", "write Points([(position, width), ...])");
                }
                Ok(Width::Points(out))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn widths_by_position_are_what_they_say() {
        let harmonics =
            Width::Harmonics { mean: 60.0, cos: vec![24.0], sin: vec![], period: std::f64::consts::TAU };
        assert!((harmonics.at(1.0) - 60.0 * (1.0 + 0.4 * 1f64.cos())).abs() < 1e-12);
        assert_eq!(Width::Polynomial(vec![5.0, 0.0, 2.0]).at(3.0), 23.0);
        let points = Width::Points(vec![(-1.0, 2.0), (1.0, 4.0), (2.0, 0.0)]);
        let widths: Vec<f64> = [-5.0, -1.0, 0.0, 1.0, 1.5, 2.0, 9.0].map(|q| points.at(q)).to_vec();
        assert_eq!(widths, [2.0, 2.0, 3.0, 4.0, 2.0, 0.0, 0.0]);
    }
}
