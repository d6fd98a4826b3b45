#!/usr/bin/env bash
# You measure machines. You have the file of a ballbar with the NC program that ran, a trace of the control with the ballbar on an analogue
# input (nine tests, one after the other), and the name of the machine. You get a report, and numbers that can be entered. `kincal` is on the
# path.
#
# The bar's own file has readings alone: the program says where the axes were, and the file is laid beside it. Positions beside the readings,
# as the trace has them, are better.
set -euo pipefail
data=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

kincal machines ac_table_tilting > machine.ron
for test in 1 2 3 4 5 6 7 8 9; do
    kincal convert "$data/ballbar_trace.csv" --machine machine.ron --where Test=$test --column 'd=AI 1' --unit 'AI 1=um' \
        --measurement distance --head 'nominal_length[mm]: 100' --quiet -o "test_$test.csv"
done
kincal convert "$data/ballbar.csv" --machine machine.ron --sample-rate 50Hz \
    --path "$data/ballbar.nc --length 100mm --without-approach" --quiet --json aligned.json -o circle.csv
kincal calibrate machine.ron circle.csv test_?.csv --quiet --json geometry.json
kincal diagnose machine.ron circle.csv test_?.csv --report report.html -o calibrated.ron --quiet --json found.json
for control in siemens heidenhain fanuc iso230; do
    kincal export calibrated.ron --to $control --tool-length 120mm --quiet -o $control.txt
done

# What there has to be. The machine is 0.1 mm off, the bar reads to 0.4 um, and the play of A is 14 arcsec.
holds() { awk "BEGIN { exit !($1) }" || { echo "$0: $2" >&2; exit 1; }; }
of() { awk -F'[:,]' -v key="\"$1\"" '$1 ~ key { print $2 + 0; exit }' "$2"; }
# The first motion of the program is two seconds behind the first reading.
holds "$(of start_s aligned.json) > 1.99 && $(of start_s aligned.json) < 2.01 && $(of hides_m aligned.json) < 0.2e-6" "the program is not where it ran"
holds "$(of geometric geometry.json) < 1.5e-6 && $(of nominal geometry.json) > 50e-6" "the geometry is not found"
holds "$(of final found.json) < 0.5e-6" "something is left over"
grep -q 'axis a has 1[34].* arcsec of play' found.json || { echo "$0: the play of A is not named" >&2; exit 1; }
offset=$(sed -n 's/^\$TC_CARR15\[1\]=\([-0-9.]*\) .*/\1/p' siemens.txt)
holds "${offset:-0} > 0.134 && ${offset:-0} < 0.138" "the offset of C against A is 0.136 mm, and not ${offset:-told}"
grep -q '^EX0C,.*,yes,' iso230.txt && grep -q '^c,X,' heidenhain.txt && grep -q '^19' fanuc.txt && [ -s report.html ]
echo "metrologist: $(sed -n 's/.*"verdict": "\(.*\)",/\1/p' found.json) C against A: $offset mm in X."
