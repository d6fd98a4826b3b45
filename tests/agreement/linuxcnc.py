"""Tool tips of imported machines against those of LinuxCNC's kinematics modules, for every row of the tables given.

    python tests/agreement/linuxcnc.py KINCAL FOLDER

FOLDER holds a table for each module, MODULE.csv, that a harness has made with the modules of an installation: it sets the pins of a module by
name and calls `kinematicsForward`; of maxkins, whose forward is not the inverse of its inverse in 2.9, `kinematicsInverse`. A row is a joint
vector with its pins and where the module has the controlled point: columns `pin_NAME_UNIT`, `joint_LETTER_UNIT`, `world_LETTER_UNIT` in mm, deg
and rad. Of serial arms a, b, c of the world are roll, pitch and yaw; of machine tools they are the joints again.

Each set of pins becomes a configuration that `kincal import` reads, and its rows a recording of which `kincal predict` says how far the tip is
off. What `kincal export --to linuxcnc` writes of the machine is read again: its tip must be the same.
"""
import csv, json, math, pathlib, re, subprocess, sys, tempfile

program, folder = sys.argv[1], pathlib.Path(sys.argv[2])
here = pathlib.Path(tempfile.mkdtemp())
# Names of modules in a configuration, where they are not those of the tables.
MODULES = {"xyzac-trt": "xyzac-trt-kins", "xyzbc-trt": "xyzbc-trt-kins", "xyzab-tdr": "xyzab_tdr_kins"}
ARMS = {"genserkins"}
EXPORTED = {"xyzac-trt-kins", "xyzbc-trt-kins", "xyzab_tdr_kins", "5axiskins", "maxkins"}
# Largest difference that agrees, mm; of arms also of what a rotation vector is off, deg.
LIMIT = 1e-9


def run(*args):
    done = subprocess.run([program, *map(str, args)], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"kincal {' '.join(map(str, args))}: {done.stderr.strip()}")
    return done.stdout


def of(row, kind):
    """Columns of a kind: value and unit by name."""
    found = (re.fullmatch(rf"{kind}_(\w+)_(mm|deg|rad)", name) for name in row)
    return {part[1]: (float(row[part[0]]), part[2]) for part in found if part}


def imported(module, hal, tool, quill=True):
    """The machine file of a configuration, and its joints; without the quill of 5axiskins, if it has one."""
    (here / "m.hal").write_text(hal)
    axes = "" if quill or module != "5axiskins" else "COORDINATES = X Y Z B C\n"
    (here / "m.ini").write_text(f"[EMC]\nMACHINE = m\n[KINS]\nKINEMATICS = {module}\n[TRAJ]\n{axes}LINEAR_UNITS = mm\n"
                                "ANGULAR_UNITS = degree\n[HAL]\nHALFILE = m.hal\n")
    length = ["--tool-length", f"{tool!r}mm"] if tool else []
    return here / "m.ron", json.loads(run("import", here / "m.ini", *length, "-o", here / "m.ron", "--json", "-"))["joints"]


def quaternion(a, b, c):
    """Of Rz(c) Ry(b) Rx(a), scalar first."""
    (sa, ca), (sb, cb), (sc, cc) = ((math.sin(x / 2), math.cos(x / 2)) for x in (a, b, c))
    return [ca * cb * cc + sa * sb * sc, sa * cb * cc - ca * sb * sc, ca * sb * cc + sa * cb * sc, ca * cb * sc - sa * sb * cc]


def recording(module, names, rows):
    """What the module says, as if it had been measured."""
    kind, columns = ("pose", "qw[1],qx[1],qy[1],qz[1]") if module in ARMS else ("position", "")
    letters = {letter: (unit, letter.lower() if letter.lower() in names else f"joint_{letter.lower()}")
               for letter, (_, unit) in of(rows[0], "joint").items() if letter not in "UVW" or f"joint_{letter.lower()}" in names}
    head = ",".join([f"{name}[{unit}]" for unit, name in letters.values()] + ["px[mm],py[mm],pz[mm]"] + [columns] * bool(columns))
    lines = [f"# measurement: {kind}", head]
    for row in rows:
        joints = {letter: value for letter, (value, _) in of(row, "joint").items()}
        world = {letter: value for letter, (value, _) in of(row, "world").items()}
        if module == "maxkins":
            # U, V and W move the head, along with B, and are no joints of the imported machine: the others go that way.
            b, u, w = math.radians(joints["B"]), joints["U"], joints["W"]
            joints["X"] -= u * math.cos(b) - w * math.sin(b)
            joints["Y"] -= joints["V"]
            joints["Z"] -= u * math.sin(b) + w * math.cos(b)
        elif module == "5axiskins" and "W" not in letters:
            # So does the quill, along the tool.
            b, c, w = math.radians(joints["B"]), math.radians(joints["C"]), joints["W"]
            along = -w * math.sin(-b), -w * math.cos(b)
            joints["X"] += math.cos(c) * along[0]
            joints["Y"] += math.sin(c) * along[0]
            joints["Z"] += along[1]
        cells = [joints[letter] for letter in letters] + [world[letter] for letter in "xyz"]
        cells += quaternion(*(math.radians(world[letter]) for letter in "abc")) if module in ARMS else []
        lines.append(",".join(map(repr, cells)))
    (here / "m.csv").write_text("\n".join(lines) + "\n")
    return here / "m.csv"


def apart(machine, rec):
    """Row by row how far the tip is off, mm, and of arms the frame, deg."""
    run("predict", machine, rec, "-o", here / "out.csv", "--quiet")
    with open(here / "out.csv") as file:
        table = list(csv.DictReader(line for line in file if not line.startswith("#")))
    scale = {"mm": 1, "m": 1e3, "um": 1e-3, "deg": 1, "rad": math.degrees(1), "1": math.degrees(1)}
    of_unit = lambda units: [name for name in table[0] if "_residual[" in name and re.search(rf"\[({units})\]$", name)]
    largest = lambda row, names: max((abs(float(row[n])) * scale[re.search(r"\[(.*)\]", n)[1]] for n in names), default=0.0)
    return [(largest(row, of_unit("mm|m|um")), largest(row, of_unit("deg|rad|1"))) for row in table]


print("| module | sets of pins | rows | that agree | largest difference | through `export` and back |")
print("| --- | --- | --- | --- | --- | --- |")
failed = False
for table in sorted(folder.glob("*.csv")):
    module = MODULES.get(table.stem, table.stem)
    if module == "pumakins":
        continue  # is not imported
    rows = list(csv.DictReader(table.open()))
    sets = {}
    for row in rows:
        sets.setdefault(json.dumps(of(row, "pin")), []).append(row)
    off, back = [], []
    for own in sets.values():
        pins = {name.replace("_", "-"): value for name, (value, _) in of(own[0], "pin").items()}
        tool = pins.get("tool-offset", pins.get("tool-offset-z", 0.0))
        hal = "".join(f"setp {module}.{pin} {value!r}\n" for pin, value in pins.items())
        machine, names = imported(module, hal, 0)
        rec = recording(module, names, own)
        off += apart(machine, rec)
        if module in EXPORTED:
            machine, names = imported(module, hal, 0, quill=False)
            rec = recording(module, names, own)
            exported = run("export", machine, "--to", "linuxcnc", *(["--tool-length", f"{tool!r}mm"] if tool else []))
            hal = "".join(line + "\n" for line in exported.splitlines() if line.startswith("setp"))
            back += apart(imported(module, hal, tool, quill=False)[0], rec)
    agree = sum(max(row) < LIMIT for row in off)
    failed |= agree < len(rows) or any(max(row) >= LIMIT for row in back)
    shown = lambda rows: f"{max(row[0] for row in rows):.1e} mm" + (f", {max(row[1] for row in rows):.1e} deg" if module in ARMS else "")
    print(f"| `{module}` | {len(sets)} | {len(rows)} | {agree} | {shown(off)} | {shown(back) if back else 'not exported'} |", flush=True)
sys.exit(failed)
