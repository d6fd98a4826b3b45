"""Exported models in MuJoCo against kincal's own forward kinematics.

    python tests/agreement/mjcf_export.py KINCAL MACHINE.ron...

needs the package `mujoco`. KINCAL is the program. Every machine gets deviations of up to 1 mm and 1 mrad, is exported by --to mjcf, and the
pose of body t as body w sees it by `mj_kinematics` is compared with `describe --at`, at random positions.
"""
import json, pathlib, random, re, subprocess, sys, tempfile

import mujoco
import numpy as np

program, machines = sys.argv[1], sys.argv[2:]
folder = pathlib.Path(tempfile.mkdtemp())
worst, agree, count = 0.0, 0, 0


def run(*args):
    done = subprocess.run([program, *args], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{args}: {done.stderr}")
    return done.stdout


def rotation(vector):
    out, angle = np.zeros(9), np.linalg.norm(vector)
    quaternion = np.array([1.0, 0, 0, 0])
    if angle:
        mujoco.mju_axisAngle2Quat(quaternion, np.array(vector) / angle, angle)
    mujoco.mju_quat2Mat(out, quaternion)
    return out.reshape(3, 3)


for machine in machines:
    random.seed(machine)
    text = pathlib.Path(machine).read_text()
    frames = re.findall(r'\(frame: "([^"]+)"', text.split("side_branches")[0])
    # In the units of the file, whatever they are: some 1e-3 of one.
    six = lambda: "({:.6f}, {:.6f}, {:.6f})".format(*(random.uniform(-1e-3, 1e-3) for _ in range(3)))
    deviations = ", ".join(f'(frame: "{f}", v: {six()}, w: {six()})' for f in frames)
    calibrated = folder / "calibrated.ron"
    calibrated.write_text(text.rstrip().removesuffix(")") + f"    calibration: (deviations: [{deviations}], unseen: []),\n)\n")
    model_file = folder / "model.xml"
    run("export", str(calibrated), "--to", "mjcf", "-o", str(model_file), "--quiet")
    model = mujoco.MjModel.from_xml_path(str(model_file))
    data = mujoco.MjData(model)
    described = json.loads(run("describe", machine, "--json", "-"))
    joints = [model.joint(j).name for j in range(model.njnt)]
    if re.search("follows", text):
        print(f"{machine}: joints that follow others are held by tendons, not by mj_kinematics: left out")
        continue
    count += 1
    value = {name: random.uniform(-1, 1) for name in joints}
    hinge = int(mujoco.mjtJoint.mjJNT_HINGE)
    unit = lambda name: "rad" if model.joint(name).type[0] == hinge else "m"
    at = ",".join(f"{name}={x!r}{unit(name)}" for name, x in value.items())
    pose = json.loads(run("describe", str(calibrated), "--at", at, "--json", "-"))["w_from_t"][-1]
    for name, x in value.items():
        data.qpos[model.joint(name).qposadr[0]] = x
    mujoco.mj_kinematics(model, data)
    w, t = model.body("w").id, model.body("t").id
    back = data.xmat[w].reshape(3, 3).T
    off = np.abs(back @ (data.xpos[t] - data.xpos[w]) - pose["translation_m"]).max()
    turned = np.abs(back @ data.xmat[t].reshape(3, 3) - rotation(pose["rotation_rad"])).max()
    worst = max(worst, off, turned)
    agree += max(off, turned) < 1e-12
    if max(off, turned) >= 1e-12:
        print(f"{machine}: differs by {off:.1e} m, {turned:.1e} rad")

print(f"machines {count}, agree {agree}, largest difference {worst:.1e} (m, rad)")
