"""Tables in columns, as other programs write them and as the module and its command do."""

from pathlib import Path

import kincal
import pytest
from conftest import MACHINES, CommandLine, columns_of

TABLES = MACHINES.parent / "tests" / "columnar"
BAD = MACHINES.parent / "tests" / "bad" / "columnar"


@pytest.mark.parametrize("name", ["pandas.parquet", "polars.parquet", "duckdb.parquet", "pandas.feather", "polars.arrow"])
def test_a_table_of_another_program_is_what_its_csv_is(command: CommandLine, name: str) -> None:
    def converted(table: str) -> object:
        call = ("convert", TABLES / table, "--machine", MACHINES / "scara.ron", "-o", "converted.csv")
        command.json(*call)
        columns, head = columns_of(command.folder / "converted.csv")
        return {name: numbers.tobytes() for name, numbers in columns.items()}, head

    assert converted(name) == converted("table.csv")


@pytest.mark.parametrize("ending", ["parquet", "arrow"])
def test_a_recording_in_columns_is_calibrated_as_the_csv(command: CommandLine, tracked: Path, ending: str) -> None:
    scara = kincal.load_machine(MACHINES / "scara.ron")
    path = tracked.with_suffix(f".{ending}")
    command.json("convert", tracked, "-o", path)
    (_, of_csv), (_, of_columns) = kincal.calibrate(scara, tracked), kincal.calibrate(scara, path)
    assert of_columns["rms_m"] == of_csv["rms_m"] and of_columns["parameters"] == of_csv["parameters"]
    columns, head = columns_of(tracked)
    saved = command.folder / f"saved.{ending}"
    kincal.Recording(columns, head).save(saved)
    command.json("convert", saved, "-o", "back.csv")
    again, head_again = columns_of(command.folder / "back.csv")
    assert head_again == head and {n: x.tobytes() for n, x in again.items()} == {n: x.tobytes() for n, x in columns.items()}


@pytest.mark.parametrize("name", ["cut.parquet", "cut.arrow", "list.parquet", "brotli.parquet"])
def test_what_is_at_fault_is_told_with_the_mend(command: CommandLine, name: str) -> None:
    done = command.run("convert", BAD / name, "--machine", MACHINES / "scara.ron", "-o", "none.csv")
    first, mend = done.stderr.splitlines()
    assert done.returncode == 1 and first.startswith(f"error: {BAD / name}: ") and mend.startswith("  = ")
    assert not (command.folder / "none.csv").exists()
