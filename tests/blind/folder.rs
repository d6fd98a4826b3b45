//! Cases as files: `case_NNN/rec_K.csv`, `judge/case_NNN.csv`, `answers.json`, and `judge_as_is/case_NNN.csv` where what is concealed is
//! outside every vocabulary: there `judge` has a machine that is rid of it.

use std::fmt::Write as _;
use std::path::Path;

use serde_json::{Map, Value, json};

use super::body::Rigid;
use super::case::{Case, Concealed, Mode};
use super::effect::{Place, Profile};
use super::world::Instrument;

/// The judge's paths of machines that still have what is outside every vocabulary.
pub const AS_IS: &str = "judge_as_is";

impl Case {
    pub fn label(&self) -> String {
        format!("case_{:03}", self.number)
    }

    /// Writes recordings and judge, and returns the answer.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write(&self, folder: &Path) -> std::io::Result<Value> {
        let own = folder.join(self.label());
        std::fs::create_dir_all(&own)?;
        let mut random = self.random.clone();
        let recorded = self.world.runs.len() - 1;
        for run in 0..recorded {
            let readings = self.readings(run, true, Some(&mut random));
            std::fs::write(own.join(format!("rec_{}.csv", run + 1)), self.csv(run, &readings, 5))?;
        }
        let is_odd = self.mode == Mode::Odd;
        for (name, with_effects) in
            [("judge", !is_odd), (AS_IS, true)].into_iter().take(1 + usize::from(is_odd))
        {
            let own = folder.join(name);
            std::fs::create_dir_all(&own)?;
            let judged = self.csv(recorded, &self.readings(recorded, with_effects, None), 7);
            std::fs::write(own.join(format!("{}.csv", self.label())), judged)?;
        }
        Ok(self.answer())
    }

    fn csv(&self, run: usize, readings: &[super::case::Reading], decimals: usize) -> String {
        let world = &self.world;
        let body = &world.body;
        let r = &world.runs[run];
        let mut out = format!("# machine: {}\n", body.name);
        let mm = |v: [f64; 3]| format!("{:.6},{:.6},{:.6}", v[0] * 1e3, v[1] * 1e3, v[2] * 1e3);
        let (measurement, columns) = match world.instrument {
            Instrument::Distance { absolute: false } => ("distance", "d[mm]".to_string()),
            Instrument::Distance { absolute: true } => ("distance", "r[mm]".to_string()),
            Instrument::Position => ("position", "px[mm],py[mm],pz[mm]".to_string()),
            Instrument::Pose => ("pose", "px[mm],py[mm],pz[mm],qw[1],qx[1],qy[1],qz[1]".to_string()),
            Instrument::Displacement(_) => ("displacement", "s[mm]".to_string()),
            Instrument::Joint(j) => {
                let unit = if world.reads_angle() { "deg" } else { "mm" };
                ("joint", format!("{}_meas[{unit}]", self.at(Place::Joint(j))))
            }
        };
        let _ = writeln!(out, "# measurement: {measurement}");
        if world.instrument == (Instrument::Distance { absolute: false }) {
            let _ = writeln!(out, "# nominal_length[mm]: {}", r.length * 1e3);
        }
        if let Instrument::Displacement(n) = world.instrument {
            let _ = writeln!(out, "# direction: {},{},{}", n[0], n[1], n[2]);
        }
        if world.tool_point != [0.0; 3] {
            let _ = writeln!(out, "# tool_point[mm]: {}", mm(world.tool_point));
        }
        if world.workpiece_point != [0.0; 3] {
            let _ = writeln!(out, "# workpiece_point[mm]: {}", mm(world.workpiece_point));
        }
        out.push_str("t[s]");
        for (c, name) in body.commands.iter().enumerate() {
            let _ = write!(out, ",{name}[{}]", if body.revolute[c] { "deg" } else { "mm" });
        }
        if r.stated.is_some() {
            let _ = write!(out, ",{}_direction[1]", body.commands[0]);
        }
        let _ = writeln!(out, ",{columns}");
        for (i, reading) in readings.iter().enumerate() {
            let _ = write!(out, "{:.4}", r.time[i]);
            for (c, q) in r.commands[i].iter().enumerate() {
                let _ = write!(out, ",{:.6}", if body.revolute[c] { q.to_degrees() } else { q * 1e3 });
            }
            if let Some(stated) = &r.stated {
                let _ = write!(out, ",{:.0}", stated[i]);
            }
            for part in &reading.parts {
                if world.reads_angle() {
                    let _ = write!(out, ",{:.8}", part.to_degrees());
                } else {
                    let _ = write!(out, ",{:.decimals$}", part * 1e3);
                }
            }
            if world.instrument == Instrument::Pose {
                let q = Rigid { r: reading.turned, p: [0.0; 3] }.quaternion();
                let _ = write!(out, ",{:.10},{:.10},{:.10},{:.10}", q[0], q[1], q[2], q[3]);
            }
            out.push('\n');
        }
        out
    }

    fn answer(&self) -> Value {
        let world = &self.world;
        let recorded = world.runs.len() - 1;
        let tests: Vec<&str> = world.runs[..recorded].iter().map(|r| r.test.as_str()).collect();
        let mut answer = json!({
            "case": self.label(),
            "machine": world.body.name,
            "mode": self.mode.word(),
            "measurement": match world.instrument {
                Instrument::Distance { .. } => "distance",
                Instrument::Position => "position",
                Instrument::Pose => "pose",
                Instrument::Displacement(_) => "displacement",
                Instrument::Joint(_) => "joint",
            },
            "sigma_mm": world.sigma.0 * 1e3,
            "sigma_rad": world.sigma.1,
            "reads_angle": world.reads_angle(),
            "tests": tests,
            "rho": self.noise.rho,
            "outliers": self.noise.outliers,
            "coarse": self.noise.coarse,
            "effects": self.concealed.iter().map(|c| self.effect_answer(c)).collect::<Vec<_>>(),
        });
        if let Some(near) = &self.nearest {
            answer["nearest_family"] = json!([near.name, self.at(near.place), near.share]);
        }
        answer
    }

    fn effect_answer(&self, c: &Concealed) -> Value {
        let mut out = Map::new();
        out.insert("effect".into(), json!(c.effect.name));
        match c.effect.place {
            Place::Joint(_) => out.insert("axis".into(), json!(self.at(c.effect.place))),
            Place::Frame(_) => out.insert("frame".into(), json!(self.at(c.effect.place))),
            Place::Measurement => None,
        };
        if !c.depends_on.is_empty() {
            let axes: Vec<String> = c.depends_on.iter().map(|j| self.at(Place::Joint(*j))).collect();
            out.insert("axes".into(), json!(axes));
        }
        let coefficients: Map<String, Value> = c
            .effect
            .coefficients
            .iter()
            .map(|(name, value, grows)| {
                (name.to_string(), json!(if *grows { value * c.size } else { *value }))
            })
            .collect();
        out.insert("coefficients".into(), Value::Object(coefficients));
        out.insert("size".into(), self.size(c));
        out.insert("amplitude".into(), json!(c.size));
        out.insert("snr".into(), json!(c.snr));
        let at = |s: &super::textbook::Share| self.at(s.place);
        let also: Vec<Value> = c.also.iter().map(|s| json!([s.name, at(s)])).collect();
        let also_at: Vec<String> = c.also.iter().filter(|s| s.name == c.effect.name).map(at).collect();
        out.insert("also".into(), json!(also));
        out.insert("also_at".into(), json!(also_at));
        Value::Object(out)
    }

    /// Peak and RMS over the recordings: of the joint (`dq_P`, `dq_R`), of the frame (`v`, `w`), at the sensor (`add`).
    fn size(&self, c: &Concealed) -> Value {
        let seen = self.world.track.recorded;
        let figure = |values: &mut dyn Iterator<Item = f64>, unit: &str, per: f64| {
            let (mut peak, mut sum) = (0.0f64, 0.0);
            for v in values {
                peak = peak.max(v.abs());
                sum += v * v;
            }
            let rms = (sum / seen as f64).sqrt();
            json!({"peak": peak * c.size * per, "rms": rms * c.size * per, "unit": unit})
        };
        let mut out = Map::new();
        match &c.effect.profile {
            Profile::Joint(j, values) => {
                let turning = self.world.body.links[*j].joint.as_ref().is_some_and(|a| a.revolute);
                let values = &mut values[..seen].iter().copied();
                if turning {
                    out.insert("dq_R".into(), figure(values, "rad", 1.0));
                } else {
                    out.insert("dq_P".into(), figure(values, "mm", 1e3));
                }
            }
            Profile::Before(_, twists) | Profile::After(_, twists) => {
                let length =
                    |e: &[f64; 6], from: usize| super::body::norm([e[from], e[from + 1], e[from + 2]]);
                for (name, from, unit, per) in [("v", 0, "mm", 1e3), ("w", 3, "rad", 1.0)] {
                    if twists[..seen].iter().any(|e| length(e, from) > 0.0) {
                        let values = &mut twists[..seen].iter().map(|e| length(e, from));
                        out.insert(name.into(), figure(values, unit, per));
                    }
                }
            }
            Profile::Reading(_, values) => {
                let (unit, per) = if self.world.reads_angle() { ("rad", 1.0) } else { ("mm", 1e3) };
                out.insert("add".into(), figure(&mut values[..seen].iter().copied(), unit, per));
            }
            Profile::Late(_) => {
                out.insert("delay".into(), json!({"peak": c.size, "rms": c.size, "unit": "s"}));
            }
        }
        Value::Object(out)
    }
}
