"""Forward kinematics of imported arms against Pinocchio, for every tip of every URDF file given.

    python tests/agreement/urdf.py KINCAL FOLDER...

needs the package `pin`. KINCAL is the program; every .urdf below the folders is read. A tip is a link that carries nothing and that a
joint moves. Where Pinocchio refuses a file, or kincal does, that is told and counted.
"""
import json, math, pathlib, random, re, subprocess, sys, tempfile
import xml.etree.ElementTree as xml

import numpy as np
import pinocchio as pin

program, folders = sys.argv[1], sys.argv[2:]
random.seed(1)
counts = {"files": 0, "tips": 0, "agree": 0, "refused": 0, "not read by Pinocchio": 0}
worst = 0.0


def run(*args):
    return subprocess.run([program, *args], capture_output=True, text=True)


def tips(root):
    joints = [j for j in root.findall("joint")]
    parents = {j.find("parent").get("link") for j in joints}
    moved, above = set(), {j.find("child").get("link"): j for j in joints}
    for link in (l.get("name") for l in root.findall("link")):
        at = link
        while at in above:
            joint = above[at]
            if joint.get("type") not in ("fixed", "floating", "planar"):
                moved.add(link)
            at = joint.find("parent").get("link")
    return sorted(moved - parents)


for path in sorted(p for folder in folders for p in pathlib.Path(folder).rglob("*.urdf")):
    root = xml.parse(path).getroot()
    counts["files"] += 1
    try:
        model = pin.buildModelFromUrdf(str(path))
    except Exception as error:
        counts["not read by Pinocchio"] += 1
        print(f"{path.name}: Pinocchio: {str(error).splitlines()[0]}")
        continue
    data = model.createData()
    mimics = {j.get("name"): j.find("mimic") for j in root.findall("joint") if j.find("mimic") is not None}
    base = next(l.get("name") for l in root.findall("link")
                if all(j.find("child").get("link") != l.get("name") for j in root.findall("joint")))
    for tip in tips(root):
        counts["tips"] += 1
        ron = pathlib.Path(tempfile.gettempdir()) / "kincal_agreement.ron"
        made = run("import", str(path), "--base", base, "--tip", tip, "-o", str(ron), "--json", "-")
        if made.returncode:
            counts["refused"] += 1
            print(f"{path.name} {tip}: {made.stderr.strip()}", flush=True)
            continue
        joints = json.loads(made.stdout)["joints"]
        text = ron.read_text()
        # The last joint that a line's comment names is the one whose frame the line is.
        line_of = {}
        for line in text.splitlines():
            if found := re.match(r'\s+\(frame: "([^"]+)".*// (.*)$', line):
                line_of[found[1]] = found[2].split(", ")[-1].split(" (line")[0]
        value = {line_of[name]: random.uniform(-1, 1) for name in joints}
        at = ",".join(f"{name}={value[line_of[name]]!r}" + ("m" if f'"{name}"' in text and re.search(
            rf'frame: "{re.escape(name)}".*Prismatic', text) else "rad") for name in joints)
        told = run("describe", str(ron), "--at", at, "--json", "-")
        if told.returncode:
            counts["refused"] += 1
            print(f"{path.name} {tip}: describe: {told.stderr.strip()}")
            continue
        pose = json.loads(told.stdout)["w_from_t"][-1]
        while missing := [n for n in mimics if n not in value and mimics[n].get("joint") in value]:
            for n in missing:
                m = mimics[n]
                value[n] = float(m.get("multiplier", 1)) * value[m.get("joint")] + float(m.get("offset", 0))
        q = pin.neutral(model)
        for name, x in value.items():
            if not model.existJointName(name):
                if name in mimics and name not in line_of.values():
                    continue  # on another tree of links, which Pinocchio leaves out
                sys.exit(f"{path.name} {tip}: Pinocchio has no joint {name!r}; the file says {line_of}")
            joint = model.joints[model.getJointId(name)]
            if joint.nq == 2:
                q[joint.idx_q], q[joint.idx_q + 1] = math.cos(x), math.sin(x)
            else:
                q[joint.idx_q] = x
        pin.framesForwardKinematics(model, data, q)
        of = lambda link: data.oMf[model.getFrameId(link, pin.FrameType.BODY)]
        theirs = of(base).actInv(of(tip))
        off = np.abs(theirs.translation - pose["translation_m"]).max()
        turned = np.abs(theirs.rotation - pin.exp3(np.array(pose["rotation_rad"]))).max()
        worst = max(worst, off, turned)
        if max(off, turned) < 1e-12:
            counts["agree"] += 1
        else:
            print(f"{path.name} {tip}: differs by {off:.1e} m, {turned:.1e} rad")

print(", ".join(f"{name} {n}" for name, n in counts.items()), f", largest difference {worst:.1e} (m, rad)")
