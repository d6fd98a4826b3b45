#!/usr/bin/env bash
# The table of whole commands in docs/performance.md, on standard output: recordings calibrated, predicted and diagnosed, a program
# compensated, each on one thread and on all. `benches/commands.sh [KINCAL]`; the machine should be quiet. RATE and BLOCKS make it larger or
# smaller. It needs GNU time, for the memory.
set -euo pipefail
machines=$(cd "$(dirname "${BASH_SOURCE[0]}")/../machines" && pwd)
kincal=$(command -v "${1:-kincal}")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
machine=$machines/ac_table_tilting.ron
# Readings a second, of which the test lasts 53: a million distances.
rate=${RATE:-20000}
blocks=${BLOCKS:-100000}

simulate() { "$kincal" simulate "$machine" --test BK4 --random 1 --noise 0.5um --quiet "$@"; }
simulate --rate "$rate" -o distances.csv
simulate --rate 20 --length 100mm,150mm -o cones.csv
echo 'Faults(units: (length: um, angle: urad), backlash: [(joint: "a", width: 60), (joint: "y", width: 4)])' >plays.ron
simulate --rate 52 --length 100mm,150mm --faults plays.ron -o plays.csv
"$kincal" calibrate "$machine" cones*.csv -o calibrated.ron --quiet
awk -v n="$blocks" 'BEGIN {
    print "%\nG21 G90 G94 F1000\nG0 X0. Y0. Z50. A0. C0."
    for (i = 0; i < n; i++)
        printf "G1 X%.3f Y%.3f Z%.3f A%.3f C%.3f\n", 80 * sin(i / 700), 60 * cos(i / 900), 20 + 10 * sin(i / 300), 25 * sin(i / 2000), 170 * sin(i / 3000)
    print "M30\n%"
}' >program.nc

row() {
    local what=$1 threads elapsed user system kilobytes
    shift
    for threads in 1 "$(nproc)"; do
        RAYON_NUM_THREADS=$threads command time -o spent -f '%e %U %S %M' "$kincal" "$@" --quiet
        read -r elapsed user system kilobytes <spent
        echo "| $what | $threads | $elapsed | $user + $system | $((kilobytes / 1000)) |"
    done
}
count() { grep -vc '^#' "$1"; }
echo "| command | threads | seconds | of the processor: user + system | MB |"
echo "| --- | --- | --- | --- | --- |"
row "\`calibrate\`, $(($(count distances.csv) - 1)) distances" calibrate "$machine" distances.csv -o out.ron
row "\`predict\` of these" predict calibrated.ron distances.csv -o out.csv
row "\`diagnose\`, $(($(count plays_1.csv) + $(count plays_2.csv) - 2)) distances with two plays" diagnose "$machine" plays*.csv
row "\`compensate\`, $blocks blocks of five words" compensate calibrated.ron program.nc -o out.nc
row "the same, \`--no-verify\`" compensate calibrated.ron program.nc -o out.nc --no-verify
