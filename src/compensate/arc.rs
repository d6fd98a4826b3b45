//! Arcs and helices as the program means them, `docs/compensate.md` (C12).

use std::f64::consts::TAU;

use super::interpreter::Interpreter;
use crate::few::Few;
use crate::nc::{Block, Dialect, How, Motion, MotionKind, Plane, Value};

/// An arc in program coordinates, m and rad.
#[derive(Clone, Debug)]
pub(super) struct Arc {
    start: Few<f64>,
    end: Few<f64>,
    /// The two axes of the plane, as indices of axes.
    plane: [usize; 2],
    centre: [f64; 2],
    radius: [f64; 2],
    from: f64,
    sweep: f64,
}

impl Arc {
    /// Reads an arc out of its block, from where the program means to be to `end`; what is wrong with it in words.
    pub fn of(program: &Interpreter, block: &Block, motion: &Motion, end: &[f64]) -> Result<Arc, String> {
        let (modes, control, dialect) = (program.modes(), program.control(), program.dialect());
        let start = program.meant().program();
        // First and second axis of the plane, in the sense in which G3 turns, and the letters of the centre.
        let (names, centres) = match modes.plane {
            None | Some(Plane::Xy) => (["X", "Y"], ["I", "J"]),
            Some(Plane::Zx) => (["Z", "X"], ["K", "I"]),
            Some(Plane::Yz) => (["Y", "Z"], ["J", "K"]),
        };
        let mut plane = [0; 2];
        for (slot, name) in plane.iter_mut().zip(names) {
            let axis = control.axes().iter().position(|a| a.address() == name);
            *slot = axis.ok_or_else(|| format!("there is no axis {name}"))?;
            if !program.places().is_placed(*slot) {
                return Err(format!("where {name} starts is not known"));
            }
        }
        let find = |address: &str| block.words().iter().find(|w| w.address == address);
        let number = |address: &str| match find(address).map(|w| w.value) {
            None => Ok(None),
            Some(Value::Number(n)) => Ok(Some(n.value)),
            Some(Value::Expression) => Err(format!("`{address}` is an expression")),
        };
        let siemens = dialect == Dialect::Siemens;
        let radius = if siemens { number("CR")? } else { number("R")? };
        if find("AR").is_some() && siemens {
            return Err("it is given by its opening angle".into());
        }
        let (p, e) = (plane.map(|i| start[i]), plane.map(|i| end[i]));
        let chord = (e[0] - p[0]).hypot(e[1] - p[1]);
        let sign = if motion.kind == MotionKind::ArcCw { -1.0 } else { 1.0 };
        let mut centre = p;
        let closed = chord < 1e-9;
        if let Some(radius) = radius {
            let r = control.length_si(radius);
            if closed {
                return Err("a full circle needs its centre, not its radius".into());
            }
            let half = 0.5 * chord;
            let below = r * r - half * half;
            if below < -(1e-5f64.max(1e-3 * r.abs())) * r.abs() {
                return Err(format!("its end is {:.4} mm away, more than twice the radius", chord * 1e3));
            }
            // The centre lies to the left of the chord for a short counterclockwise arc.
            let rise = below.max(0.0).sqrt() * sign * r.signum();
            let along = [(e[0] - p[0]) / chord, (e[1] - p[1]) / chord];
            centre = [0.5 * (p[0] + e[0]) - along[1] * rise, 0.5 * (p[1] + e[1]) + along[0] * rise];
        } else {
            let mut given = false;
            for k in 0..2 {
                let Some(value) = number(centres[k])? else {
                    if program.absolute_centre() {
                        return Err(format!("its centre `{}` is missing", centres[k]));
                    }
                    continue;
                };
                given = true;
                let value = control.length_si(value);
                let absolute = match find(centres[k]).map(|w| w.how) {
                    Some(How::Absolute) => true,
                    Some(How::Incremental) => false,
                    _ => program.absolute_centre(),
                };
                centre[k] = if absolute { value } else { p[k] + value };
            }
            if !given {
                return Err("neither centre nor radius is given".into());
            }
        }
        let of = |x: [f64; 2]| {
            ((x[0] - centre[0]).hypot(x[1] - centre[1]), (x[1] - centre[1]).atan2(x[0] - centre[0]))
        };
        let ((r0, from), (r1, to)) = (of(p), of(e));
        if r0 < 1e-9 || (r0 - r1).abs() > 2e-5f64.max(2e-3 * r0) {
            return Err(format!(
                "its radius is {:.4} mm at the start and {:.4} mm at the end",
                r0 * 1e3,
                r1 * 1e3
            ));
        }
        let mut sweep = if closed { TAU } else { (sign * (to - from)).rem_euclid(TAU) };
        if sweep < 1e-9 {
            sweep = TAU;
        }
        let more = match dialect {
            Dialect::Rs274 => number("P")?.map_or(0.0, |p| (p - 1.0).max(0.0)),
            _ => number("TURN")?.unwrap_or(0.0),
        };
        let sweep = sign * (sweep + TAU * more.round());
        Ok(Arc {
            start: Few::from_slice(start),
            end: Few::from_slice(end),
            plane,
            centre,
            radius: [r0, r1],
            from,
            sweep,
        })
    }

    /// Program coordinates at a part `s` of it; (C12).
    pub fn at(&self, s: f64) -> Few<f64> {
        let mut p: Few<f64> = self.start.iter().zip(&self.end).map(|(a, b)| a + (b - a) * s).collect();
        if s < 1.0 {
            let radius = self.radius[0] + (self.radius[1] - self.radius[0]) * s;
            let (sin, cos) = (self.from + self.sweep * s).sin_cos();
            p[self.plane[0]] = self.centre[0] + radius * cos;
            p[self.plane[1]] = self.centre[1] + radius * sin;
        }
        p
    }

    /// Parts `s` at which it is looked at, up to its end: the ends of its quadrants, where an axis of the plane turns round, among them.
    pub fn stations(&self) -> Vec<f64> {
        const OF_TURN: f64 = 32.0;
        const MOST: usize = 4096;
        let count = (self.sweep.abs() / TAU * OF_TURN).ceil().clamp(8.0, MOST as f64);
        let mut stations: Vec<f64> = (0..=count as usize).map(|k| k as f64 / count).collect();
        let quadrant = 0.25 * TAU;
        let (low, high) = (self.from.min(self.from + self.sweep), self.from.max(self.from + self.sweep));
        let first = (low / quadrant).ceil() as i64;
        let turns = (first..).map(|k| k as f64 * quadrant).take_while(|angle| *angle < high).take(MOST);
        stations.extend(turns.map(|angle| ((angle - self.from) / self.sweep).clamp(0.0, 1.0)));
        stations.sort_by(f64::total_cmp);
        stations
    }

    /// How many equal chords stay within `room` (m) of it.
    pub fn chords(&self, room: f64) -> usize {
        let radius = self.radius[0].max(self.radius[1]);
        let half = (1.0 - (room / radius).min(1.0)).acos();
        // At least one in each quarter: a chord across half a circle is no arc any more.
        (self.sweep.abs() / (2.0 * half)).max(self.sweep.abs() / (0.25 * TAU)).ceil().max(1.0) as usize
    }
}
