"""Writes the bags of this folder and of tests/bad/rosbags with the writers of Foxglove, as a recorder of ROS 2 does.

    pip install mcap mcap-ros2-support && python tests/rosbag/make.py

Every bag of this folder holds the motion of `expected.csv`: joints that move evenly, so that lines between joint states are exact, and a
target seen at other stamps. It differs in types, compression, order of bytes and the language of its types.
"""

import math
import pathlib
import struct

from mcap.writer import CompressionType
from mcap.writer import Writer as PlainWriter
from mcap_ros2._dynamic import serialize_dynamic

HERE = pathlib.Path(__file__).parent
TOLD = HERE / "told"
BAD = HERE.parent / "bad" / "rosbags"
BAR = "=" * 80

TIME = "int32 sec\nuint32 nanosec\n"
HEADER = "# Standard metadata for higher-level stamped data types.\nbuiltin_interfaces/Time stamp\n\n# Transform frame\nstring frame_id\n"
POINT = "float64 x\nfloat64 y\nfloat64 z\n"
QUATERNION = "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n"
POSE = "# A representation of pose in free space.\nPoint position\nQuaternion orientation\n"
TRANSFORM = "Vector3 translation\nQuaternion rotation\n"
TRANSFORM_STAMPED = "std_msgs/Header header\n\n# The frame id of the child.\nstring child_frame_id\nTransform transform\n"
PARTS = {
    "std_msgs/Header": HEADER,
    "builtin_interfaces/Time": TIME,
    "geometry_msgs/Point": POINT,
    "geometry_msgs/Vector3": POINT,
    "geometry_msgs/Quaternion": QUATERNION,
    "geometry_msgs/Pose": POSE,
    "geometry_msgs/Transform": TRANSFORM,
    "geometry_msgs/TransformStamped": TRANSFORM_STAMPED,
    "geometry_msgs/PoseWithCovariance": "Pose pose\n\n# Row-major representation of the 6x6 covariance matrix\nfloat64[36] covariance\n",
    "geometry_msgs/TwistWithCovariance": "Twist twist\nfloat64[36] covariance\n",
    "geometry_msgs/Twist": "Vector3  linear\nVector3  angular\n",
}
JOINT_STATE = "# The state of a set of joints.\nstd_msgs/Header header\n\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n"


def text_of(body: str, *parts: str) -> str:
    return body + "".join(f"{BAR}\nMSG: {part}\n{PARTS[part]}" for part in parts)


HEAD = ("std_msgs/Header", "builtin_interfaces/Time")
TYPES = {
    "sensor_msgs/msg/JointState": text_of(JOINT_STATE, *HEAD),
    "geometry_msgs/msg/PoseStamped": text_of(
        "std_msgs/Header header\nPose pose\n", *HEAD, "geometry_msgs/Pose", "geometry_msgs/Point", "geometry_msgs/Quaternion"
    ),
    "geometry_msgs/msg/TransformStamped": text_of(
        TRANSFORM_STAMPED, *HEAD, "geometry_msgs/Transform", "geometry_msgs/Vector3", "geometry_msgs/Quaternion"
    ),
    "nav_msgs/msg/Odometry": text_of(
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\ngeometry_msgs/TwistWithCovariance twist\n",
        *HEAD, "geometry_msgs/PoseWithCovariance", "geometry_msgs/Pose", "geometry_msgs/Point", "geometry_msgs/Quaternion",
        "geometry_msgs/TwistWithCovariance", "geometry_msgs/Twist", "geometry_msgs/Vector3",
    ),
    "tf2_msgs/msg/TFMessage": text_of(
        "geometry_msgs/TransformStamped[] transforms\n",
        "geometry_msgs/TransformStamped", *HEAD, "geometry_msgs/Transform", "geometry_msgs/Vector3", "geometry_msgs/Quaternion",
    ),
    "std_msgs/msg/String": "string data\n",
}

IDL = {
    "sensor_msgs/msg/JointState": (
        '#include "std_msgs/msg/Header.idl"\n\nmodule sensor_msgs {\n  module msg {\n    @verbatim (language="comment", text=\n'
        '      "The state of a set of joints (revolute or \\"prismatic\\"; all)." "\\n"\n      "Units: rad, m")\n    struct JointState {\n'
        "      std_msgs::msg::Header header;\n\n      sequence<string> name;\n\n      sequence<double> position;\n\n"
        "      sequence<double> velocity;\n\n      sequence<double> effort;\n    };\n  };\n};\n"
    ),
    "geometry_msgs/msg/PoseStamped": (
        "module geometry_msgs {\n  module msg {\n    struct PoseStamped {\n      std_msgs::msg::Header header;\n"
        "      geometry_msgs::msg::Pose pose;\n    };\n  };\n};\n"
    ),
    "std_msgs/msg/Header": (
        "module std_msgs {\n  module msg {\n    struct Header {\n      builtin_interfaces::msg::Time stamp;\n      string frame_id;\n    };\n  };\n};\n"
    ),
    "builtin_interfaces/msg/Time": (
        "module builtin_interfaces {\n  module msg {\n    struct Time {\n      int32 sec;\n      uint32 nanosec;\n    };\n  };\n};\n"
    ),
    "geometry_msgs/msg/Pose": (
        "module geometry_msgs {\n  module msg {\n    struct Pose {\n      geometry_msgs::msg::Point position;\n"
        "      geometry_msgs::msg::Quaternion orientation;\n    };\n  };\n};\n"
    ),
    "geometry_msgs/msg/Point": "module geometry_msgs { module msg { struct Point { double x; double y; double z; }; }; };\n",
    "geometry_msgs/msg/Quaternion": (
        'module geometry_msgs {\n  module msg {\n    struct Quaternion {\n      @default (value=0.0)\n      double x;\n'
        "      @default (value=0.0)\n      double y;\n      @default (value=0.0)\n      double z;\n      @default (value=1.0)\n      double w;\n    };\n  };\n};\n"
    ),
}


def idl_of(*names: str) -> str:
    return f"{BAR}\n".join(f"IDL: {name}\n{IDL[name]}" for name in names)


IDL_TYPES = {
    "sensor_msgs/msg/JointState": idl_of("sensor_msgs/msg/JointState", "std_msgs/msg/Header", "builtin_interfaces/msg/Time"),
    "geometry_msgs/msg/PoseStamped": idl_of(
        "geometry_msgs/msg/PoseStamped", "std_msgs/msg/Header", "builtin_interfaces/msg/Time", "geometry_msgs/msg/Pose",
        "geometry_msgs/msg/Point", "geometry_msgs/msg/Quaternion",
    ),
}

# The motion. Stamps are ns; joints move evenly, the target on a circle.
ZERO = 1_709_644_368_000_000_000
JOINTS = ["q4", "gripper", "q1", "q3", "q2"]
JOINT_STAMPS = [ZERO + 50_000_000 * i + (i * 7919) % 1_000_003 for i in range(41)]
POSE_STAMPS = [ZERO - 20_000_000 + 130_000_000 * i for i in range(17)]


def positions(at: int) -> list[float]:
    s = (at - ZERO) * 1e-9
    return [0.1 - 0.05 * s, 0.02, -0.5 + 0.75 * s, 0.02 + 0.03 * s, 1.0 - 0.25 * s]


def pose(at: int) -> tuple[list[float], list[float]]:
    """Position, and quaternion x y z w."""
    s = (at - ZERO) * 1e-9
    return [math.cos(s), math.sin(s), 0.3 + 0.01 * s], [0.0, 0.0, math.sin(s / 2), math.cos(s / 2)]


def times(a: list[float], b: list[float]) -> list[float]:
    (x, y, z, w), (i, j, k, r) = a, b
    return [
        w * i + x * r + y * k - z * j,
        w * j - x * k + y * r + z * i,
        w * k + x * j - y * i + z * r,
        w * r - x * i - y * j - z * k,
    ]


def turned(q: list[float], v: list[float]) -> list[float]:
    back = [-q[0], -q[1], -q[2], q[3]]
    return times(times(q, [*v, 0.0]), back)[:3]


Pose = tuple[list[float], list[float]]


def after(a: Pose, b: Pose) -> Pose:
    """The pose `b` of a frame whose own pose is `a`."""
    return [u + v for u, v in zip(a[0], turned(a[1], b[0]))], times(a[1], b[1])


def inverse(a: Pose) -> Pose:
    back = [-a[1][0], -a[1][1], -a[1][2], a[1][3]]
    return [-x for x in turned(back, a[0])], back


def header(at: int, frame: str) -> dict:
    return {"stamp": {"sec": at // 1_000_000_000, "nanosec": at % 1_000_000_000}, "frame_id": frame}


def point(v: list[float]) -> dict:
    return dict(zip("xyz", v))


def quaternion(q: list[float]) -> dict:
    return dict(zip("xyzw", q))


def joint_state(at: int, names: list[str] = JOINTS, values: list[float] | None = None) -> dict:
    values = positions(at) if values is None else values
    return {"header": header(at, ""), "name": names, "position": values, "velocity": [], "effort": [0.5] * len(names)}


def pose_stamped(at: int, frame: str = "tracker", of: Pose | None = None) -> dict:
    p, q = of or pose(at)
    return {"header": header(at, frame), "pose": {"position": point(p), "orientation": quaternion(q)}}


def transform(at: int, frame: str, child: str, of: Pose) -> dict:
    return {
        "header": header(at, frame),
        "child_frame_id": child,
        "transform": {"translation": point(of[0]), "rotation": quaternion(of[1])},
    }


def odometry(at: int) -> dict:
    zero = point([0.0] * 3)
    return {
        "header": header(at, "tracker"),
        "child_frame_id": "ball",
        "pose": {"pose": pose_stamped(at)["pose"], "covariance": [0.25] * 36},
        "twist": {"twist": {"linear": zero, "angular": zero}, "covariance": [0.0] * 36},
    }


class Big:
    """CDR with the most significant byte first, which no writer of today makes."""

    def __init__(self) -> None:
        self.bytes = bytearray()

    def number(self, form: str, value: float) -> None:
        self.bytes += bytes(-len(self.bytes) % struct.calcsize(form)) + struct.pack(">" + form, value)

    def text(self, text: str) -> None:
        self.number("I", len(text) + 1)
        self.bytes += text.encode() + b"\0"

    def header(self, of: dict) -> None:
        self.number("i", of["stamp"]["sec"])
        self.number("I", of["stamp"]["nanosec"])
        self.text(of["frame_id"])

    def whole(self) -> bytes:
        return b"\0\0\0\0" + bytes(self.bytes)


def big_joint_state(of: dict) -> bytes:
    big = Big()
    big.header(of["header"])
    big.number("I", len(of["name"]))
    for name in of["name"]:
        big.text(name)
    for key in ("position", "velocity", "effort"):
        big.number("I", len(of[key]))
        for x in of[key]:
            big.number("d", x)
    return big.whole()


def big_odometry(of: dict) -> bytes:
    big = Big()
    big.header(of["header"])
    big.text(of["child_frame_id"])
    inner = of["pose"]["pose"]
    numbers = [inner["position"][c] for c in "xyz"] + [inner["orientation"][c] for c in "xyzw"]
    for x in numbers + of["pose"]["covariance"] + [0.0] * 42:
        big.number("d", x)
    return big.whole()


class Bag:
    """Messages with their types, written at last in the order in which they were logged."""

    def __init__(self, path: pathlib.Path, types: dict[str, str] = TYPES, language: str = "ros2msg", **how: object) -> None:
        how = {"compression": CompressionType.ZSTD, "chunk_size": 4096, **how}
        self.file = path.open("wb")
        self.writer = PlainWriter(self.file, **how)
        self.writer.start(profile="ros2", library="make.py")
        self.types, self.language = types, language
        self.schemas: dict[str, int] = {}
        self.channels: dict[str, int] = {}
        self.log: list[tuple[int, str, str, bytes]] = []

    def put(self, topic: str, kind: str, at: int, message: dict | bytes, late: int = 3_000_000) -> None:
        if isinstance(message, dict):
            # Encoders need the texts of `.msg` files, whatever stands in the bag.
            message = serialize_dynamic(kind, self.types[kind] if self.language == "ros2msg" else TYPES[kind])[kind](message)
        self.log.append((at + late, topic, kind, bytes(message)))

    def joints(self, topic: str = "/joint_states", stamps: list[int] = JOINT_STAMPS, **of: object) -> "Bag":
        for at in stamps:
            self.put(topic, "sensor_msgs/msg/JointState", at, joint_state(at, **of))
        return self

    def poses(self, topic: str = "/tracker/pose", stamps: list[int] = POSE_STAMPS, **of: object) -> "Bag":
        for at in stamps:
            self.put(topic, "geometry_msgs/msg/PoseStamped", at, pose_stamped(at, **of))
        return self

    def done(self) -> None:
        for at, topic, kind, data in sorted(self.log, key=lambda entry: entry[0]):
            if kind not in self.schemas:
                self.schemas[kind] = self.writer.register_schema(kind, self.language, self.types[kind].encode())
            if topic not in self.channels:
                self.channels[topic] = self.writer.register_channel(topic, "cdr", self.schemas[kind])
            self.writer.add_message(self.channels[topic], at, data, at)
        self.writer.finish()
        self.file.close()


def good() -> None:
    # A type that nothing reads beside those that are.
    bag = Bag(HERE / "pose_zstd.mcap", compression=CompressionType.ZSTD).joints().poses()
    bag.put("/rosout", "std_msgs/msg/String", ZERO, {"data": "hello"})
    bag.done()

    # What `ros2 bag record --max-bag-duration` leaves. Each file has its own numbers of topics.
    folder = HERE / "split" / "run"
    folder.mkdir(parents=True, exist_ok=True)
    ends = [POSE_STAMPS[0] - 1, POSE_STAMPS[6] - 1, POSE_STAMPS[11] - 1, JOINT_STAMPS[-1] + POSE_STAMPS[-1]]
    names = [f"run_{number}.mcap" for number in range(3)]
    for name, begin, end in zip(names, ends, ends[1:]):
        def within(stamps: list[int]) -> list[int]:
            return [at for at in stamps if begin < at <= end]
        Bag(folder / name).joints(stamps=within(JOINT_STAMPS)).poses(stamps=within(POSE_STAMPS)).done()
    paths = "".join(f"    - {name}\n" for name in names)
    (folder / "metadata.yaml").write_text(
        f"rosbag2_bagfile_information:\n  version: 9\n  storage_identifier: mcap\n  relative_file_paths:\n{paths}"
    )

    bag = Bag(HERE / "transform_lz4.mcap", compression=CompressionType.LZ4).joints()
    for at in POSE_STAMPS:
        # Slashes before frames, as long ago; some messages come late.
        late = 90_000_000 if at % 3 == 0 else 1_000_000
        bag.put("/vicon/ball", "geometry_msgs/msg/TransformStamped", at, transform(at, "/tracker", "/ball", pose(at)), late)
    bag.done()

    bag = Bag(HERE / "odometry_big_endian.mcap", compression=CompressionType.ZSTD)
    for at in JOINT_STAMPS:
        bag.put("/joint_states", "sensor_msgs/msg/JointState", at, big_joint_state(joint_state(at)))
    for at in POSE_STAMPS:
        bag.put("/odom", "nav_msgs/msg/Odometry", at, big_odometry(odometry(at)))
    bag.done()

    bag = Bag(HERE / "odometry.mcap", compression=CompressionType.LZ4).joints()
    for at in POSE_STAMPS:
        bag.put("/odom", "nav_msgs/msg/Odometry", at, odometry(at))
    bag.done()

    # The ball is seen by a camera on the wall, asked for in the frame `tracker`.
    turn = [0.5, -0.5, 0.5, 0.5]
    wall, camera = ([2.0, -1.0, 0.5], turn), ([0.1, 0.2, -0.3], [0.0, 0.6, 0.0, 0.8])
    bag = Bag(HERE / "frames.mcap", compression=CompressionType.ZSTD).joints()
    fixed = [transform(0, "world", "tracker", wall), transform(0, "world", "camera", camera)]
    bag.put("/tf_static", "tf2_msgs/msg/TFMessage", ZERO - 500_000_000, {"transforms": fixed})
    for at in POSE_STAMPS:
        seen = after(inverse(camera), after(wall, pose(at)))
        others = [transform(at, "world", "person", pose(at))]
        bag.put("/tf", "tf2_msgs/msg/TFMessage", at, {"transforms": [transform(at, "camera", "ball", seen), *others]})
    bag.done()

    Bag(HERE / "idl_without_chunks.mcap", IDL_TYPES, "ros2idl", compression=CompressionType.NONE, use_chunking=False).joints().poses().done()

    # Two senders, each with its own joints.
    bag = Bag(HERE / "two_senders.mcap", compression=CompressionType.ZSTD).poses()
    for at in JOINT_STAMPS:
        values = dict(zip(JOINTS, positions(at)))
        for names, late in ((["q1", "q2"], 1_000_000), (["q4", "q3", "gripper"], 9_000_000)):
            bag.put("/joint_states", "sensor_msgs/msg/JointState", at, joint_state(at, names, [values[n] for n in names]), late)
    bag.done()

    # What is dropped, and told.
    TOLD.mkdir(exist_ok=True)
    Bag(TOLD / "gap.mcap").joints(stamps=[at for at in JOINT_STAMPS if not 0.4e9 < at - ZERO < 0.9e9]).poses().done()
    bag = Bag(TOLD / "out_of_sight.mcap").joints()
    for i, at in enumerate(POSE_STAMPS):
        seen = pose(at) if i % 4 else ([0.0] * 3, [0.0] * 4)
        bag.put("/tracker/pose", "geometry_msgs/msg/PoseStamped", at, pose_stamped(at, of=seen))
    bag.done()
    bag = Bag(TOLD / "turns_over.mcap").poses()
    for at in JOINT_STAMPS:
        # Joint q1 passes half a turn after 0.9 s, q2 swings.
        s = (at - ZERO) * 1e-9
        of = positions(at)
        of[2] = (math.pi + 3.0 * (s - 0.9) + math.pi) % (2 * math.pi) - math.pi
        of[4] = math.sin(3.0 * s)
        bag.put("/joint_states", "sensor_msgs/msg/JointState", at, joint_state(at, values=of))
    bag.done()
    bag = Bag(TOLD / "two_links_move.mcap").joints()
    for at in POSE_STAMPS:
        bag.put("/tf", "tf2_msgs/msg/TFMessage", at, {"transforms": [transform(at, "tracker", "ball", pose(at))]})
    for at in JOINT_STAMPS:
        bag.put("/tf", "tf2_msgs/msg/TFMessage", at, {"transforms": [transform(at, "world", "tracker", ([0.0, 0.0, (at - ZERO) * 1e-9], [0.0, 0.0, 0.0, 1.0]))]})
    bag.done()
    bag = Bag(TOLD / "a_gripper_beside.mcap").joints().poses()
    bag.joints("/gripper/joint_states", JOINT_STAMPS[:3], names=["left"], values=[0.01]).joints(stamps=JOINT_STAMPS[:2]).done()

    inside = [at for at in POSE_STAMPS if JOINT_STAMPS[0] <= at <= JOINT_STAMPS[-1]]
    lines = ["# machine: scara", "# measurement: pose", "t[s],q1[rad],q2[rad],q3[m],q4[rad],px[m],py[m],pz[m],qw[1],qx[1],qy[1],qz[1]"]
    for at in inside:
        of = dict(zip(JOINTS, positions(at)))
        p, q = pose(at)
        numbers = [(at - POSE_STAMPS[0]) / 1e9, of["q1"], of["q2"], of["q3"], of["q4"], *p, q[3], *q[:3]]
        lines.append(",".join(repr(x) for x in numbers))
    (HERE / "expected.csv").write_text("\n".join(lines) + "\n")


def bad() -> None:
    BAD.mkdir(exist_ok=True)
    with_type = lambda body: {**TYPES, "sensor_msgs/msg/JointState": text_of(body, *HEAD)}
    Bag(BAD / "single_precision.mcap", with_type(JOINT_STATE.replace("float64[] position", "float32[] position"))).joints().poses().done()
    Bag(BAD / "no_joints.mcap").poses().done()
    Bag(BAD / "no_poses.mcap").joints().done()
    Bag(BAD / "no_messages.mcap").done()
    bag = Bag(BAD / "several_poses.mcap").joints().joints("/gripper/joint_states", JOINT_STAMPS[:3], names=["left", "right"], values=[0.0, 0.1])
    bag.poses("/tracker/base", POSE_STAMPS[:3]).poses("/tracker/tool")
    for at in POSE_STAMPS[:3]:
        bag.put("/tf", "tf2_msgs/msg/TFMessage", at, {"transforms": [transform(at, "world", "tool0", pose(at))]})
    bag.done()
    Bag(BAD / "several_joints.mcap").joints("/a/joint_states").joints("/b/joint_states").poses().done()
    Bag(BAD / "other_clock.mcap").joints().poses(stamps=[at - ZERO + 5_000_000_000 for at in POSE_STAMPS]).done()
    bag = Bag(BAD / "clock_set_back.mcap").poses()
    for i, at in enumerate(JOINT_STAMPS):
        at -= 0 if i < 20 else 5_000_000_000
        bag.put("/joint_states", "sensor_msgs/msg/JointState", at, joint_state(at), 0 if i < 20 else 5_100_000_000)
    bag.done()
    Bag(BAD / "too_few_positions.mcap").joints(values=[0.1, 0.2]).poses().done()
    Bag(BAD / "names_of_other_joints.mcap").joints(names=["a", "b", "c", "d", "e"]).poses().done()
    bag = Bag(BAD / "frame_changes.mcap").joints().poses(stamps=POSE_STAMPS[:4])
    bag.poses(stamps=POSE_STAMPS[4:], frame="map").done()
    bag = Bag(BAD / "message_cut.mcap").poses()
    bag.put("/joint_states", "sensor_msgs/msg/JointState", ZERO, serialize_dynamic("sensor_msgs/msg/JointState", TYPES["sensor_msgs/msg/JointState"])["sensor_msgs/msg/JointState"](joint_state(ZERO))[:60])
    bag.done()
    bag = Bag(BAD / "parameter_list.mcap").poses()
    bag.put("/joint_states", "sensor_msgs/msg/JointState", ZERO, b"\0\3\0\0" + bytes(60))
    bag.done()
    lost = ([0.0] * 3, [0.0] * 4)
    Bag(BAD / "never_seen.mcap").joints().poses(of=lost).done()

    whole = bytearray((HERE / "pose_zstd.mcap").read_bytes())
    at = whole.index(b"zstd")
    whole[at + 60] ^= 0x10
    (BAD / "changed.mcap").write_bytes(whole)
    whole = (HERE / "pose_zstd.mcap").read_bytes()
    (BAD / "compressed_otherwise.mcap").write_bytes(whole.replace(b"zstd", b"zpaq"))
    (BAD / "cut_at_once.mcap").write_bytes(whole[:40])
    (BAD / "only_beginning.mcap").write_bytes(whole[:200] + b"\0\1" + whole[200:])
    plain = (HERE / "idl_without_chunks.mcap").read_bytes()
    (BAD / "no_record.mcap").write_bytes(plain[:1500] + plain[1507:])
    # Bags that are not MCAP.
    (BAD / "first.bag").write_bytes(b"#ROSBAG V2.0\n" + bytes(32))
    (BAD / "bag_0.db3").write_bytes(b"SQLite format 3\0" + bytes(32))


good()
bad()
