#!/usr/bin/env bash
# Makes the raw data of this folder: what is measured on simulated machines, in the forms of other programs. `kincal` is on the path.
# The metrologist's machine has 14 arcsec of play in A. The roboticist's arm has a joint zero that is off and a link that is too long.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

# A trace of the control, with the ballbar on an analogue input: semicolons, decimal commas, micrometres, a number for each test.
kincal machines ac_table_tilting > machine.ron
kincal simulate machine.ron --test BK1 --random 1 --truth truth.ron -o any.csv --quiet
echo 'Faults(units: (length: um, angle: arcsec), backlash: [(joint: "a", width: 14)])' > faults.ron
measure() {
    kincal simulate truth.ron "$@" --length 100mm --sense both --rate 4 --faults faults.ron --noise 0.4um \
        --seed $((++tests)) --begin $((90 * tests))s -o "$tests.csv" --quiet
    grep -v '^#' "$tests.csv" | awk -F, -v test="$tests" '
        NR == 1 { for (i = 1; i <= NF; i++) { name = $i; sub(/\[.*/, "", name); at[name] = i } next }
        { printf "%d;%.3f;%.4f;%.4f;%.4f;%.5f;%.5f;%.2f\n", test, $at["t"], $at["x"], $at["y"], $at["z"], $at["a"], $at["c"], 1000 * $at["d"] }' |
        tr . , >> trace.csv
}
tests=0
printf 'Trace;%s;;;;;;\nTest;Time (s);X (mm);Y (mm);Z (mm);A (deg);C (deg);AI 1\n' 'ballbar 100 mm on analogue input 1, um' > trace.csv
for axis in a c; do
    for bar in radial tangential axial; do measure --test rotary --axis $axis --bar $bar; done
done
for plane in x,y y,z z,x; do measure --test circle --plane $plane; done
cp trace.csv "$here/ballbar_trace.csv"

# The same bar's own file, of a program with a circle in both senses: readings alone, 50 a second. The first motion brings the bar there.
kincal simulate truth.ron --test program --input "$here/ballbar.nc" --hold x=100mm --measure distance --length 100mm --rate 50 \
    --faults faults.ron --noise 0.4um --seed 10 -o bar.csv --quiet
{
    printf 'Ballbar 100 mm, XY, 2000 mm/min, 50 Hz\nDeviation (um)\n'
    grep -v '^#' bar.csv | awk -F, 'NR == 1 { for (i = 1; i <= NF; i++) { name = $i; sub(/\[.*/, "", name); at[name] = i } next }
        { printf "%.2f\n", 1000 * $at["d"] }'
} > "$here/ballbar.csv"
# What `metrologist.sh` has to find.
kincal export truth.ron --to siemens --tool-length 120mm | grep 'TC_CARR15'

# A tracker on an arm: its own names, metres, a stamp in milliseconds since 1970, a ball that nobody has measured, a tracker that stands anywhere.
sed -e 's/xyz="0.31 0 0"/xyz="0.3104 0 0"/' "$here/arm.urdf" > real.urdf
kincal import real.urdf -o real.ron --quiet
kincal simulate real.ron --test poses --count 150 --measure position --tool-point 40,30,80mm --random 0.2 --noise 20um --seed 7 -o tracked.csv --quiet
{
    echo 'timestamp [ms],shoulder_pan,shoulder_lift,elbow,wrist_1,wrist_2,wrist_3,SMR x,SMR y,SMR z'
    # The tracker stands 2 m away and is turned by 0.7 rad.
    grep -v '^#' tracked.csv | awk -F, '
        NR == 1 { for (i = 1; i <= NF; i++) { name = $i; sub(/\[.*/, "", name); at[name] = i } next }
        { c = cos(0.7); s = sin(0.7); x = $at["px"] / 1000; y = $at["py"] / 1000; z = $at["pz"] / 1000
          printf "%.0f", 1709644368000 + 2500 * (NR - 2)
          split("shoulder_pan shoulder_lift elbow wrist_1 wrist_2 wrist_3", joints, " ")
          for (i = 1; i <= 6; i++) printf ",%.5f", $at[joints[i]]
          printf ",%.6f,%.6f,%.6f\n", 2 + c * x - s * y, -0.5 + s * x + c * y, z - 0.8 }'
} > "$here/tracker.csv"
