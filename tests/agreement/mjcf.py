"""Forward kinematics of imported models against MuJoCo's mj_kinematics, for bodies and sites of every model given.

    python tests/agreement/mjcf.py KINCAL FOLDER...

needs the package `mujoco`. KINCAL is the program; every .xml below the folders that MuJoCo loads and that moves is read. A tip is a
body or a site with a name that hinges and slides move; its base is the world, or the body behind the last joint that is free or a ball.
Twelve tips of a model are taken at random. Where kincal refuses one, that is told and counted.
"""
import json, pathlib, random, subprocess, sys, tempfile

import mujoco
import numpy as np

TIPS = 12
FREE, BALL, SLIDE, HINGE = (int(kind) for kind in (
    mujoco.mjtJoint.mjJNT_FREE, mujoco.mjtJoint.mjJNT_BALL, mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE))
program, folders = sys.argv[1], sys.argv[2:]
counts = {"files": 0, "tips": 0, "agree": 0, "refused": 0, "not read by MuJoCo": 0}
worst = 0.0


def run(*args):
    return subprocess.run([program, *args], capture_output=True, text=True)


def rotation(vector):
    out = np.zeros(9)
    angle = np.linalg.norm(vector)
    quaternion = np.array([1.0, 0, 0, 0])
    if angle:
        mujoco.mju_axisAngle2Quat(quaternion, np.array(vector) / angle, angle)
    mujoco.mju_quat2Mat(out, quaternion)
    return out.reshape(3, 3)


def chain(model, body):
    """Joints from the base to a body, and the base."""
    joints = []
    while body:
        own = range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body])
        if any(model.jnt_type[j] in (FREE, BALL) for j in own):
            break
        joints, body = [*own, *joints], model.body_parentid[body]
    return joints, body


def compare(path, model, data, value, name, body, at, turned):
    global worst
    joints, base = chain(model, body)
    if not joints or not name or not model.body(base).name:
        return
    counts["tips"] += 1
    ron = pathlib.Path(tempfile.gettempdir()) / "kincal_agreement.ron"
    made = run("import", str(path), "--base", model.body(base).name, "--tip", name, "-o", str(ron), "--json", "-")
    if made.returncode:
        counts["refused"] += 1
        print(f"{path.name} {name}: {made.stderr.strip()}", flush=True)
        return
    names = json.loads(made.stdout)["joints"]
    assert len(names) == len(joints), (path, name, names)
    positions = ",".join(f"{n}={value[j]!r}{'rad' if model.jnt_type[j] == HINGE else 'm'}" for n, j in zip(names, joints))
    told = run("describe", str(ron), "--at", positions, "--json", "-")
    if told.returncode:
        counts["refused"] += 1
        print(f"{path.name} {name}: describe: {told.stderr.strip()}")
        return
    pose = json.loads(told.stdout)["w_from_t"][-1]
    b_from_world = data.xmat[base].reshape(3, 3).T
    off = np.abs(b_from_world @ (at - data.xpos[base]) - pose["translation_m"]).max()
    angle = np.abs(b_from_world @ turned.reshape(3, 3) - rotation(pose["rotation_rad"])).max()
    worst = max(worst, off, angle)
    if max(off, angle) < 1e-12:
        counts["agree"] += 1
    else:
        print(f"{path.name} {name}: differs by {off:.1e} m, {angle:.1e} rad")


for path in sorted(p for folder in folders for p in pathlib.Path(folder).rglob("*.xml")):
    if "<mujoco" not in path.read_text(errors="replace"):
        continue
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError:
        counts["not read by MuJoCo"] += 1  # parts that others include, and models whose meshes are elsewhere
        continue
    if not model.njnt:
        continue
    counts["files"] += 1
    random.seed(path.name)
    data = mujoco.MjData(model)
    value = {j: random.uniform(-1, 1) for j in range(model.njnt)}
    for j in range(model.njnt):
        if model.jnt_type[j] in (SLIDE, HINGE):
            data.qpos[model.jnt_qposadr[j]] = value[j]
    mujoco.mj_kinematics(model, data)
    bodies = {model.body(b).name for b in range(model.nbody)}
    tips = [(model.body(b).name, b, data.xpos[b], data.xmat[b]) for b in range(1, model.nbody)]
    for s in range(model.nsite):
        name = model.site(s).name
        name = f"site:{name}" if name and name in bodies else name
        tips.append((name, model.site_bodyid[s], data.site_xpos[s], data.site_xmat[s]))
    random.shuffle(tips)
    for tip in tips[:TIPS]:
        compare(path, model, data, value, *tip)

print(", ".join(f"{name} {n}" for name, n in counts.items()), f", largest difference {worst:.1e} (m, rad)")
