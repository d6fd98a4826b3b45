//! Options of `kincal simulate`.

use std::path::PathBuf;

use crate::lie::Vec3;
use crate::machine::FileUnits;
use crate::simulate::Scatter;
use clap::ValueEnum;

use super::amounts::{self as amounts, Held, Rate};
use crate::cli::Common;
use crate::cli::files::Output;

#[derive(clap::Args)]
#[command(after_help = "\
Amounts bear their unit: 100mm, 0.5um, 5deg, 1000mm/min, 0.5m/s^2; points are 0,0,50mm. docs/simulate.md explains every test.")]
pub(crate) struct Args {
    /// Machine file; one that is calibrated keeps its deviations
    #[arg(value_name = "MACHINE.ron")]
    pub machine: PathBuf,

    /// What is run
    #[arg(
        long,
        value_enum,
        ignore_case = true,
        hide_possible_values = true,
        value_name = "TEST",
        help_heading = "Test",
        long_help = "What is run:
AK1 BK1 CK1  the rotary axis that tilts turns, linear axes follow (ISO 10791-6)
AK2 BK2 CK2  the rotary axis that turns turns, linear axes follow
AK4 BK4 CK4  cone frustum, five axes at once
             (AK: both rotary axes in the head, BK: in the table, CK: one in each)
rotary       any rotary axis (--axis), linear axes follow
cone         the cone frustum on any machine with two rotary axes
circle       a circle (ISO 230-4) in any plane
poses        random poses within travel, each approached from a random side
program      the motion of an NC program (--input PART.nc)
path         commands from a table (--input COMMANDS.csv)"
    )]
    pub test: Test,
    /// NC program or table of commands (program, path)
    #[arg(long, value_name = "FILE", help_heading = "Test")]
    pub input: Option<PathBuf>,
    /// Distance of the two balls: bar, or radius of the circle; a list makes one recording each [default: 100mm]
    #[arg(long, value_delimiter = ',', value_parser = amounts::positive_length, value_name = "LENGTH", help_heading = "Test")]
    pub length: Vec<f64>,
    /// Ball on the workpiece side, in frame w [default: 0,0,0mm]
    #[arg(long, value_parser = amounts::point, allow_hyphen_values = true, value_name = "X,Y,Z", help_heading = "Test")]
    pub ball: Option<Vec3<f64>>,
    /// Ball or target on the tool side, in frame t [default: 0,0,0mm]
    #[arg(long, value_parser = amounts::point, allow_hyphen_values = true, value_name = "X,Y,Z", help_heading = "Test")]
    pub tool_point: Option<Vec3<f64>>,
    /// Raises the workpiece ball, and the test with it; a list makes one recording each
    #[arg(long, value_delimiter = ',', value_parser = amounts::length, allow_hyphen_values = true, value_name = "LENGTH", help_heading = "Test")]
    pub height: Vec<f64>,
    /// Where an axis stands that the test does not move; once per axis [default: 0, or the middle of its travel]
    #[arg(long, value_parser = amounts::held, value_name = "JOINT=AMOUNT", help_heading = "Test")]
    pub hold: Vec<Held>,
    /// cone: half the apex angle [default: 45deg]
    #[arg(long, value_parser = amounts::positive_angle, value_name = "ANGLE", help_heading = "Test")]
    pub half_apex: Option<f64>,
    /// cone: inclination of the cone's axis [default: 30deg]
    #[arg(long, value_parser = amounts::angle, allow_hyphen_values = true, value_name = "ANGLE", help_heading = "Test")]
    pub inclination: Option<f64>,
    /// cone: by how much the tool leads the bar around the cone [default: 0deg]
    #[arg(long, value_parser = amounts::angle, allow_hyphen_values = true, value_name = "ANGLE", help_heading = "Test")]
    pub lead: Option<f64>,
    /// cone, program: tool centre point function. off: the bar keeps its direction in the base; a program gives joint
    /// coordinates [default: on; program: as it says]
    #[arg(long, value_enum, value_name = "ON|OFF", help_heading = "Test")]
    pub tcp: Option<OnOff>,
    /// program: without the rapid motion at the start (without any, the first block that moves)
    #[arg(long, help_heading = "Test")]
    pub without_approach: bool,
    /// cone: rotary commands with the opposite sign of those that aim the tool, as the paper's printed programs have them
    #[arg(long, help_heading = "Test")]
    pub reverse_rotary: bool,
    /// rotary: the axis
    #[arg(long, value_name = "JOINT", help_heading = "Test")]
    pub axis: Option<String>,
    /// rotary: where the bar points at the start [default: radial]
    #[arg(long, value_enum, value_name = "DIRECTION", help_heading = "Test")]
    pub bar: Option<BarDirection>,
    /// rotary: the bar does not turn with the axis
    #[arg(long, help_heading = "Test")]
    pub bar_stands: bool,
    /// circle: two linear axes that span its plane
    #[arg(
        long,
        value_delimiter = ',',
        num_args = 1,
        value_name = "JOINT,JOINT",
        conflicts_with = "normal",
        help_heading = "Test"
    )]
    pub plane: Vec<String>,
    /// circle: normal of its plane in frame w [default: 0,0,1]
    #[arg(long, value_parser = amounts::direction, allow_hyphen_values = true, value_name = "X,Y,Z", help_heading = "Test")]
    pub normal: Option<Vec3<f64>>,
    /// circle on a machine without linear axes: direction of the tool's axis in frame w [default: 0,0,-1]
    #[arg(long, value_parser = amounts::direction, allow_hyphen_values = true, value_name = "X,Y,Z", help_heading = "Test")]
    pub tool_axis: Option<Vec3<f64>>,
    /// poses: how many [default: 200]
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..=100_000_000), value_name = "N", help_heading = "Test")]
    pub count: Option<u64>,
    /// Rounds the direction of the bar to so many decimals, as published tables have it
    #[arg(long, value_parser = clap::value_parser!(u32).range(0..=15), value_name = "N", help_heading = "Test")]
    pub bar_decimals: Option<u32>,
    /// Rounds rotary commands to multiples of this, before linear axes are solved
    #[arg(long, value_parser = amounts::positive_angle, value_name = "ANGLE", help_heading = "Test")]
    pub rotary_step: Option<f64>,

    /// Start of the turn; of the axis (rotary) [default: 0deg; rotary: -90deg within travel, 0deg if it can turn round]
    #[arg(long, value_parser = amounts::angle, allow_hyphen_values = true, value_name = "ANGLE", help_heading = "Motion")]
    pub from: Option<f64>,
    /// End of the turn [default: 360deg; rotary: 90deg within travel, 360deg if it can turn round]
    #[arg(long, value_parser = amounts::angle, allow_hyphen_values = true, value_name = "ANGLE", help_heading = "Motion")]
    pub to: Option<f64>,
    /// Senses of the turn, one after the other in one recording [default: both]
    #[arg(long, value_enum, value_name = "SENSE", help_heading = "Motion")]
    pub sense: Option<Sense>,
    /// The turn with a stop after each of so many equal parts [default: 1]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=10_000), value_name = "N", help_heading = "Motion")]
    pub parts: Option<u32>,
    /// The whole so many times [default: 1]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=10_000), value_name = "N", help_heading = "Motion")]
    pub repeat: Option<u32>,
    /// Turns this much before and behind what is recorded
    #[arg(long, value_parser = amounts::positive_angle, value_name = "ANGLE", help_heading = "Motion")]
    pub overshoot: Option<f64>,
    /// Feeds, one after the other in one recording [default: 1000mm/min, rotary: 20deg/s]. program: where it states none
    #[arg(long, value_delimiter = ',', value_parser = amounts::feed, value_name = "FEED", help_heading = "Motion")]
    pub feed: Vec<Rate>,
    /// Acceleration along the path [default: 0.5m/s^2, rotary: 100deg/s^2]
    #[arg(long, value_parser = amounts::acceleration, value_name = "ACCELERATION", help_heading = "Motion")]
    pub acceleration: Option<Rate>,
    /// Limits the jerk along the path; without, the speed is trapezoidal
    #[arg(long, value_parser = amounts::jerk, value_name = "JERK", help_heading = "Motion")]
    pub jerk: Option<Rate>,
    /// Standstill at the end of each turn or part
    #[arg(long, value_parser = amounts::time, value_name = "TIME", help_heading = "Motion")]
    pub dwell: Option<f64>,
    /// Positions this far apart in the turn instead of a feed
    #[arg(long, value_parser = amounts::positive_angle, conflicts_with_all = ["feed", "acceleration", "jerk", "overshoot"],
        value_name = "ANGLE", help_heading = "Motion")]
    pub step: Option<f64>,
    /// Samples a second [default: 100; poses: 1]
    #[arg(long, value_parser = amounts::positive, value_name = "HZ", help_heading = "Motion")]
    pub rate: Option<f64>,
    /// Time of the first sample, for a recording that goes with others on one clock
    #[arg(long, default_value = "0s", value_parser = amounts::time, value_name = "TIME", help_heading = "Motion")]
    pub begin: f64,
    /// Time between two recordings of this call
    #[arg(long, default_value = "60s", value_parser = amounts::time, value_name = "TIME", help_heading = "Motion")]
    pub pause: f64,
    /// program: speed of rapid motion [default: 20m/min]
    #[arg(long, value_parser = amounts::feed, value_name = "FEED", help_heading = "Motion")]
    pub rapid: Option<Rate>,
    /// program: corners sharper than this stop the path [default: 5deg]
    #[arg(long, value_parser = amounts::angle, value_name = "ANGLE", help_heading = "Motion")]
    pub corner: Option<f64>,

    /// What is wrong with the machine, docs/simulate.md
    #[arg(long, value_name = "FAULTS.ron", help_heading = "Faults")]
    pub faults: Option<PathBuf>,
    /// Adds random deviations of every frame: the machine's tolerances times this
    #[arg(long, value_parser = amounts::not_negative, value_name = "SIZE", help_heading = "Faults")]
    pub random: Option<f64>,
    /// Seed of everything random
    #[arg(long, default_value_t = 1, value_name = "N", help_heading = "Faults")]
    pub seed: u64,

    /// What the instrument measures [default: distance; poses, program, path: position]
    #[arg(long, value_enum, value_name = "WHAT", help_heading = "Instrument")]
    pub measure: Option<Measure>,
    /// Measured joint (--measure joint)
    #[arg(long, value_name = "JOINT", help_heading = "Instrument")]
    pub joint: Option<String>,
    /// Measured direction in frame w (--measure displacement)
    #[arg(long, value_parser = amounts::direction, allow_hyphen_values = true, value_name = "X,Y,Z", help_heading = "Instrument")]
    pub direction: Option<Vec3<f64>>,
    /// Noise of lengths: 1um (normal), uniform:10um (0 to 10um), symmetric:3um (-3um to 3um)
    #[arg(long, value_parser = amounts::length_noise, value_name = "[SHAPE:]LENGTH", help_heading = "Instrument")]
    pub noise: Option<(Scatter, f64)>,
    /// Noise of angles, as --noise
    #[arg(long, value_parser = amounts::angle_noise, value_name = "[SHAPE:]ANGLE", help_heading = "Instrument")]
    pub noise_angle: Option<(Scatter, f64)>,
    /// Step of length readings
    #[arg(long, value_parser = amounts::positive_length, value_name = "LENGTH", help_heading = "Instrument")]
    pub resolution: Option<f64>,
    /// Step of angle readings
    #[arg(long, value_parser = amounts::positive_angle, value_name = "ANGLE", help_heading = "Instrument")]
    pub resolution_angle: Option<f64>,
    /// Part of the samples that are lost
    #[arg(long, value_parser = amounts::part, value_name = "PART", help_heading = "Instrument")]
    pub drop_outs: Option<f64>,
    /// How a lost sample is written
    #[arg(long, value_enum, default_value_t = DropAs::Empty, value_name = "HOW", help_heading = "Instrument")]
    pub drop_out_as: DropAs,
    /// Part of the samples that are far off
    #[arg(long, value_parser = amounts::part, requires = "outlier_size", value_name = "PART", help_heading = "Instrument")]
    pub outliers: Option<f64>,
    /// Standard deviation of what outliers are off by (angles: this over 100 mm)
    #[arg(long, value_parser = amounts::positive_length, value_name = "LENGTH", help_heading = "Instrument")]
    pub outlier_size: Option<f64>,

    /// Name of the set-up
    #[arg(long, value_name = "NAME", help_heading = "Set-up")]
    pub setup: Option<String>,
    /// The header declares frame w unknown
    #[arg(long, help_heading = "Set-up")]
    pub frame_unknown: bool,
    /// Where the instrument's frame w truly stands, in the machine file's frame w
    #[arg(long, value_parser = amounts::point, allow_hyphen_values = true, value_name = "X,Y,Z", help_heading = "Set-up")]
    pub frame_at: Option<Vec3<f64>>,
    /// How it is turned there (rotation vector)
    #[arg(long, value_parser = amounts::turn, allow_hyphen_values = true, value_name = "X,Y,Z", help_heading = "Set-up")]
    pub frame_turn: Option<Vec3<f64>>,
    /// The header declares the tool point unknown, under this name
    #[arg(long, value_name = "NAME", help_heading = "Set-up")]
    pub tool_point_unknown: Option<String>,
    /// The header declares the nominal length unknown
    #[arg(long, help_heading = "Set-up")]
    pub length_unknown: bool,
    /// By how much the bar's zero is longer than its nominal length
    #[arg(long, value_parser = amounts::length, allow_hyphen_values = true, value_name = "LENGTH", help_heading = "Set-up")]
    pub length_error: Option<f64>,
    /// Reading at zero, with its unit (displacement, joint); the header declares it unknown
    #[arg(long, allow_hyphen_values = true, value_name = "AMOUNT", help_heading = "Set-up")]
    pub zero: Option<String>,
    /// Standard uncertainty that the header states, with its unit
    #[arg(long, value_name = "AMOUNT", help_heading = "Set-up")]
    pub sigma: Option<String>,

    /// Recording; several of one call are numbered, REC_1.csv, REC_2.csv
    #[arg(short, long, value_name = "REC.csv", help_heading = "Output")]
    pub output: Output,
    /// The commands as an NC program as well
    #[arg(long, value_name = "OUT.nc", help_heading = "Output")]
    pub nc: Option<Output>,
    /// The machine with its constant deviations as a calibrated file as well
    #[arg(long, value_name = "TRUTH.ron", help_heading = "Output")]
    pub truth: Option<Output>,
    /// Units of commands
    #[arg(long, default_value = "mm,deg", value_parser = amounts::units, value_name = "LENGTH,ANGLE", help_heading = "Output")]
    pub units: FileUnits,
    /// Units of what is measured
    #[arg(long, default_value = "mm,deg", value_parser = amounts::units, value_name = "LENGTH,ANGLE", help_heading = "Output")]
    pub measured_units: FileUnits,
    /// No column t
    #[arg(long, help_heading = "Output")]
    pub no_time: bool,
    #[command(flatten)]
    pub common: Common,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub(crate) enum Test {
    Ak1,
    Ak2,
    Ak4,
    Bk1,
    Bk2,
    Bk4,
    Ck1,
    Ck2,
    Ck4,
    Rotary,
    Cone,
    Circle,
    Poses,
    Program,
    Path,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub(crate) enum OnOff {
    On,
    Off,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub(crate) enum BarDirection {
    Radial,
    Tangential,
    Axial,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub(crate) enum Sense {
    Both,
    Positive,
    Negative,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub(crate) enum Measure {
    /// Column d: distance minus nominal length, a ballbar
    Distance,
    /// Column r: the distance itself, a draw-wire or laser tracer
    AbsoluteDistance,
    /// Columns px py pz
    Position,
    /// Columns px py pz rx ry rz
    Pose,
    /// Column s: movement along --direction
    Displacement,
    /// Column JOINT_meas: one joint (--joint)
    Joint,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub(crate) enum DropAs {
    Empty,
    Nan,
}

/// What sort of test it is, for options that only some tests have a use for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Sort {
    Rotary,
    Cone,
    Circle,
    Poses,
    Program,
    Path,
}

impl Test {
    pub fn sort(self) -> Sort {
        match self {
            Test::Ak4 | Test::Bk4 | Test::Ck4 | Test::Cone => Sort::Cone,
            Test::Circle => Sort::Circle,
            Test::Poses => Sort::Poses,
            Test::Program => Sort::Program,
            Test::Path => Sort::Path,
            _ => Sort::Rotary,
        }
    }

    /// As it is written.
    pub fn word(self) -> String {
        let word = self.to_possible_value().map_or(String::new(), |value| value.get_name().to_string());
        if word.len() == 3 { word.to_uppercase() } else { word }
    }
}

impl Args {
    /// The first option given that this test has no use for.
    pub fn useless(&self) -> Option<&'static str> {
        use Sort::*;
        let sort = self.test.sort();
        let turning = [Rotary, Cone, Circle];
        let given: [(&'static str, bool, &[Sort]); 27] = [
            ("--input", self.input.is_some(), &[Program, Path]),
            ("--height", !self.height.is_empty(), &turning),
            ("--half-apex", self.half_apex.is_some(), &[Cone]),
            ("--inclination", self.inclination.is_some(), &[Cone]),
            ("--lead", self.lead.is_some(), &[Cone]),
            ("--reverse-rotary", self.reverse_rotary, &[Cone]),
            ("--tcp", self.tcp.is_some(), &[Cone, Program]),
            ("--axis", self.axis.is_some() && self.test != Test::Rotary, &[]),
            ("--bar", self.bar.is_some(), &[Rotary]),
            ("--bar-stands", self.bar_stands, &[Rotary]),
            ("--plane", !self.plane.is_empty(), &[Circle]),
            ("--normal", self.normal.is_some(), &[Circle]),
            ("--tool-axis", self.tool_axis.is_some(), &[Circle]),
            ("--count", self.count.is_some(), &[Poses]),
            ("--bar-decimals", self.bar_decimals.is_some(), &turning),
            ("--rotary-step", self.rotary_step.is_some(), &[Rotary, Cone]),
            ("--from", self.from.is_some(), &turning),
            ("--to", self.to.is_some(), &turning),
            ("--sense", self.sense.is_some(), &turning),
            ("--parts", self.parts.is_some(), &turning),
            ("--repeat", self.repeat.is_some(), &turning),
            ("--overshoot", self.overshoot.is_some(), &turning),
            ("--feed", !self.feed.is_empty(), &[Rotary, Cone, Circle, Program]),
            ("--acceleration", self.acceleration.is_some(), &[Rotary, Cone, Circle, Program]),
            ("--jerk", self.jerk.is_some(), &turning),
            ("--dwell", self.dwell.is_some(), &turning),
            ("--step", self.step.is_some(), &turning),
        ];
        let of_program = [
            ("--rapid", self.rapid.is_some()),
            ("--corner", self.corner.is_some()),
            ("--without-approach", self.without_approach),
        ];
        let hold = ("--hold", !self.hold.is_empty(), [Rotary, Cone, Circle, Program]);
        let useless = given.into_iter().find(|(_, given, sorts)| *given && !sorts.contains(&sort));
        useless
            .map(|(name, ..)| name)
            .or(of_program.into_iter().find(|(_, given)| *given && sort != Program).map(|(name, _)| name))
            .or((hold.1 && !hold.2.contains(&sort)).then_some(hold.0))
    }
}
