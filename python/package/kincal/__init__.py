"""Calibrates the geometry of any serial or bifurcated machine, and names the physics left out.

Arrays and results are in m, rad and s; columns of a recording name their units.
"""

from importlib.metadata import version

from ._native import (
    Error,
    Machine,
    Recording,
    calibrate,
    diagnose,
    inverse,
    load_machine,
    parse_machine,
    predict,
)

__version__ = version("kincal")
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
]
