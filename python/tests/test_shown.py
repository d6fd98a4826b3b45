"""What the documents show in Python runs."""

import json
from pathlib import Path
from typing import Any

import kincal
import numpy as np
import pytest

PROJECT = Path(__file__).parents[2]


def test_every_cell_of_the_notebook_runs(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(PROJECT / "examples")
    names: dict[str, Any] = {}
    cells = [cell for cell in json.loads(Path("calibrate.ipynb").read_text())["cells"] if cell["cell_type"] == "code"]
    for cell in cells:
        exec("".join(cell["source"]), names)
        assert not cell["outputs"], "outputs are made by whoever runs it"
    assert len(cells) > 5 and "wrong:2" in capsys.readouterr().out


def test_the_example_of_the_page_runs(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "machines").symlink_to(PROJECT / "machines")
    monkeypatch.chdir(tmp_path)
    [example] = (PROJECT / "docs/python.md").read_text().split("```python\n")[1:]
    q = np.random.default_rng(2).random((40, 4)) * [1, 1, 0.1, 1]
    off = kincal.load_machine("machines/scara.ron").poses(q + [0, 1e-3, 0, 0])
    p = (off @ [0.02, 0.03, 0.05, 1])[:, :3]
    exec(example.split("```")[0], {"q": q, "p": p})
    assert capsys.readouterr().out.startswith("The machine is ")
    # How the tool is turned no ball shows.
    assert np.abs(kincal.load_machine("calibrated.ron").poses(q) - off)[:, :3, 3].max() < 1e-4
