//! Types of messages as a bag describes them, and whether they are what is read here.
//!
//! Bytes of a message tell nothing of their meaning: a type of the same name with another field would be read as nonsense. So the text that
//! a bag has of each type must agree, field by field, with what [`message`](super::message) reads.

use std::collections::BTreeMap;

use super::definition::{Definition, Field, plain};
use super::{Fault, idl};

/// What is read, in the language of `.msg` files.
const READ: &str = "MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
===
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
===
MSG: sensor_msgs/JointState
std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
===
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
===
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
===
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
===
MSG: geometry_msgs/Pose
Point position
Quaternion orientation
===
MSG: geometry_msgs/PoseStamped
std_msgs/Header header
Pose pose
===
MSG: geometry_msgs/Transform
Vector3 translation
Quaternion rotation
===
MSG: geometry_msgs/TransformStamped
std_msgs/Header header
string child_frame_id
Transform transform
===
MSG: geometry_msgs/PoseWithCovariance
Pose pose
float64[36] covariance
===
MSG: geometry_msgs/Twist
Vector3 linear
Vector3 angular
===
MSG: geometry_msgs/TwistWithCovariance
Twist twist
float64[36] covariance
===
MSG: nav_msgs/Odometry
std_msgs/Header header
string child_frame_id
geometry_msgs/PoseWithCovariance pose
geometry_msgs/TwistWithCovariance twist
===
MSG: tf2_msgs/TFMessage
geometry_msgs/TransformStamped[] transforms";

/// The text of a type, as a bag has it.
pub(super) struct Schema<'a> {
    /// `sensor_msgs/msg/JointState`.
    pub name: &'a str,
    /// `ros2msg` or `ros2idl`.
    pub encoding: &'a str,
    pub text: &'a [u8],
}

impl Schema<'_> {
    /// Whether messages of this type are what is read under its name.
    ///
    /// # Errors
    /// [`Fault`] with the line of the text.
    pub fn check(&self) -> Result<(), Fault> {
        let Ok(text) = std::str::from_utf8(self.text) else {
            return Err(self.fault(0, "it is no UTF-8"));
        };
        let found = match self.encoding {
            "ros2msg" => of_msg(text, &plain(self.name)),
            "ros2idl" => idl::definitions(text),
            other => {
                return Err(
                    self.fault(0, &format!("it is written in `{other}`, not in `ros2msg` or `ros2idl`"))
                );
            }
        };
        let found = by_name(found.map_err(|(line, what)| self.fault(line, &what))?);
        let read = by_name(of_msg(READ, "").unwrap_or_default());
        self.compare(&plain(self.name), 0, &found, &read)
    }

    fn compare(&self, name: &str, line: usize, found: &Named, read: &Named) -> Result<(), Fault> {
        let Some(expected) = read.get(name) else { return Ok(()) };
        let Some(own) = found.get(name) else {
            // Writers know this one without a text.
            return match name {
                "builtin_interfaces/Time" => Ok(()),
                _ => Err(self.fault(line, &format!("there is no definition of `{name}`"))),
            };
        };
        for (i, field) in expected.fields.iter().enumerate() {
            let expects = format!("`{} {}`", field.kind, field.name);
            match own.fields.get(i) {
                Some(own) if (&own.kind, &own.name) == (&field.kind, &field.name) => {
                    self.compare(field.kind.trim_end_matches("[]"), own.line, found, read)?;
                }
                Some(own) => {
                    let what = format!("`{name}` has `{} {}` where {expects} is read", own.kind, own.name);
                    return Err(self.fault(own.line, &what));
                }
                None => return Err(self.fault(own.line, &format!("`{name}` has no {expects}"))),
            }
        }
        match own.fields.get(expected.fields.len()) {
            Some(more) => {
                let what = format!("`{name}` has `{} {}` besides what is read", more.kind, more.name);
                Err(self.fault(more.line, &what))
            }
            None => Ok(()),
        }
    }

    fn fault(&self, line: usize, what: &str) -> Fault {
        let line = if line > 0 { format!(", line {line}") } else { String::new() };
        let what = format!("the text of type `{}`{line}: {}", self.name, what);
        Fault::new(what, "publish it as the type that ROS 2 has under this name, and record it anew")
    }
}

type Named = BTreeMap<String, Definition>;

fn by_name(all: Vec<Definition>) -> Named {
    all.into_iter().map(|definition| (definition.name.clone(), definition)).collect()
}

/// Definitions of a text of `.msg` files: the first bears the name of the schema, the others their own, behind lines of `=`.
fn of_msg(text: &str, name: &str) -> Result<Vec<Definition>, (usize, String)> {
    let first = Definition { name: name.into(), line: 0, fields: Vec::new() };
    let mut all = vec![first];
    for (line, content) in (1..).zip(text.lines()) {
        let content = content.trim();
        if let Some(own) = content.strip_prefix("MSG:") {
            all.push(Definition { name: plain(own.trim()), line, fields: Vec::new() });
            continue;
        }
        let words: Vec<&str> = content.split('#').next().unwrap_or_default().split_whitespace().collect();
        let (kind, name, behind) = match words[..] {
            [] => continue,
            [bar] if bar.bytes().all(|b| b == b'=') => continue,
            [kind, name, ..] => (kind, name, words.get(2)),
            [word] => return Err((line, format!("`{}` is no field", crate::wording::shown(word)))),
        };
        // `int32 LARGEST=5` is no field, `float64 w 1` is one with a value to begin with.
        if name.contains('=') || behind.is_some_and(|word| word.starts_with('=')) {
            continue;
        }
        let Some(own) = all.last_mut() else { continue };
        let kind = of_package(kind, own.name.split('/').next().unwrap_or_default());
        own.fields.push(Field { kind, name: name.into(), line });
    }
    Ok(all)
}

const PRIMITIVE: [&str; 16] = [
    "bool", "byte", "char", "float32", "float64", "int8", "uint8", "int16", "uint16", "int32", "uint32",
    "int64", "uint64", "string", "wstring", "time",
];

/// A type as a field of this package has it, with the name of its package.
fn of_package(kind: &str, package: &str) -> String {
    let (base, list) = match kind.split_once('[') {
        Some((base, bound)) if bound.starts_with("<=") || bound == "]" => (base, "[]".to_string()),
        Some((base, length)) => (base, format!("[{length}")),
        None => (kind, String::new()),
    };
    let base = base.split("<=").next().unwrap_or_default();
    let base = match base {
        "Header" => "std_msgs/Header".to_string(),
        _ if PRIMITIVE.contains(&base) => base.to_string(),
        _ if base.contains('/') => plain(base),
        _ => format!("{package}/{base}"),
    };
    base + &list
}

#[cfg(test)]
mod tests {
    use super::*;

    const JOINT_STATE: &str = "# The state of joints.\n#\nstd_msgs/Header header\n\nstring[] name # in order\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n\
        ================================================================================\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n\
        ================================================================================\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n";

    fn check(text: &str) -> Result<(), String> {
        let schema =
            Schema { name: "sensor_msgs/msg/JointState", encoding: "ros2msg", text: text.as_bytes() };
        schema.check().map_err(|fault| fault.what)
    }

    #[test]
    fn a_type_that_differs_in_one_field_is_refused_with_its_line() {
        assert_eq!(check(JOINT_STATE), Ok(()));
        for (from, to, says) in [
            (
                "float64[] position",
                "float32[] position",
                "line 6: `sensor_msgs/JointState` has `float32[] position` where `float64[] position` is read",
            ),
            ("float64[] effort\n", "", "`sensor_msgs/JointState` has no `float64[] effort`"),
            (
                "float64[] effort",
                "float64[] effort\nint32[] mode",
                "line 9: `sensor_msgs/JointState` has `int32[] mode` besides what is read",
            ),
            (
                "string frame_id",
                "uint32 seq",
                "line 12: `std_msgs/Header` has `uint32 seq` where `string frame_id` is read",
            ),
            (
                "MSG: std_msgs/Header",
                "MSG: std_msgs/Other",
                "line 3: there is no definition of `std_msgs/Header`",
            ),
            ("string[] name", "name", "line 5: `name` is no field"),
        ] {
            let said = check(&JOINT_STATE.replace(from, to)).expect_err(to);
            assert_eq!(
                said,
                format!(
                    "the text of type `sensor_msgs/msg/JointState`{}{says}",
                    if says.starts_with("line") { ", " } else { ": " }
                ),
                "{to}"
            );
        }
        // The same type in other words.
        for (from, to) in [
            ("float64[] effort", "float64[<=8] effort"),
            ("std_msgs/Header header", "Header header"),
            ("std_msgs/Header", "std_msgs/msg/Header"),
            ("string frame_id", "int32 MOST=5\nstring KIND = \"a # b\"\nstring<=9 frame_id \"base\""),
        ] {
            assert_eq!(check(&JOINT_STATE.replace(from, to)), Ok(()), "{to}");
        }
    }

    #[test]
    fn what_is_read_has_a_definition_of_all_that_it_names() {
        let read = by_name(of_msg(READ, "").expect("sound"));
        let primitive = |kind: &str| PRIMITIVE.contains(&kind.split('[').next().unwrap_or_default());
        for field in read.values().flat_map(|own| &own.fields).filter(|own| !primitive(&own.kind)) {
            assert!(read.contains_key(field.kind.trim_end_matches("[]")), "{}", field.kind);
        }
    }
}
