"""Calibrates machines whose recordings lie apart, on a cluster of Dask: every worker sums its own recordings, and sums alone travel.

    python fleet.py FOLDER [WORKERS]

FOLDER has one folder for each machine: `machine.ron` and recordings, `*.csv`. Beside them `calibrated.ron` is written. Without an address
of a scheduler in DASK_SCHEDULER a local cluster is started; on one that is not local the folders have to be seen by all workers.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from dask.distributed import Client, LocalCluster

ROUNDS = 100


def kincal(*args) -> None:
    """A run of the program; its message where it fails."""
    done = subprocess.run(["kincal", *map(str, args), "--quiet"], capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(f"kincal {args[0]}: {done.stderr}")


def part(machine: str, recording: str, at: str | None) -> str:
    """What one recording adds: on the worker that has it."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "part"
        kincal("normal", machine, recording, "-o", out, *(["--at", at] if at else []))
        return out.read_text()


def calibrate(client: Client, folder: Path) -> int:
    """Rounds until the machine is found; how many there were."""
    machine, recordings = folder / "machine.ron", sorted(folder.glob("*.csv"))
    with tempfile.TemporaryDirectory(dir=folder) as rounds:
        at = None
        for number in range(ROUNDS):
            sums = client.gather([client.submit(part, str(machine), str(r), at, pure=False) for r in recordings])
            files = [Path(rounds) / f"part_{i:05}" for i in range(len(sums))]
            for file, text in zip(files, sums):
                file.write_text(text)
            model = Path(rounds) / f"round_{number}.ron"
            kincal("merge", *files, "-o", model)
            # A round says what it is in its first words; anything else is the machine.
            if "kincal round" not in model.read_text()[:60]:
                model.replace(folder / "calibrated.ron")
                return number
            at = str(model)
    raise RuntimeError(f"{folder}: not settled after {ROUNDS} rounds")


def main() -> None:
    root, workers = Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 2
    address = os.environ.get("DASK_SCHEDULER")
    cluster = None if address else LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None)
    with Client(address or cluster) as client:
        for folder in sorted(path.parent for path in root.glob("*/machine.ron")):
            print(f"{folder.name}: {calibrate(client, folder)} rounds")
    if cluster is not None:
        cluster.close()


if __name__ == "__main__":
    main()
