"""What all tests share: the machines of the project, the command line, and simulated recordings."""

import csv
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

MACHINES = Path(__file__).parents[2] / "machines"


class CommandLine:
    """The installed command, in a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def run(self, *arguments: str | Path) -> "subprocess.CompletedProcess[str]":
        line = [sys.executable, "-m", "kincal", *map(str, arguments)]
        return subprocess.run(line, capture_output=True, text=True, cwd=self.folder)

    def json(self, *arguments: str | Path) -> dict[str, Any]:
        """What the call writes with `--json`."""
        done = self.run(*arguments, "--json", "-")
        assert done.returncode == 0, done.stderr
        result: dict[str, Any] = json.loads(done.stdout)
        return result


def columns_of(path: Path) -> tuple[dict[str, NDArray[np.float64]], dict[str, str]]:
    """Columns and head of a recording; an empty cell is NaN."""
    lines = path.read_text().splitlines()
    head = dict(line[1:].strip().split(": ", 1) for line in lines if line.startswith("#") and ": " in line)
    names, *rows = csv.reader(line for line in lines if not line.startswith("#"))
    table = np.array([[float(cell or "nan") for cell in row] for row in rows])
    return dict(zip(names, table.T)), head


@pytest.fixture(scope="session")
def command(tmp_path_factory: pytest.TempPathFactory) -> CommandLine:
    return CommandLine(tmp_path_factory.mktemp("recordings"))


@pytest.fixture(scope="session")
def tracked(command: CommandLine) -> Path:
    """A tracker on a SCARA arm whose errors are drawn from its tolerances; one reading is lost."""
    path = command.folder / "tracked.csv"
    poses = ["--test", "poses", "--count", "30", "--measure", "position", "--noise", "10um", "--random", "3"]
    command.json("simulate", MACHINES / "scara.ron", *poses, "-o", path)
    lines = path.read_text().splitlines()
    lines[-3] = ",".join([*lines[-3].split(",")[:-1], ""])
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture(scope="session")
def circled(command: CommandLine) -> Path:
    """A ballbar on a mill, with play of X."""
    path = command.folder / "circled.csv"
    faults = command.folder / "faults.ron"
    faults.write_text('Faults(units: (length: um, angle: arcsec), backlash: [(joint: "x", width: 12)])')
    circle = ["--test", "circle", "--plane", "x,y", "--length", "100mm", "--sense", "both", "--rate", "5", "--noise", "0.3um"]
    command.json("simulate", MACHINES / "xyz_mill.ron", *circle, "--faults", faults, "-o", path)
    return path
