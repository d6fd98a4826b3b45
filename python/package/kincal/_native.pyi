"""Types of the compiled module. Lengths are in m, angles in rad, times in s, unless a column names its unit."""

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any, Literal, TypeAlias, TypedDict, final, type_check_only

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "Error",
    "Machine",
    "Recording",
    "calibrate",
    "diagnose",
    "inverse",
    "load_machine",
    "parse_machine",
    "predict",
    "run_command_line",
]

_Path: TypeAlias = str | PathLike[str]
_Given: TypeAlias = "_Path | Recording"

@type_check_only
class Joint(TypedDict):
    name: str
    unit: Literal["m", "rad"]
    travel: tuple[float, float]

@type_check_only
class Solutions(TypedDict):
    """What `inverse` has found, one entry for each pose."""

    commands: NDArray[np.float64]
    """Joint positions, (poses, joints)."""
    reached: NDArray[np.bool_]
    outcome: list[str]
    """`reached`, or why not."""
    position_left_m: NDArray[np.float64]
    angle_left_rad: NDArray[np.float64]

class Error(Exception):
    """What is wrong with an input. Its text is that of the command line: where, what, and how to mend it."""

    what: str
    mend: str
    """How to mend it; empty where there is nothing to add."""
    file: str | None
    line: int
    """From 1; 0 where the whole file is meant."""
    column: int
    """From 1, in a recording the number of the column; 0 where the whole line is meant."""

@final
class Machine:
    """A machine, calibrated or not."""

    @property
    def name(self) -> str: ...
    @property
    def commands(self) -> list[str]:
        """Names of the joints that are commanded, in the order of every array of joint positions."""
    @property
    def joints(self) -> list[Joint]: ...
    def poses(self, q: ArrayLike) -> NDArray[np.float64]:
        """Poses of the tool frame in the workpiece frame, (samples, 4, 4), with constant deviations.

        `q` has the shape (samples, joints), or (joints,) for one sample.
        """
    def to_ron(self) -> str:
        """The text of the machine file, with what the calibration has found."""
    def save(self, path: _Path) -> None:
        """Writes the machine file."""

@final
class Recording:
    """A recording of arrays. It reads as a file with these header keys and columns does.

    `columns`: names with units, such as `x[mm]`, `a[deg]`, `px[um]`, to arrays of one length; NaN is a drop-out.
    `head`: header keys, such as `measurement`, `tool_point[mm]`, `fixed y[mm]`, to texts, numbers or vectors.
    `name` stands for it in messages and results.
    """

    def __new__(
        cls,
        columns: Mapping[str, ArrayLike],
        head: Mapping[str, str | float | Sequence[float] | NDArray[np.float64]],
        name: str = "arrays",
    ) -> Recording: ...
    @property
    def name(self) -> str: ...
    def to_csv(self) -> str:
        """The text of the file that it reads as."""
    def save(self, path: _Path) -> None:
        """Writes that file."""
    def __len__(self) -> int: ...

def load_machine(path: _Path) -> Machine:
    """Reads a machine file, calibrated or not."""

def parse_machine(text: str, name: str = "machine.ron") -> Machine:
    """Reads the text of a machine file; messages call it `name`."""

def calibrate(
    machine: Machine,
    recordings: _Given | Sequence[_Given],
    *,
    loss: Literal["squares", "huber", "tukey"] = "huber",
    tuning: float | None = None,
    prior: bool = True,
    directions: Sequence[str] | None = None,
    error_motions: float = 0.0,
    force: bool = False,
) -> tuple[Machine, dict[str, Any]]:
    """Finds the deviations of a machine from recordings, as `kincal calibrate` does.

    Returns the calibrated machine and what the command writes with `--json`. What a calibrated machine already knows is left out, as
    the command does. Recordings from files come first in the result, arrays behind them.
    """

def predict(machine: Machine, recording: _Given, *, fit_setup: bool = False) -> dict[str, Any]:
    """What the instrument would read on the machine, as `kincal predict` says it.

    Beside the fields of `--json`, `columns` has an array for each column that the command adds to the recording, `px_model[mm]` and
    `px_residual[mm]` for `px[mm]`: one value for each row, NaN for a drop-out. Residuals are measured minus model.
    """

def diagnose(
    machine: Machine,
    recordings: _Given | Sequence[_Given],
    *,
    effects: Sequence[_Path] | None = None,
    without: Sequence[str] | None = None,
    force: bool = False,
) -> tuple[Machine, dict[str, Any]]:
    """Names what the geometry leaves over, as `kincal diagnose` does.

    Returns the machine with what was found, and what the command writes with `--json`.
    """

def inverse(
    machine: Machine,
    poses: ArrayLike,
    start: ArrayLike | None = None,
    *,
    free: Sequence[str] | None = None,
    mode: Literal["position", "axis", "position and axis", "pose"] | None = None,
    tip: ArrayLike | None = None,
    within_travel: bool = True,
) -> Solutions:
    """Commands that bring the tool of the machine, with its constant deviations, to poses of it in the workpiece frame.

    `poses`: homogeneous matrices, (poses, 4, 4) or (4, 4). `start`: joint positions to start from, one for each pose, or one for the
    first; each further pose starts from the one before it. `free`: the joints that may move, all unless given. `mode`: what of the
    pose counts, as much as the machine has joints for unless given. `tip`: the tip in the tool frame.
    """

def run_command_line(arguments: Sequence[str]) -> int:
    """Runs the command line, the name of the program first; returns its status."""
