"""What is wrong is told as the command line tells it, and long work leaves Python free."""

import threading
from pathlib import Path
from typing import Any

import kincal
import numpy as np
import pytest
from conftest import MACHINES, CommandLine


@pytest.fixture
def scara() -> kincal.Machine:
    return kincal.load_machine(MACHINES / "scara.ron")


def test_a_message_is_that_of_the_command_with_place_and_mend(
    command: CommandLine, tracked: Path, scara: kincal.Machine
) -> None:
    wrong = command.folder / "wrong.csv"
    wrong.write_text(tracked.read_text().replace("q2[deg]", "q2[mm]"))
    done = command.run("calibrate", MACHINES / "scara.ron", wrong)
    with pytest.raises(kincal.Error) as told:
        kincal.calibrate(scara, wrong)
    error = told.value
    assert done.returncode == 1 and done.stderr == f"error: {error}\n"
    assert error.file == str(wrong) and error.line > 0 and error.column > 0
    assert str(error) == f"{error.what}\n  = {error.mend}" and error.mend.startswith("write one of")


def test_a_machine_file_is_told_with_line_and_column(command: CommandLine) -> None:
    path = command.folder / "wrong.ron"
    path.write_text((MACHINES / "scara.ron").read_text().replace('axis: "z"', 'axis: "u"', 1))
    done = command.run("describe", path)
    with pytest.raises(kincal.Error) as told:
        kincal.load_machine(path)
    first, mend = done.stderr.splitlines()[0], done.stderr.splitlines()[-1]
    assert str(told.value).splitlines() == [first.removeprefix("error: "), mend]
    with pytest.raises(kincal.Error, match="other.ron:"):
        kincal.parse_machine(path.read_text(), "other.ron")


def test_what_is_nonsense_is_refused_unless_it_is_wanted() -> None:
    axis = kincal.load_machine(MACHINES / "linear_axis.ron")
    x = np.linspace(0.0, 0.4, 12)
    p = axis.poses(x[:, None])[:, :3, 3] + 1e-6 * np.sin(50 * np.arange(36)).reshape(12, 3)
    columns = {"x[m]": x[::-1], "px[m]": p[:, 0], "py[m]": p[:, 1], "pz[m]": p[:, 2]}
    recording = kincal.Recording(columns, {"measurement": "position"})
    with pytest.raises(kincal.Error, match="do not belong together") as told:
        kincal.calibrate(axis, recording)
    assert "in the opposite order" in told.value.what and told.value.mend.endswith("force=True goes on all the same")
    _, fit = kincal.calibrate(axis, recording, force=True)
    assert fit["rms_m"]["geometric"] > 1e-3


@pytest.mark.parametrize(
    ("columns", "head", "message"),
    [
        ({"q1[deg]": [0, 1], "q2[deg]": [0]}, {}, "`q2\\[deg\\]` has 1 values, and `q1\\[deg\\]` has 2"),
        ({"q1[deg]": [[0, 1]]}, {}, "shape \\[1, 2\\]"),
        ({"q1,q2": [0]}, {}, "comma"),
        ({"q1[deg]": [0]}, {"measurement": "po\nsition"}, "line break"),
        ({"q1[deg]": ["a"]}, {}, "array of numbers"),
        ({}, {}, "no column is given"),
    ],
)
def test_arrays_that_are_no_recording_are_told(columns: Any, head: Any, message: str) -> None:
    with pytest.raises(kincal.Error, match=message):
        kincal.Recording(columns, head)


def test_a_recording_of_arrays_is_told_by_its_name(scara: kincal.Machine) -> None:
    recording = kincal.Recording({"q1[deg]": np.zeros(3)}, {"measurement": "position"}, name="mine")
    with pytest.raises(kincal.Error, match="^mine:2"):
        kincal.calibrate(scara, recording)


def test_arguments_that_mean_nothing_are_told(scara: kincal.Machine, tracked: Path) -> None:
    loss: Any = "cubes"
    with pytest.raises(kincal.Error, match="squares huber tukey"):
        kincal.calibrate(scara, tracked, loss=loss)
    with pytest.raises(kincal.Error, match="error_motions is 2"):
        kincal.calibrate(scara, tracked, error_motions=2)
    with pytest.raises(kincal.Error, match="no recording"):
        kincal.calibrate(scara, [])
    with pytest.raises(kincal.Error, match="q9"):
        kincal.calibrate(scara, tracked, directions=["q9"])
    with pytest.raises(kincal.Error, match="check the path"):
        kincal.predict(scara, "nothing/here.csv")
    with pytest.raises(kincal.Error, match="\\(samples, 4\\): q1, q2, q3, q4"):
        scara.poses(np.zeros((3, 5)))
    with pytest.raises(kincal.Error, match="no homogeneous matrix"):
        kincal.inverse(scara, 2 * np.eye(4))
    with pytest.raises(kincal.Error, match="no number below 1e9"):
        kincal.inverse(scara, np.eye(4), [np.nan, 0, 0, 0])
    with pytest.raises(kincal.Error, match="2 tips are given"):
        kincal.inverse(scara, np.eye(4), tip=np.stack([np.eye(4), np.eye(4)]))
    with pytest.raises(kincal.Error, match="starts: 2, poses: 1"):
        kincal.inverse(scara, np.eye(4), np.zeros((2, 4)))


def test_what_is_of_another_type_is_told_by_what_it_should_be(scara: kincal.Machine) -> None:
    other: Any = 5
    with pytest.raises(TypeError, match="a recording is the path of a file, or a kincal.Recording"):
        kincal.calibrate(scara, other)
    with pytest.raises(TypeError, match="a recording is the path of a file, or a kincal.Recording"):
        kincal.calibrate(scara, ["rec.csv", other])
    nothing: Any = None
    with pytest.raises(TypeError, match="a text, a number, or several numbers"):
        kincal.Recording({"q1[deg]": [0.0]}, {"measurement": nothing})
    with pytest.raises(kincal.Error, match="line break"):
        kincal.Recording({"q1[deg]": [0.0]}, {}, name="a\nb")


def test_the_command_tells_its_status(command: CommandLine) -> None:
    assert command.run("--version").stdout.startswith("kincal ")
    assert command.run("calibrate").returncode == 2
    assert command.run("check", MACHINES / "scara.ron").returncode == 0


def test_python_goes_on_beside_a_calibration(scara: kincal.Machine, command: CommandLine) -> None:
    path = command.folder / "long.csv"
    poses = ["--test", "poses", "--count", "2000", "--measure", "position", "--noise", "10um", "--random", "3"]
    command.json("simulate", MACHINES / "scara.ron", *poses, "-o", path)
    work = threading.Thread(target=kincal.calibrate, args=(scara, path))
    work.start()
    ticks = 0
    while work.is_alive():
        work.join(0.001)
        ticks += 1
    assert ticks > 10
