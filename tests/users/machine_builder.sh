#!/usr/bin/env bash
# You build or mend machines. You have a drawing: the axes, their directions, a point of each. You get a machine file, numbers of the
# machine as it is, and an NC program that cuts on it as it was meant. `kincal` is on the path.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

# The drawing: a table turns about C, 250 mm to the right of the machine's zero and 80 mm below the part; a head tilts about B, 180 mm
# above the tool's tip; X and Y carry the table, Z the head.
cat > mill.ron <<'RON'
Machine(
    name: "mill",
    units: (length: mm, angle: deg),
    tolerance: (translation: 0.03, rotation: 0.004),
    workpiece: [
        (frame: "y",                       joint: Prismatic(axis: "-y", travel: (-300, 300))),
        (frame: "x",                       joint: Prismatic(axis: "-x", travel: (-400, 400))),
        (frame: "c", at: (250, 0, -80),    joint: Revolute(axis: "-z", travel: (-360, 360))),
        (frame: "w", at: (0, 0, 80)),
    ],
    tool: [
        (frame: "z",                       joint: Prismatic(axis: "z", travel: (-100, 400))),
        (frame: "b", at: (250, 0, 180),    joint: Revolute(axis: "y", travel: (-95, 95))),
        (frame: "t", at: (0, 0, -180)),
    ],
)
RON
kincal describe mill.ron --at x=100mm,b=90deg > described.txt
kincal check mill.ron --quiet --json check.json
# A test on the machine; here it is simulated, with errors drawn from the tolerances and play of C.
echo 'Faults(units: (length: um, angle: arcsec), backlash: [(joint: "c", width: 20)])' > faults.ron
kincal simulate mill.ron --test poses --count 250 --measure position --random 1 --noise 1um --faults faults.ron --truth truth.ron --quiet -o tracker.csv
kincal calibrate mill.ron tracker.csv -o calibrated.ron --quiet --json geometry.json
kincal diagnose mill.ron tracker.csv -o with_play.ron --quiet --json found.json
printf '%s\n' 'G90 G21 G94' 'G0 X0 Y0 Z50 B0 C0' 'G1 X50 Y20 Z10 F1000 (corner)' 'X-50 Y40 B10 C90' 'G1 Z60' 'M30' > part.nc
kincal compensate with_play.ron part.nc -o part_compensated.nc --quiet --json compensated.json
kincal verify part.nc part_compensated.nc with_play.ron --quiet --json verified.json

# What there has to be.
holds() { awk "BEGIN { exit !($1) }" || { echo "$0: $2" >&2; exit 1; }; }
of() { awk -F'[:,]' -v key="\"$1\"" '$1 ~ key { print $2 + 0; exit }' "$2"; }
# By the drawing: the table 100 mm to the left, and the head lying down, 180 mm long.
grep -q 'at (-80.0000, 0.0000, 180.0000) mm' described.txt || { echo "$0: the machine file is not the drawing" >&2; exit 1; }
holds "$(of geometric geometry.json) < 0.3 * $(of nominal geometry.json)" "the geometry is not found"
grep -q '"effect": "backlash"' found.json || { echo "$0: the play of C is not named" >&2; exit 1; }
cmp -s part.nc part_compensated.nc && { echo "$0: the program was not changed" >&2; exit 1; }
grep -q '(corner)' part_compensated.nc
# As it was written the program does not bring the tool of this machine where it should.
if kincal verify part.nc part.nc with_play.ron --quiet 2> /dev/null; then echo "$0: the program needs no correction" >&2; exit 1; fi
echo "machine builder: $(sed -n 's/.*"verdict": "\(.*\)",/\1/p' found.json)"
