"""Bags of ROS 2, as Foxglove's writer writes them and as the folder of the library's tests has them."""

from pathlib import Path
from typing import Any

import kincal
import numpy as np
import pytest
from conftest import MACHINES, CommandLine, columns_of

BAGS = MACHINES.parent / "tests" / "rosbag"
BAD = MACHINES.parent / "tests" / "bad" / "rosbags"
BAR = "=" * 80
HEADER = (
    f"{BAR}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
    f"{BAR}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
)
JOINT_STATE = "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n" + HEADER
POSE_STAMPED = (
    "std_msgs/Header header\nPose pose\n" + HEADER + f"{BAR}\nMSG: geometry_msgs/Pose\nPoint position\nQuaternion orientation\n"
    f"{BAR}\nMSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n"
    f"{BAR}\nMSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
)
ZERO = 1_709_644_368_000_000_000
JOINTS = ["q1", "q2", "q3", "q4"]


@pytest.mark.parametrize("name", ["pose_zstd", "transform_lz4", "odometry_big_endian", "idl_without_chunks", "two_senders"])
def test_a_bag_is_the_recording_of_its_motion(command: CommandLine, name: str) -> None:
    command.json("convert", BAGS / f"{name}.mcap", "--machine", MACHINES / "scara.ron", "-o", "bag.csv")
    (found, head), (expected, same) = columns_of(command.folder / "bag.csv"), columns_of(BAGS / "expected.csv")
    assert head == same and list(found) == list(expected)
    assert all(np.abs(found[name] - expected[name]).max() < 2e-15 for name in expected)


@pytest.mark.parametrize("name", ["several_poses", "single_precision", "other_clock", "changed"])
def test_what_is_at_fault_is_told_with_the_mend(command: CommandLine, name: str) -> None:
    bag = BAD / f"{name}.mcap"
    done = command.run("convert", bag, "--machine", MACHINES / "scara.ron", "-o", "none.csv")
    lines = done.stderr.splitlines()
    assert done.returncode == 1 and lines[0].startswith(f"error: {bag}: ") and lines[-1].startswith("  = ")
    assert not (command.folder / "none.csv").exists()


def way(s: Any) -> list[Any]:
    """Joints of the arm, rad and m, after so many seconds."""
    return [0.9 * np.sin(0.8 * s), 1.1 * np.sin(0.5 * s + 1), 0.1 + 0.06 * np.cos(0.7 * s), 1.5 * np.sin(0.3 * s)]


def test_an_arm_in_a_bag_is_calibrated_as_from_its_recording(command: CommandLine) -> None:
    """A tracker sees a moving arm at 10 Hz, joint states come at 250 Hz and at other moments."""
    writer: Any = pytest.importorskip("mcap_ros2.writer", reason="pip install mcap-ros2-support")
    scara = MACHINES / "scara.ron"
    s = np.arange(250) * 0.1
    rows = [",".join(f"{x!r}" for x in row) for row in np.column_stack([s, *way(s + 0.1)]).tolist()]
    names = "t[s],q1[rad],q2[rad],q3[m],q4[rad]"
    (command.folder / "way.csv").write_text("\n".join([names, *rows]) + "\n")
    test = ["--test", "path", "--input", "way.csv", "--measure", "pose", "--noise", "10um", "--noise-angle", "20urad", "--random", "3"]
    command.json("simulate", scara, *test, "-o", "seen.csv")
    seen, _ = columns_of(command.folder / "seen.csv")

    def column(name: str) -> Any:
        key = next(key for key in seen if key.split("[")[0] == name)
        return seen[key] * {"mm": 1e-3, "deg": np.pi / 180}.get(key.split("[")[1].rstrip("]"), 1.0)

    turn = np.column_stack([column(name) for name in ("rx", "ry", "rz")])
    half = np.linalg.norm(turn, axis=1) / 2
    turns = [*(turn * (np.sinc(half / np.pi) / 2)[:, None]).T, np.cos(half)]

    def stamp(at: float) -> dict[str, int]:
        ns = ZERO + round(at * 1e9)
        return {"sec": ns // 1_000_000_000, "nanosec": ns % 1_000_000_000}

    bag = command.folder / "arm.mcap"
    with bag.open("wb") as file:
        out = writer.Writer(file)
        joints = out.register_msgdef("sensor_msgs/msg/JointState", JOINT_STATE)
        poses = out.register_msgdef("geometry_msgs/msg/PoseStamped", POSE_STAMPED)
        for at in np.arange(6300) * 0.004 - 0.0013:
            position = [float(q) for q in way(at + 0.1)]
            message = {"header": {"stamp": stamp(at), "frame_id": ""}, "name": JOINTS, "position": position}
            out.write_message("/joint_states", joints, {**message, "velocity": [], "effort": []}, log_time=ZERO + round(at * 1e9))
        for row in zip(column("t"), column("px"), column("py"), column("pz"), *turns):
            at, x, y, z, i, j, k, w = (float(number) for number in row)
            pose = {"position": {"x": x, "y": y, "z": z}, "orientation": {"x": i, "y": j, "z": k, "w": w}}
            # The tracker's computer is late by 40 ms, and says when it measured.
            message = {"header": {"stamp": stamp(at), "frame_id": "tracker"}, "pose": pose}
            out.write_message("/tracker/arm", poses, message, log_time=ZERO + round((at + 0.04) * 1e9))
        out.finish()
    told = command.json("convert", bag, "--machine", scara, "-o", "arm.csv")
    assert told["recordings"][0]["rows"] == len(s), told["told"]
    machine = kincal.load_machine(scara)
    (_, direct), (_, of_bag) = (kincal.calibrate(machine, command.folder / name) for name in ("seen.csv", "arm.csv"))
    # Lines over 4 ms are off by less than 2 um and rad of the motion's bends; the noise is 10 um.
    assert abs(of_bag["rms_m"]["geometric"] / direct["rms_m"]["geometric"] - 1) < 0.02
    for a, b in zip(direct["parameters"], of_bag["parameters"]):
        assert a["frame"] == b["frame"] and abs(a["value"] - b["value"]) < 0.5 * max(a["std_error"], 1e-7), (a, b)
