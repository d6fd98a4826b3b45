"""Compliance in an exported model: MuJoCo's own equilibrium against what kincal predicts.

    python tests/agreement/mjcf_springs.py KINCAL

needs the package `mujoco`. KINCAL is the program. An arm with masses yields to its weight at its first joint; it is exported by --to mjcf.
With the motor and the other joint held, the joint stands where MuJoCo's passive forces (the spring) and bias forces (the weight) are in
balance. That is compared with `predict`, which counts the torque where the joint was commanded.
"""
import csv, pathlib, random, subprocess, sys, tempfile

import mujoco

program = sys.argv[1]
folder = pathlib.Path(tempfile.mkdtemp())
ARM = """Machine(name: "arm", units: (length: mm, angle: deg), workpiece: [(frame: "w")], tool: [
    (frame: "q1", joint: Revolute(axis: "y"), mass: 5, centre_of_mass: (200, 0, 0)),
    (frame: "q2", at: (400, 0, 0), joint: Revolute(axis: "y"), mass: 3, centre_of_mass: (150, 0, 20)),
    (frame: "t", at: (300, 0, 0), mass: 2, centre_of_mass: (0, 0, 30)),
], calibration: (deviations: [], unseen: [], effects: [(effect: "gravity_compliance", at: "q1", terms: [
    (value: 2e-5, parts: [(slot: Before("q1"), v: (0, 0, 0), w: (0, 1, 0), feature: Of("q1", Gravity))])])]))
"""


def run(*args):
    done = subprocess.run([program, *args], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{args}: {done.stderr}")


(folder / "arm.ron").write_text(ARM)
run("export", str(folder / "arm.ron"), "--to", "mjcf", "-o", str(folder / "arm.xml"), "--quiet")
random.seed(1)
poses = [(random.uniform(-3, 3), random.uniform(-3, 3)) for _ in range(50)]
lines = ["# machine: arm", "# measurement: joint", "q1[rad],q2[rad],q1_meas[rad]", *(f"{a!r},{b!r},{a!r}" for a, b in poses)]
(folder / "poses.csv").write_text("\n".join(lines) + "\n")
run("predict", str(folder / "arm.ron"), str(folder / "poses.csv"), "-o", str(folder / "out.csv"), "--quiet")
rows = list(csv.DictReader(line for line in (folder / "out.csv").read_text().splitlines() if not line.startswith("#")))
said = [float(row["q1_meas_model[rad]"]) - a for row, (a, _) in zip(rows, poses)]

model = mujoco.MjModel.from_xml_path(str(folder / "arm.xml"))
data = mujoco.MjData(model)
place = lambda name: (model.joint(name).qposadr[0], model.joint(name).dofadr[0])
(q1, d1), (q2, _), (motor, _) = place("q1"), place("q2"), place("motor of q1")


def surplus(at):
    data.qpos[q1] = at
    mujoco.mj_forward(model, data)
    return data.qfrc_passive[d1] - data.qfrc_bias[d1]


worst = 0.0
for (a, b), own in zip(poses, said):
    data.qpos[q2], data.qpos[motor] = b, a
    low, high = a - 0.05, a + 0.05
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if surplus(middle) > 0 else (low, middle)
    worst = max(worst, abs(low - a - own))
largest = max(map(abs, said))
print(f"poses {len(poses)}, largest deflection {largest:.2e} rad, largest difference {worst:.1e} rad ({100 * worst / largest:.2f} %)")
