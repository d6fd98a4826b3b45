#!/usr/bin/env bash
# Both scripts at small size: two machines, through DuckDB and Dask, to what `kincal calibrate` finds from the same recordings.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

for machine in scara ac_table_tilting; do
    mkdir -p "raw" "fleet/$machine"
    kincal machines "$machine" >"fleet/$machine/machine.ron"
    # Two tests of one machine, whose deviations the seed draws.
    simulate() { kincal simulate "fleet/$machine/machine.ron" --test poses --random 1 --noise 2um "$@" --quiet; }
    simulate --count 60 --measure position -o "raw/${machine}_1.csv"
    simulate --count 80 --measure pose -o "raw/${machine}_2.csv"
    python "$here/lake.py" put lake raw/"$machine"_*.csv
    python "$here/lake.py" get lake "$machine" "fleet/$machine"
done
python "$here/lake.py" days lake
python "$here/fleet.py" fleet 2

for machine in scara ac_table_tilting; do
    kincal calibrate "fleet/$machine/machine.ron" "fleet/$machine"/*.csv -o "$machine.ron" --quiet
    cmp "$machine.ron" "fleet/$machine/calibrated.ron"
done
echo "parts and one run gave the same machines"
