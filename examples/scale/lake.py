"""Recordings of a fleet in one table, and those of a machine out of it again, by DuckDB.

    python lake.py put LAKE REC.csv...      adds recordings to LAKE, a folder of Parquet files
    python lake.py get LAKE MACHINE FOLDER  writes the recordings of a machine as CSV, as kincal reads them
    python lake.py days LAKE                rows of each machine and recording

A recording keeps its header lines beside the table, and its columns, all of numbers, under their own names with units.
"""

import sys
from pathlib import Path

import duckdb


def header(recording: Path) -> tuple[list[str], str]:
    """The lines before the header row, and the machine that they name."""
    lines = []
    with recording.open() as file:
        for line in file:
            if not line.startswith("#"):
                break
            lines.append(line.rstrip("\n"))
    keys = dict(line[1:].split(":", 1) for line in lines if ":" in line)
    machine = {key.strip(): value.strip() for key, value in keys.items()}.get("machine", "unnamed")
    return lines, machine


def put(lake: Path, recordings: list[Path]) -> None:
    for recording in recordings:
        lines, machine = header(recording)
        folder = lake / f"machine={machine}" / f"recording={recording.stem}"
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "header.txt").write_text("\n".join(lines) + "\n")
        rows = f"read_csv('{recording}', skip = {len(lines)}, header = true, all_varchar = true, nullstr = ['', 'NaN'])"
        # As doubles: what is written again by shortest decimals is read as the same numbers.
        duckdb.sql(f"COPY (SELECT COLUMNS(*)::DOUBLE FROM {rows}) TO '{folder}/rows.parquet' (FORMAT parquet)")


def get(lake: Path, machine: str, out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    for folder in sorted((lake / f"machine={machine}").glob("recording=*")):
        name = folder.name.removeprefix("recording=")
        body = out / f"{name}.body"
        duckdb.sql(f"COPY (FROM read_parquet('{folder}/rows.parquet', hive_partitioning = false)) TO '{body}' (FORMAT csv, HEADER)")
        (out / f"{name}.csv").write_text((folder / "header.txt").read_text() + body.read_text())
        body.unlink()


def days(lake: Path) -> None:
    files = f"read_parquet('{lake}/*/*/rows.parquet', hive_partitioning = true, union_by_name = true)"
    duckdb.sql(f"SELECT machine, recording, count(*) AS rows FROM {files} GROUP BY ALL ORDER BY ALL").show()


def main() -> None:
    command, lake, *rest = sys.argv[1:]
    if command == "put":
        put(Path(lake), [Path(path) for path in rest])
    elif command == "get":
        get(Path(lake), rest[0], Path(rest[1]))
    elif command == "days":
        days(Path(lake))
    else:
        sys.exit(__doc__)


if __name__ == "__main__":
    main()
