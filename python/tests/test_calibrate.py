"""Results are those of the command line."""

from pathlib import Path

import kincal
import numpy as np
import pytest
from conftest import MACHINES, CommandLine, columns_of
from numpy.typing import NDArray


def test_a_calibration_of_a_file_is_that_of_the_command(command: CommandLine, tracked: Path) -> None:
    out = command.folder / "calibrated.ron"
    told = command.json("calibrate", MACHINES / "scara.ron", tracked, "-o", out)
    calibrated, fit = kincal.calibrate(kincal.load_machine(MACHINES / "scara.ron"), tracked)
    assert fit == told
    assert calibrated.to_ron() == out.read_text()
    assert fit["samples"] == 29 and fit["rms_m"]["geometric"] < 0.1 * fit["rms_m"]["nominal"]


def test_a_calibration_of_arrays_is_that_of_the_file(tracked: Path) -> None:
    columns, head = columns_of(tracked)
    arrays = kincal.Recording(columns, head, name=tracked.name)
    assert len(arrays) == 30 and arrays.name == tracked.name
    machine = kincal.load_machine(MACHINES / "scara.ron")
    of_file, fit = kincal.calibrate(machine, tracked)
    of_arrays, same = kincal.calibrate(machine, [arrays])
    assert same == fit and of_arrays.to_ron() == of_file.to_ron()


def test_arrays_are_written_as_a_recording_that_the_command_reads(command: CommandLine, tracked: Path) -> None:
    columns, head = columns_of(tracked)
    machine = kincal.load_machine(MACHINES / "scara.ron")
    written = command.folder / "written.csv"
    arrays = kincal.Recording(columns, head, name=written.name)
    arrays.save(written)
    assert written.read_text() == arrays.to_csv()
    _, fit = kincal.calibrate(machine, arrays)
    assert command.json("calibrate", MACHINES / "scara.ron", written) == fit


def test_units_of_columns_are_those_of_their_names(tracked: Path) -> None:
    columns, head = columns_of(tracked)
    machine = kincal.load_machine(MACHINES / "scara.ron")
    _, fit = kincal.calibrate(machine, kincal.Recording(columns, head))
    turned = {name.replace("[deg]", "[rad]"): np.radians(q) if "[deg]" in name else q for name, q in columns.items()}
    assert turned.keys() != columns.keys()
    _, same = kincal.calibrate(machine, kincal.Recording(turned, head))
    assert same["rms_m"]["geometric"] == pytest.approx(fit["rms_m"]["geometric"], rel=1e-6)


def test_heads_take_numbers_and_vectors(tracked: Path) -> None:
    head: dict[str, str | float | NDArray[np.float64]] = {
        "measurement": "position",
        "tool_point[mm]": np.array([0.0, 0.0, -35.0]),
        "sigma[mm]": 0.1,
    }
    text = kincal.Recording({"x[mm]": [0, 1]}, head).to_csv()
    assert text.startswith("# measurement: position\n# tool_point[mm]: 0.0, 0.0, -35.0\n# sigma[mm]: 0.1\nx[mm]\n0.0\n")


def test_options_reach_the_calibration(command: CommandLine, circled: Path) -> None:
    machine = kincal.load_machine(MACHINES / "xyz_mill.ron")
    _, fit = kincal.calibrate(machine, circled, loss="tukey", tuning=4.0, prior=False, directions=["x"])
    options = ["--loss", "tukey", "--tuning", "4", "--no-prior", "--directions", "x"]
    assert command.json("calibrate", MACHINES / "xyz_mill.ron", circled, *options) == fit
    _, plain = kincal.calibrate(machine, circled)
    assert fit["rms_m"]["geometric"] < 0.9 * plain["rms_m"]["geometric"]


def test_a_prediction_is_that_of_the_command(command: CommandLine, tracked: Path) -> None:
    machine, _ = kincal.calibrate(kincal.load_machine(MACHINES / "scara.ron"), tracked)
    path, out = command.folder / "of_arrays.ron", command.folder / "predicted.csv"
    machine.save(path)
    told = command.json("predict", path, tracked, "-o", out)
    prediction = kincal.predict(kincal.load_machine(path), tracked)
    columns = prediction.pop("columns")
    assert prediction == told
    written, _ = columns_of(out)
    assert list(columns) == list(written)[-6:]
    for name, values in columns.items():
        np.testing.assert_array_equal(values, written[name])
    residual = columns["pz_residual[mm]" if "pz_residual[mm]" in columns else list(columns)[-1]]
    assert len(residual) == 30 and np.isnan(residual).sum() == 1


def test_a_diagnosis_is_that_of_the_command(command: CommandLine, circled: Path) -> None:
    out = command.folder / "diagnosed.ron"
    told = command.json("diagnose", MACHINES / "xyz_mill.ron", circled, "-o", out)
    model, diagnosis = kincal.diagnose(kincal.load_machine(MACHINES / "xyz_mill.ron"), circled)
    assert diagnosis == told and model.to_ron() == out.read_text()
    assert [(found["effect"], found["at"]) for found in diagnosis["findings"]] == [("backlash", "x")]
    with pytest.raises(kincal.Error, match="backlush"):
        kincal.diagnose(kincal.load_machine(MACHINES / "xyz_mill.ron"), circled, without=["backlush"])
