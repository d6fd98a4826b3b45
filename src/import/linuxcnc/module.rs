//! Kinematics modules of LinuxCNC as chains. The formulas are those of `export --to linuxcnc`, in machine coordinates with the origin at the
//! gauge line where all joints are at zero.

use crate::lie::Vec3;

/// What a frame of a module holds: a joint by its letter, the direction of its axis, and where it stands in the frame before.
pub(super) struct Frame {
    /// Letter of the axis; nothing for the ends.
    pub letter: Option<char>,
    pub axis: Vec3<f64>,
    /// Machine units.
    pub at: Vec3<f64>,
}

/// A chain of a module.
pub(super) struct Frames {
    pub workpiece: Vec<Frame>,
    pub tool: Vec<Frame>,
}

pub(super) struct Module {
    pub name: &'static str,
    /// Letters of its joints, by number, where the INI file states none.
    pub coordinates: &'static str,
    /// Pins that take lengths, in the order in which `frames` takes them, and whether they must be set.
    pub pins: &'static [(&'static str, bool)],
    /// The pin that holds the length of the tool.
    pub tool_pin: Option<&'static str>,
    frames: fn(&[f64]) -> Frames,
}

impl Module {
    /// The chain with these values of its pins; `conventional` reverses the tables of the modules that have such a pin.
    pub fn frames(&self, pins: &[f64], conventional: bool, letters: &str) -> Frames {
        let mut frames = (self.frames)(pins);
        if conventional {
            frames.workpiece.iter_mut().for_each(|frame| frame.axis = -frame.axis);
        }
        // The quill of 5axiskins, where the machine has one.
        if self.name == "5axiskins"
            && letters.contains('W')
            && let Some(tip) = frames.tool.pop()
        {
            frames.tool.push(joint('W', -Z, NOWHERE));
            frames.tool.push(tip);
        }
        frames
    }

    /// Whether the module has the pin that reverses its tables.
    pub fn may_be_conventional(&self) -> bool {
        self.name.ends_with("-trt-kins")
    }
}

const X: Vec3<f64> = Vec3([1.0, 0.0, 0.0]);
const Y: Vec3<f64> = Vec3([0.0, 1.0, 0.0]);
const Z: Vec3<f64> = Vec3([0.0, 0.0, 1.0]);
const NOWHERE: Vec3<f64> = Vec3([0.0; 3]);

fn joint(letter: char, axis: Vec3<f64>, at: Vec3<f64>) -> Frame {
    Frame { letter: Some(letter), axis, at }
}

fn end(at: Vec3<f64>) -> Frame {
    Frame { letter: None, axis: NOWHERE, at }
}

fn slides() -> Vec<Frame> {
    vec![joint('X', X, NOWHERE), joint('Y', Y, NOWHERE), joint('Z', Z, NOWHERE)]
}

fn with_slides(tool: impl IntoIterator<Item = Frame>) -> Vec<Frame> {
    slides().into_iter().chain(tool).collect()
}

/// W = P + R(-C) (o + R(-tilt) (J - P - o))
fn trunnion(letter: char, axis: Vec3<f64>, p: Vec3<f64>, o: Vec3<f64>) -> Frames {
    let workpiece = vec![joint(letter, axis, p + o), joint('C', Z, -o), end(-p)];
    Frames { workpiece, tool: with_slides([end(NOWHERE)]) }
}

pub(super) const MODULES: [Module; 6] = [
    Module {
        name: "trivkins",
        coordinates: "XYZABCUVW",
        pins: &[],
        tool_pin: None,
        frames: |_| Frames { workpiece: vec![end(NOWHERE)], tool: with_slides([end(NOWHERE)]) },
    },
    Module {
        name: "xyzac-trt-kins",
        coordinates: "XYZAC",
        pins: &[
            ("x-rot-point", false),
            ("y-rot-point", false),
            ("z-rot-point", false),
            ("y-offset", false),
            ("z-offset", false),
        ],
        tool_pin: Some("tool-offset"),
        frames: |pins| match *pins {
            [x, y, z, b, c] => trunnion('A', X, Vec3([x, y, z]), Vec3([0.0, b, c])),
            _ => trunnion('A', X, NOWHERE, NOWHERE),
        },
    },
    Module {
        name: "xyzbc-trt-kins",
        coordinates: "XYZBC",
        pins: &[
            ("x-rot-point", false),
            ("y-rot-point", false),
            ("z-rot-point", false),
            ("x-offset", false),
            ("z-offset", false),
        ],
        tool_pin: Some("tool-offset"),
        frames: |pins| match *pins {
            [x, y, z, a, c] => trunnion('B', Y, Vec3([x, y, z]), Vec3([a, 0.0, c])),
            _ => trunnion('B', Y, NOWHERE, NOWHERE),
        },
    },
    // W = P + Rx(A) (Ry(B) (J - P) - z-offset ez) + z-offset ez
    Module {
        name: "xyzab_tdr_kins",
        coordinates: "XYZAB",
        pins: &[("x-rot-point", false), ("y-rot-point", false), ("z-rot-point", false), ("z-offset", false)],
        tool_pin: Some("tool-offset-z"),
        frames: |pins| {
            let of = |i: usize| pins.get(i).copied().unwrap_or(0.0);
            let (p, up) = (Vec3([of(0), of(1), of(2)]), Z.times(of(3)));
            let workpiece = vec![joint('B', -Y, p), joint('A', -X, up), end(-p - up)];
            Frames { workpiece, tool: with_slides([end(NOWHERE)]) }
        },
    },
    // W = J + L ez + Rz(C) Ry(-B) (0, 0, -L)
    Module {
        name: "5axiskins",
        coordinates: "XYZBCW",
        pins: &[("pivot-length", true)],
        tool_pin: None,
        frames: |pins| {
            let up = Z.times(pins.first().copied().unwrap_or(0.0));
            let head = [joint('C', Z, up), joint('B', -Y, NOWHERE), end(-up)];
            Frames { workpiece: vec![end(NOWHERE)], tool: with_slides(head) }
        },
    },
    // Wxy = Rz(C) (Jxy + (L sin B, 0)), Wz = Jz + L - L cos B
    Module {
        name: "maxkins",
        coordinates: "XYZABCUVW",
        pins: &[("pivot-length", true)],
        tool_pin: None,
        frames: |pins| {
            let up = Z.times(pins.first().copied().unwrap_or(0.0));
            let workpiece = vec![joint('C', -Z, NOWHERE), end(NOWHERE)];
            Frames { workpiece, tool: with_slides([joint('B', -Y, up), end(-up)]) }
        },
    },
];
