"""The physics in an exported model: a machine of MuJoCo with concealed physics, recorded, diagnosed, exported, and driven again.

    python tests/agreement/mjcf_physics.py KINCAL [NAME...]

needs the packages `mujoco` and `numpy`. KINCAL is the program. For every kind of physics a machine of `machines/` is built by `tests/worlds`,
with constant deviations and noise, and driven along two paths. `diagnose` makes a model of the recordings, `export --to mjcf` a model of MuJoCo.
Both machines then go a third path that nobody has fitted: the world as it is, the exported model with nothing but the commands and their rates
on its actuators. What is left between them, with the noise of a reading, is told in units of that noise. Status 1 where it is above 1.2.
"""
import json, pathlib, subprocess, sys, tempfile

import mujoco
import numpy as np

root = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(root / "tests/worlds"))
import paths
from machine import Machine
from paths import STEP
from plant import Bare, Drive, Plant, bodies, gains

program, only = sys.argv[1], sys.argv[2:]
folder = pathlib.Path(tempfile.mkdtemp())
EVERY, LEAD = 80, 4000  # steps between samples, and before the first


def run(*args):
    done = subprocess.run([program, *map(str, args)], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{args}: {done.stderr}")
    return done.stdout


class World:
    """A machine with stiff, balanced loops; `what` is put into the drives of the axes that it names."""

    def __init__(self, seed, name, half, noise, what, seconds):
        self.rng, self.noise, self.half, self.seconds = np.random.default_rng(seed), noise, half, seconds
        self.machine = Machine(root / f"machines/{name}.ron")
        self.masses = bodies(self.rng, self.machine)
        bare = Bare(self.machine, self.masses)
        spread = np.array([half["R" == f.kind] for f in self.machine.joints])
        self.middle = np.array([np.clip(sum(f.travel) / 2, -np.pi, np.pi) for f in self.machine.joints])
        self.spread = np.minimum(spread, [0.45 * (f.travel[1] - f.travel[0]) for f in self.machine.joints])
        inertia = bare.inertia(self.middle + self.spread * self.rng.uniform(-1, 1, (100, len(spread))))
        drives = [Drive(pace=2 * np.pi * 80, rotor=1.0, weight=1.0) for _ in self.machine.joints]
        for axis, into in what.items():
            j = self.machine.names.index(axis)
            into(drives[j], inertia[j])
        geometry = self.machine.tolerance * np.clip(self.rng.normal(size=len(self.machine.tolerance)), -2, 2)
        self.plant = Plant(self.machine, geometry, self.masses, drives, inertia, np.zeros(3))

    def path(self, style):
        """Commands on the simulator's steps."""
        at, seconds = {"blocks": paths.blocks, "waves": paths.waves}[style](self.rng, np.zeros(len(self.spread)), np.ones(len(self.spread)), self.seconds)
        lead = LEAD * STEP
        t = np.arange(0, seconds + lead, STEP)
        # Every joint comes to its first place in the direction in which it goes on: play lies on the side of the first motion.
        steps = np.sign(np.diff(at(np.arange(0, seconds, 0.1)), axis=0).round(9))
        off = 0.05 * steps[np.argmax(steps != 0, axis=0), range(len(self.spread))]
        return self.middle + self.spread * (at(t - lead) + (paths.eased(t / (0.8 * lead))[:, None] - 1) * off)

    def really(self, q):
        wanted = np.arange(LEAD, len(q), EVERY)
        self.plant.rest(q[0])
        load = self.plant.drive(self.plant.controls(q), wanted)
        return wanted, load, self.plant.read(load)[0]

    def record(self, file, q, begin):
        wanted, _, points = self.really(q)
        read = points + self.rng.normal(size=points.shape) * self.noise
        names = [f"{n}[{'rad' if f.kind == 'R' else 'm'}]" for n, f in zip(self.machine.names, self.machine.joints)]
        rows = np.column_stack([begin + wanted * STEP, q[wanted], read])
        head = f"# machine: {self.machine.name}\n# measurement: position\n" + ",".join(["t[s]", *names, "px[m]", "py[m]", "pz[m]"])
        file.write_text(head + "\n" + "\n".join(",".join(f"{x:.10g}" for x in row) for row in rows) + "\n")
        return read


class Exported:
    """A model as `export --to mjcf` writes it."""

    def __init__(self, file, machine):
        self.model = mujoco.MjModel.from_xml_path(str(file))
        self.names = machine.names

    def drive(self, q):
        """Body t in body w at the samples."""
        model, data, names = self.model, mujoco.MjData(self.model), self.names
        assert model.opt.timestep == STEP, "the paths are made for this step"
        rate = np.gradient(q, STEP, axis=0)
        for j, name in enumerate(names):
            for kind in ("", "motor of ", "drive of "):
                if (at := mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, kind + name)) >= 0:
                    data.qpos[model.jnt_qposadr[at]] = q[0, j]
        columns = [[model.actuator(f"{kind} of {n}").id for n in names] for kind in ("position", "velocity")]
        for j, (position, velocity) in enumerate(zip(*columns)):
            for i, x in ((position, q[0, j]), (velocity, 0.0)):
                if model.actuator_history[i][0]:
                    mujoco.mj_initCtrlHistory(model, data, i, None, np.full((model.actuator_history[i][0], 1), x))
        order = model.actuator_ctrladr[np.concatenate(columns)]
        controls, wanted = np.hstack([q, rate]), set(range(LEAD, len(q), EVERY))
        w, t, out = model.body("w").id, model.body("t").id, []
        look = mujoco.MjData(model)
        for k, row in enumerate(controls):
            if k in wanted:
                look.qpos[:] = data.qpos
                mujoco.mj_kinematics(model, look)
                out.append(look.xmat[w].reshape(3, 3).T @ (look.xpos[t] - look.xpos[w]))
            data.ctrl[order] = row
            mujoco.mj_step(model, data)
        return np.array(out)


def put(**what):
    def into(drive, inertia):
        for name, x in what.items():
            setattr(drive, name, x(drive, inertia) if callable(x) else x)
    return into


def soft(hertz):
    return lambda drive, inertia: inertia * (2 * np.pi * hertz) ** 2


def lost(half):
    """Coulomb friction that winds a spring and the loop up by so much."""
    return lambda drive, inertia: half / (1 / drive.spring + 1 / gains(drive, inertia)[0])


def bristles(half, way):
    """LuGre friction that winds the loop up by so much, along so long a way."""
    def law(drive, inertia):
        force = half * gains(drive, inertia)[0]
        return force, force, 0.005, force / way
    return law


MILL = {"name": "xyz_mill", "half": (0.15, 0.0), "noise": 1e-6, "seconds": 40.0}
TABLE = {"name": "ac_table_tilting", "half": (0.12, 0.9), "noise": 1e-6, "seconds": 60.0}
ARM = {"name": "hilti_jaibot", "half": (0.3, 1.0), "noise": 2e-5, "seconds": 60.0}
CASES = {
    "play": {**MILL, "what": {"x": put(play=20e-6, friction=lambda d, i: 0.3 * i)}},
    "friction": {**MILL, "what": {"y": put(spring=soft(100), friction=lost(10e-6))}},
    "friction, LuGre": {**MILL, "what": {"y": put(lugre=bristles(10e-6, 1e-3))}},
    "compliance": {**MILL, "what": {"x": put(spring=soft(8))}},
    "lag": {**MILL, "what": {"z": put(forward=0.8)}},
    "delay": {**MILL, "what": {"z": put(delay=0.004)}},
    "all of them": {**MILL, "what": {"x": put(play=15e-6, friction=lambda d, i: 0.3 * i), "y": put(lugre=bristles(8e-6, 1e-3)), "z": put(spring=soft(10), delay=0.003)}},
    "play, turning": {**TABLE, "what": {"c": put(play=100e-6, friction=lambda d, i: 4.0 * i)}},
    "compliance, weight": {**ARM, "what": {"q2": put(spring=lambda d, i: 3e5)}},
}

if __name__ == "__main__":
    bad = 0
    print(f"{'concealed':19} {'machine':17} {'at':8} {'geometry':>9} {'predict':>8} {'MuJoCo':>8}   named")
    for number, (name, case) in enumerate(CASES.items()):
        if only and name not in only:
            continue
        world = World(number + 1, **case)
        files = [folder / f"rec_{k}.csv" for k in (1, 2)]
        for k, (file, style) in enumerate(zip(files, ("waves", "blocks"))):
            world.record(file, world.path(style), 200.0 * k)
        machine, plain, model, xml, unseen = world.machine.path, *(folder / n for n in ("plain.ron", "model.ron", "model.xml", "unseen.csv"))
        run("calibrate", machine, *files, "-o", plain, "--quiet")
        told = json.loads(run("diagnose", machine, *files, "-o", model, "--json", "-", "--quiet"))
        said = json.loads(run("export", model, "--to", "mjcf", "-o", xml, "--json", "-", "--quiet"))
        q = world.path("waves")
        read = world.record(unseen, q, 0.0)
        # Three coordinates each.
        share = lambda gap: np.sqrt((gap**2).mean()) / world.noise
        predicted = [json.loads(run("predict", m, unseen, "-o", folder / "out.csv", "--json", "-", "--quiet"))["rms_m"] / np.sqrt(3) / world.noise for m in (plain, model)]
        left = share(read - Exported(xml, world.machine).drive(q))
        bad += left > 1.2
        names = [f"{f['effect']} at {f['at']}" for f in told["findings"]]
        print(f"{name:19} {world.machine.name:17} {', '.join(case['what']):8} {predicted[0]:9.2f} {predicted[1]:8.2f} {left:8.2f}   {', '.join(names) or 'nothing'}", flush=True)
        for out in said["left_out"]:
            print(f"{'':19} not in the model: {out['what']}, up to {1e6 * (out['max_m'] or 0):.1f} um: {out['because']}")
    sys.exit(int(bad > 0))
