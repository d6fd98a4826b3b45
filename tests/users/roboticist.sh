#!/usr/bin/env bash
# You calibrate robots. You have the maker's URDF file and a table of a tracker, with its own names and stamps; nobody knows where the
# tracker stands, nor where on the flange its ball is. You get the URDF file with corrected origins. `kincal` is on the path.
set -euo pipefail
data=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

kincal import "$data/arm.urdf" -o arm.ron --quiet
table=(--machine arm.ron --unit length=m --unit angle=deg --head 'workpiece_frame: unknown' --head 'tool_point: unknown ball')
kincal convert "$data/tracker.csv" "${table[@]}" --quiet -o all.csv
# Every fifth pose is kept back.
grep '^#' all.csv | tee fit.csv > kept.csv
grep -v '^#' all.csv | awk 'NR == 1 { print > "fit_rows"; print > "kept_rows"; next } { print > (NR % 5 ? "fit_rows" : "kept_rows") }'
cat fit_rows >> fit.csv
cat kept_rows >> kept.csv
kincal calibrate arm.ron fit.csv -o calibrated.ron --quiet --json geometry.json
kincal diagnose arm.ron fit.csv --report report.html --quiet --json found.json
kincal export calibrated.ron --to urdf --base-file "$data/arm.urdf" --quiet -o arm_calibrated.urdf
kincal import arm_calibrated.urdf -o read_back.ron --quiet
for machine in arm calibrated read_back; do kincal predict $machine.ron kept.csv --fit-setup --quiet --json $machine.json; done

# What there has to be. The tracker reads to 20 um in each of three coordinates, and the arm is some tenths of a millimetre off.
holds() { awk "BEGIN { exit !($1) }" || { echo "$0: $2" >&2; exit 1; }; }
of() { awk -F'[:,]' -v key="\"$1\"" '$1 ~ key { print $2 + 0; exit }' "$2"; }
before=$(of rms_m arm.json) after=$(of rms_m calibrated.json) again=$(of rms_m read_back.json)
holds "$(of geometric geometry.json) < 45e-6 && $(of nominal geometry.json) > 150e-6" "the geometry is not found"
holds "$after < 45e-6 && $before > 3 * $after" "poses that were kept back are foretold to $after m, before to $before m"
holds "$again / $after < 1.01 && $after / $again < 1.01" "the URDF file leaves $again m, the calibrated machine $after m"
grep -q 'nothing else to be found\|"findings": \[\]' found.json && [ -s report.html ] || { echo "$0: something is named that is not there" >&2; exit 1; }
echo "roboticist: $(sed -n 's/.*"verdict": "\(.*\)",/\1/p' geometry.json) Poses kept back: $(awk "BEGIN { printf \"%.0f um, before %.0f um\", 1e6 * $after, 1e6 * $before }")."
