"""Writes the files of this folder and of tests/bad/columnar as other people's programs write them.

    pip install pandas polars duckdb pyarrow && python tests/columnar/make.py

`table.csv` is the table that all of them hold.
"""

import datetime
import decimal
import pathlib

import duckdb
import pandas
import polars
import pyarrow
import pyarrow.csv
import pyarrow.feather
import pyarrow.ipc
import pyarrow.parquet

HERE = pathlib.Path(__file__).parent
BAD = HERE.parent / "bad" / "columnar"

ZERO = datetime.datetime(2024, 3, 5, 13, 12, 48, 500000)
STAMPS = [ZERO + datetime.timedelta(milliseconds=ms) for ms in (0, 250, 1000, 2500, 86_400_000)]
ROWS = 5
TABLE = pyarrow.table(
    {
        "Stamp": pyarrow.array(STAMPS, pyarrow.timestamp("us")),
        "Axis 1 (deg)": pyarrow.array([-60.1, -20.25, 15.0, 50.0, 1e-7], pyarrow.float64()),
        "Axis 2 (deg)": pyarrow.array([30.1, 55.2, -40.3, -80.4, 0.1], pyarrow.float32()),
        "Axis 3 (mm)": pyarrow.array([20, 80, 140, 100, None], pyarrow.int16()),
        "Axis 4 (deg)": pyarrow.array(
            [decimal.Decimal(t) for t in ("0.00", "45.25", "90.50", "-45.75", "7.01")], pyarrow.decimal128(9, 2)
        ),
        "Ball X (m)": pyarrow.array([1.98669, 1.83051, None, 1.83081, 1 / 3], pyarrow.float64()),
        "Ball Y (m)": pyarrow.array([0.41022, 0.39873, None, float("nan"), 2 / 3], pyarrow.float64()),
        "Ball Z (m)": pyarrow.array([0.31507, 0.25503, None, 0.13498, -1e-3], pyarrow.float64()),
        "run": pyarrow.array(["one", "one", "one", None, "two; or \"three\", äöü"], pyarrow.string()),
        "valid": pyarrow.array([True, True, False, None, True], pyarrow.bool_()),
    }
)


def field(value: object) -> str:
    if value is None or value != value:
        return ""
    if isinstance(value, datetime.datetime):
        return value.isoformat()
    text = str(value)
    return '"' + text.replace('"', '""') + '"' if any(c in text for c in ',"') else text


def with_column(name: str, array: pyarrow.Array) -> pyarrow.Table:
    return TABLE.set_column(TABLE.column_names.index(name), name, array)


def main() -> None:
    BAD.mkdir(exist_ok=True)
    # Numbers of four bytes with the digits that they have.
    plain = [c.cast(pyarrow.string()) if c.type == pyarrow.float32() else c for c in TABLE.columns]
    columns = [[field(x.as_py()) for x in column] for column in plain]
    lines = [",".join(TABLE.column_names)] + [",".join(row) for row in zip(*columns)]
    (HERE / "table.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")

    frame = TABLE.to_pandas()
    frame["Axis 3 (mm)"] = frame["Axis 3 (mm)"].astype("Int16")
    frame.to_parquet(HERE / "pandas.parquet")
    categories = frame.assign(run=frame["run"].astype("category"))
    categories.to_parquet(HERE / "pandas_index.parquet", index=True, compression="gzip")
    frame.to_feather(HERE / "pandas.feather")

    frame = polars.from_arrow(TABLE)
    frame.write_parquet(HERE / "polars.parquet")
    frame.with_columns(polars.col("run").cast(polars.Categorical)).write_ipc(HERE / "polars.arrow")
    frame.write_ipc(HERE / "polars_zstd.arrow", compression="zstd")
    frame.write_ipc_stream(HERE / "polars.arrows")

    duckdb.from_arrow(TABLE).write_parquet(str(HERE / "duckdb.parquet"))

    nanoseconds = with_column("Stamp", TABLE["Stamp"].cast(pyarrow.timestamp("ns", tz="Europe/Berlin")))
    pyarrow.parquet.write_table(nanoseconds, HERE / "zone.parquet", compression="lz4", row_group_size=2)
    old = {"use_deprecated_int96_timestamps": True, "use_dictionary": False, "version": "1.0"}
    pyarrow.parquet.write_table(TABLE, HERE / "int96.parquet", compression="none", **old)
    new = {"data_page_version": "2.0", "use_byte_stream_split": ["Axis 1 (deg)"], "use_dictionary": ["run"]}
    pyarrow.parquet.write_table(TABLE, HERE / "pages2.parquet", compression="zstd", **new)
    milliseconds = with_column("Stamp", TABLE["Stamp"].cast(pyarrow.timestamp("ms")))
    pyarrow.feather.write_feather(milliseconds, HERE / "plain.feather", compression="uncompressed", chunksize=2)
    since = pyarrow.array([stamp - ZERO for stamp in STAMPS], pyarrow.duration("ms"))
    index = TABLE.column_names.index("Stamp")
    pyarrow.feather.write_feather(TABLE.set_column(index, "time", since), HERE / "durations.feather", compression="lz4")

    direction = pyarrow.array([1, 1, -1], pyarrow.int8())
    columns = {"x[mm]": [0.0, 10.0, 20.0], "x_meas[um]": [0.5, 10003.0, None], "x_direction[1]": direction}
    recording = pyarrow.table(columns)
    head = {"kincal": "machine: linear_axis\nmeasurement: joint"}
    pyarrow.parquet.write_table(recording.replace_schema_metadata(head), HERE / "recording.parquet")

    whole = (HERE / "pandas.parquet").read_bytes()
    (BAD / "cut.parquet").write_bytes(whole[: len(whole) // 2])
    (BAD / "changed.parquet").write_bytes(whole[:-12] + bytes(4) + whole[-8:])
    whole = (HERE / "polars.arrow").read_bytes()
    (BAD / "cut.arrow").write_bytes(whole[: len(whole) // 2])
    whole = (HERE / "polars.arrows").read_bytes()
    (BAD / "cut.arrows").write_bytes(whole[: len(whole) // 2])
    (BAD / "named.parquet").write_text("q1_deg,q2_deg\n1,2\n")
    (BAD / "first.feather").write_bytes(b"FEA1" + bytes(16) + b"FEA1")
    (BAD / "encrypted.parquet").write_bytes(b"PARE" + bytes(16) + b"PARE")
    pyarrow.parquet.write_table(TABLE, BAD / "brotli.parquet", compression="brotli")
    pyarrow.parquet.write_table(TABLE.slice(0, 0), BAD / "no_rows.parquet")
    lists = with_column("run", pyarrow.array([[1.0, 2.0]] * ROWS))
    pyarrow.parquet.write_table(lists, BAD / "list.parquet")
    structs = with_column("run", pyarrow.array([{"x": 1.0, "y": 2.0}] * ROWS))
    pyarrow.feather.write_feather(structs, BAD / "struct.arrow", compression="uncompressed")
    dates = with_column("Stamp", pyarrow.array([stamp.date() for stamp in STAMPS]))
    pyarrow.parquet.write_table(dates, BAD / "dates.parquet")
    words = with_column("Ball Y (m)", pyarrow.array(["0.1", "0.2", "0,3", "0.4", "0.5"]))
    pyarrow.parquet.write_table(words, BAD / "word.parquet")
    infinite = with_column("Ball Y (m)", pyarrow.array([1.0, float("inf"), 1.0, 1.0, 1.0]))
    pyarrow.parquet.write_table(infinite, BAD / "infinite.parquet")
    no_units = TABLE.rename_columns([name.replace(" (m)", "") for name in TABLE.column_names])
    pyarrow.parquet.write_table(no_units, BAD / "no_units.parquet")
    no_meas = recording.drop_columns("x_meas[um]")
    pyarrow.parquet.write_table(no_meas.replace_schema_metadata(head), BAD / "recording.parquet")


main()
