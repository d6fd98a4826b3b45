//! What a model says of all its numbers: units of angles, sequence of Euler angles, limits.

use roxmltree::Node;

use super::super::xml::Source;
use crate::error::Result;
use crate::machine::FileUnits;
use crate::units::Unit;

pub(super) struct Settings {
    degrees: bool,
    /// Axes of Euler angles, three of `xyzXYZ`.
    pub euler: [char; 3],
    pub autolimits: bool,
    /// Whether masses follow from geoms even where they are stated.
    pub masses_of_geoms: bool,
    /// Units of the machine file.
    pub units: FileUnits,
    pub told: Vec<String>,
}

impl Settings {
    pub fn read(source: &Source, root: Node) -> Result<Settings> {
        let mut settings = Settings {
            degrees: true,
            euler: ['x', 'y', 'z'],
            autolimits: true,
            masses_of_geoms: false,
            units: FileUnits::si(),
            told: Vec::new(),
        };
        for node in root.children().filter(|n| n.has_tag_name("compiler")) {
            settings.compiler(source, node)?;
        }
        if settings.degrees
            && let Some(degree) = Unit::named("deg")
        {
            settings.units.angle = degree;
        }
        for node in root.children().filter(|n| n.has_tag_name("option")) {
            let Some(gravity) = source.finite::<3>(node, "gravity")? else { continue };
            if gravity[0] != 0.0 || gravity[1] != 0.0 || gravity[2] > 0.0 {
                settings.told.push(format!(
                    "gravity of the model is {} {} {}; state it where masses count, as `gravity` in the frame of the base",
                    gravity[0], gravity[1], gravity[2]
                ));
            }
        }
        Ok(settings)
    }

    fn compiler(&mut self, source: &Source, node: Node) -> Result<()> {
        let word = |name: &str| node.attribute(name).map(str::trim);
        let fault = |name: &str, value: &str, mend: &str| {
            Err(source.fault(node, format!("`{name}` of <compiler> is `{value}`"), mend))
        };
        match word("angle") {
            None => {}
            Some("degree") => self.degrees = true,
            Some("radian") => self.degrees = false,
            Some(other) => return fault("angle", other, "write degree or radian"),
        }
        if let Some(text) = word("eulerseq") {
            let letters: Vec<char> = text.chars().collect();
            match letters[..] {
                [a, b, c] if letters.iter().all(|l| "xyzXYZ".contains(*l)) => self.euler = [a, b, c],
                _ => {
                    return fault(
                        "eulerseq",
                        text,
                        "write three of the letters x y z, or X Y Z for axes that stand still",
                    );
                }
            }
        }
        match word("coordinate") {
            None | Some("local") => {}
            Some(other) => {
                let mend = "save the model by a version of MuJoCo that reads it (mj_saveLastXML): newer ones know local coordinates only";
                return fault("coordinate", other, mend);
            }
        }
        match word("autolimits") {
            None => {}
            Some("true") => self.autolimits = true,
            Some("false") => self.autolimits = false,
            Some(other) => return fault("autolimits", other, "write true or false"),
        }
        match word("inertiafromgeom") {
            Some("true") => self.masses_of_geoms = true,
            Some(_) => self.masses_of_geoms = false,
            None => {}
        }
        // All masses are scaled then, those of geoms included.
        self.masses_of_geoms |= word("settotalmass").is_some_and(|text| !text.starts_with('-'));
        Ok(())
    }

    /// An angle of the model, rad.
    pub fn angle(&self, x: f64) -> f64 {
        self.units.angle.to_si(x)
    }
}
