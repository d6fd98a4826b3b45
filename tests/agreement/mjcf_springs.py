"""Compliance in an exported model: MuJoCo's own equilibrium against what kincal predicts.

    python tests/agreement/mjcf_springs.py KINCAL

needs the package `mujoco`. KINCAL is the program. An arm yields to its weight at its first joint, with masses that its file states, with others
besides them, and with masses that nobody states; it is exported by --to mjcf. With the motor and the other joint held, the joint stands where
MuJoCo's passive forces (the spring) and bias forces (the weight) are in balance. That is compared with `predict`, which counts the torque where
the joint was commanded.
"""
import csv, pathlib, random, subprocess, sys, tempfile

import mujoco

program = sys.argv[1]
folder = pathlib.Path(tempfile.mkdtemp())
STATED = ["mass: 5, centre_of_mass: (200, 0, 0)", "mass: 3, centre_of_mass: (150, 0, 20)", "mass: 2, centre_of_mass: (0, 0, 30)"]
GRAVITY = {"Gravity": 2e-5}
OTHERS = {"Gravity": 2e-5, "Load": 5e-5, "Lever(0, 0)": -1e-5, "Lever(0, 1)": 2e-5, "Lever(1, 0)": 6e-6, "Lever(1, 1)": -8e-6}
CASES = {"masses stated": (STATED, GRAVITY), "and others": (STATED, OTHERS), "none stated": ([""] * 3, GRAVITY), "none, and others": ([""] * 3, OTHERS)}


def run(*args):
    done = subprocess.run([program, *args], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{args}: {done.stderr}")
    return done.stdout


def arm(masses, terms):
    one, two, three = (f", {mass}" if mass else "" for mass in masses)
    terms = ", ".join(f'(value: {value!r}, parts: [(slot: Before("q1"), v: (0, 0, 0), w: (0, 1, 0), feature: Of("q1", {feature}))])' for feature, value in terms.items())
    return f"""Machine(name: "arm", units: (length: mm, angle: deg), workpiece: [(frame: "w")], tool: [
    (frame: "q1", joint: Revolute(axis: "y"){one}),
    (frame: "q2", at: (400, 0, 0), joint: Revolute(axis: "y"){two}),
    (frame: "t", at: (300, 0, 0){three}),
], calibration: (deviations: [], unseen: [], effects: [(effect: "gravity_compliance", at: "q1", terms: [{terms}])]))
"""


bad = False
for name, (masses, terms) in CASES.items():
    (folder / "arm.ron").write_text(arm(masses, terms))
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
    place = lambda joint: (model.joint(joint).qposadr[0], model.joint(joint).dofadr[0])
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
    bad |= worst > 2e-3 * largest
    print(f"{name:17} poses {len(poses)}, largest deflection {largest:.2e} rad, largest difference {worst:.1e} rad ({100 * worst / largest:.2f} %)")
sys.exit(int(bad))
