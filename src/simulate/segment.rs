//! One motion block of an NC program: a line or an arc in programmed coordinates.

/// From one point to another. Coordinates are one per command, m and rad, with the signs of the program.
#[derive(Clone, Debug)]
pub(super) struct Segment {
    pub start: Vec<f64>,
    pub end: Vec<f64>,
    pub arc: Option<Arc>,
    /// m along linear coordinates; rad of the largest turn where they stand still.
    pub length: f64,
    /// Whether `length` is one.
    pub linear: bool,
    /// Largest speed, m/s or rad/s.
    pub speed: f64,
    /// Standstill behind it, s.
    pub dwell: f64,
    /// Whether it belongs to the approach, before the program's own motion.
    pub approach: bool,
    pub line: usize,
    /// Whether linear coordinates are those of the tool centre point in frame `w`.
    pub tip: bool,
    /// Directions of the linear coordinates at both ends.
    pub tangents: Option<[[f64; 3]; 2]>,
}

/// An arc in the plane of two coordinates; the others run along evenly.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arc {
    pub first: usize,
    pub second: usize,
    pub centre: [f64; 2],
    /// Radius and angle at the start, radius at the end.
    pub radius: f64,
    pub angle: f64,
    pub end_radius: f64,
    /// Signed, rad.
    pub sweep: f64,
}

impl Arc {
    /// `ends` are the coordinates of the plane at start and end; `ccw` from the first axis to the second.
    pub fn new(axes: [usize; 2], ends: [[f64; 2]; 2], centre: [f64; 2], ccw: bool) -> Arc {
        let polar = |p: [f64; 2]| {
            let (x, y) = (p[0] - centre[0], p[1] - centre[1]);
            (x.hypot(y), y.atan2(x))
        };
        let ((radius, angle), (end_radius, end)) = (polar(ends[0]), polar(ends[1]));
        let turn = std::f64::consts::TAU;
        let ahead = if ccw { end - angle } else { angle - end }.rem_euclid(turn);
        // The same point again is a full turn.
        let sweep = if ahead < 1e-9 || turn - ahead < 1e-9 { turn } else { ahead };
        Arc {
            first: axes[0],
            second: axes[1],
            centre,
            radius,
            angle,
            end_radius,
            sweep: if ccw { sweep } else { -sweep },
        }
    }

    /// Centre of the arc with this radius (negative: the longer way), if there is one.
    pub fn centre_of(ends: [[f64; 2]; 2], radius: f64, ccw: bool) -> Option<[f64; 2]> {
        let [a, b] = ends;
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let chord = dx.hypot(dy);
        if chord < 1e-12 {
            return None;
        }
        let height = radius * radius - chord * chord / 4.0;
        // Half a turn whose ends are rounded.
        if height < -1e-3 * radius * radius {
            return None;
        }
        let side = if ccw == (radius > 0.0) { 1.0 } else { -1.0 };
        let h = side * height.max(0.0).sqrt() / chord;
        Some([(a[0] + b[0]) / 2.0 - h * dy, (a[1] + b[1]) / 2.0 + h * dx])
    }

    fn at(&self, part: f64) -> [f64; 2] {
        let (angle, radius) =
            (self.angle + part * self.sweep, self.radius + part * (self.end_radius - self.radius));
        [self.centre[0] + radius * angle.cos(), self.centre[1] + radius * angle.sin()]
    }
}

impl Segment {
    /// Coordinates after a part, 0 to 1, of the way.
    pub fn at(&self, part: f64) -> Vec<f64> {
        let mut point: Vec<f64> = self.start.iter().zip(&self.end).map(|(a, b)| a + (b - a) * part).collect();
        if part >= 1.0 {
            return self.end.clone();
        }
        if let Some(arc) = &self.arc {
            [point[arc.first], point[arc.second]] = arc.at(part);
        }
        point
    }

    /// Fills in length and tangents; `linear` are the linear coordinates.
    pub fn measure(&mut self, linear: &[usize]) {
        let gone: Vec<f64> = self.start.iter().zip(&self.end).map(|(a, b)| b - a).collect();
        let straight: f64 = match &self.arc {
            None => linear.iter().map(|c| gone[*c] * gone[*c]).sum::<f64>().sqrt(),
            Some(arc) => {
                let beside = linear.iter().filter(|c| **c != arc.first && **c != arc.second);
                let along = arc.sweep.abs() * 0.5 * (arc.radius + arc.end_radius);
                beside.map(|c| gone[*c] * gone[*c]).sum::<f64>().sqrt().hypot(along)
            }
        };
        self.linear = straight > 1e-12;
        if !self.linear {
            let turned = |c: &usize| !linear.contains(c);
            self.length = (0..gone.len()).filter(turned).map(|c| gone[c].abs()).fold(0.0, f64::max);
            return;
        }
        self.length = straight;
        let step = 1e-6;
        let tangent = |from: f64, to: f64| {
            let (a, b) = (self.at(from), self.at(to));
            let mut direction = [0.0; 3];
            linear.iter().take(3).enumerate().for_each(|(i, c)| direction[i] = b[*c] - a[*c]);
            let norm = direction.iter().map(|x| x * x).sum::<f64>().sqrt();
            direction.map(|x| if norm > 0.0 { x / norm } else { 0.0 })
        };
        self.tangents = Some([tangent(0.0, step), tangent(1.0 - step, 1.0)]);
    }

    /// Whether the path goes on into `next` without a sharper corner than the cosine says.
    pub fn passes_into(&self, next: &Segment, cosine: f64) -> bool {
        match (self.tangents, next.tangents) {
            (Some([_, a]), Some([b, _])) => {
                self.dwell == 0.0 && a.iter().zip(&b).map(|(x, y)| x * y).sum::<f64>() >= cosine
            }
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arcs_by_centre_and_by_radius_agree() {
        let ends = [[1.0, 0.0], [0.0, 1.0]];
        let quarter = Arc::new([0, 1], ends, [0.0, 0.0], true);
        assert!((quarter.sweep.to_degrees() - 90.0).abs() < 1e-9);
        let long = Arc::new([0, 1], ends, [0.0, 0.0], false);
        assert!((long.sweep.to_degrees() + 270.0).abs() < 1e-9);
        for (radius, ccw, expected) in
            [(1.0, true, [0.0, 0.0]), (-1.0, false, [0.0, 0.0]), (1.0, false, [1.0, 1.0])]
        {
            let centre = Arc::centre_of(ends, radius, ccw).expect("an arc");
            assert!(
                (centre[0] - expected[0]).abs() < 1e-9 && (centre[1] - expected[1]).abs() < 1e-9,
                "{centre:?}"
            );
        }
        assert!(Arc::centre_of(ends, 0.5, true).is_none());
        let full = Arc::new([0, 1], [[1.0, 0.0], [1.0, 0.0]], [0.0, 0.0], true);
        assert!((full.sweep.to_degrees() - 360.0).abs() < 1e-9);
    }
}
