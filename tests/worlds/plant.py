"""A machine of ours in MuJoCo: bodies with mass, a closed loop on every axis, and what stands between a motor and its load.

A joint with play, or with a drive that gives way, has a motor of its own, and a fixed tendon couples motor and load: limited in length (play) or with stiffness. Coulomb friction
is MuJoCo's own, on the load. LuGre friction and cogging are forces on the load, step by step.
"""
import dataclasses

import mujoco
import numpy as np

import machine as m
from paths import STEP

HARD = 'solreflimit="0.002 1" solimplimit="0.999 0.9999 0.000001"'
# Friction that holds: by default MuJoCo's creeps in proportion to the load.
HOLDS = 'solreffriction="-1 -2000" solimpfriction="0.9999 0.9999 0.000001"'


@dataclasses.dataclass
class Drive:
    """One axis: its loop, and what is between motor and load. Units N or Nm, m or rad, s."""
    pace: float  # natural frequency of the loop with all that it moves, rad/s
    rotor: float  # inertia of the motor, in that of the load
    damping: float = 0.8
    forward: float = 1.0  # share of the velocity feed-forward
    weight: float = 0.97  # share of the weight that the loop balances
    stiffness: float = 0.0  # of the loop, in place of `pace`, where it is above zero
    delay: float = 0.0
    play: float = 0.0
    spring: float = 0.0
    friction: float = 0.0
    lugre: tuple = ()  # Coulomb, static, Stribeck speed, stiffness
    cogging: tuple = ()  # force, waves per displacement, phase

    def two_masses(self):
        return bool(self.play or self.spring)


def bodies(rng, machine):
    """Mass, centre and moments of inertia of what every frame carries: the machine file's masses, else plausible ones."""
    mill = machine.drives_a_point()
    reach = sum(np.linalg.norm(f.pose[:3, 3]) for f in machine.frames)
    out = {}
    for branch, frames in machine.branches.items():
        links = 0
        for k, f in enumerate(frames):
            after = frames[k + 1].pose[:3, 3] if k + 1 < len(frames) else np.zeros(3)
            if mill:
                # What turns is nearly balanced about its pivot; what lies on a table lies over the middle of it.
                mass = rng.uniform(150, 400) if f.kind == "P" else rng.uniform(60, 140) if f.kind else rng.uniform(5, 30)
                centre = rng.uniform(-0.015, 0.015, 3)
                if f.kind == "R" and branch == "tool":
                    centre += after * rng.uniform(0.1, 0.3)
                if not f.kind and branch == "workpiece":
                    centre -= f.pose[:3, :3].T @ f.pose[:3, 3]
                size = rng.uniform(0.3, 0.45)
            else:
                mass = max(18 * reach**1.2 * 0.62**links * rng.uniform(0.8, 1.25), 0.4) if f.kind else rng.uniform(0.3, 1.0) * reach
                centre = after * rng.uniform(0.35, 0.6) + rng.uniform(-0.01, 0.01, 3) * reach
                size = 0.25 * np.linalg.norm(after) + 0.03 * reach
                links += bool(f.kind)
            if f.mass is not None:
                mass, centre = f.mass, f.centre
            out[f.name] = [mass, centre, mass * size**2 * rng.uniform(0.3, 0.5, 3) + 1e-6]
            out[f.name][2] = np.full(3, out[f.name][2].mean())
    return out


def text(machine, geometry, masses, drives, inertia):
    """MJCF. `inertia`: what each joint moves, kg or kg m2; `drives` empty: bare joints."""
    placed = machine.placed(geometry)
    write = lambda x: " ".join(repr(float(v)) for v in x)
    lines = ['<mujoco><compiler angle="radian" autolimits="true" boundmass="0"/>',
             f'<option timestep="{STEP}" integrator="implicitfast" gravity="{write(machine.gravity)}" tolerance="1e-12" iterations="60">'
             '<flag contact="disable"/></option><worldbody>']
    for frames in machine.branches.values():
        for f in frames:
            mass, centre, moments = masses[f.name]
            lines.append(f'<body name="{f.name}" pos="{write(placed[f.name][:3, 3])}" quat="{write(m.quaternion(placed[f.name][:3, :3]))}">'
                         f'<inertial pos="{write(centre)}" mass="{float(mass)!r}" diaginertia="{write(moments)}"/>')
            if f.kind:
                j = machine.joints.index(f)
                d = drives[j] if drives else None
                more = f' armature="{float(d.rotor * inertia[j])!r}"' if d and not d.two_masses() else ""
                if d and d.friction:
                    more += f' frictionloss="{float(d.friction)!r}" {HOLDS}'
                lines.append(f'<joint name="{f.joint}" type="{"slide" if f.kind == "P" else "hinge"}" axis="{write(f.axis)}"{more}/>')
        lines.append("</body>" * len(frames))
    for j, d in enumerate(drives):
        if d.two_masses():
            kind = "slide" if machine.joints[j].kind == "P" else "hinge"
            lines.append(f'<body name="motor {machine.names[j]}" gravcomp="1"><inertial pos="0 0 0" mass="1e-6" diaginertia="1e-9 1e-9 1e-9"/>'
                         f'<joint name="motor {machine.names[j]}" type="{kind}" axis="1 0 0" armature="{float(d.rotor * inertia[j])!r}"/></body>')
    lines.append("</worldbody><tendon>")
    for j, d in enumerate(drives):
        name = machine.names[j]
        both = f'<joint joint="{name}" coef="1"/><joint joint="motor {name}" coef="-1"/></fixed>'
        if d.play:
            lines.append(f'<fixed name="play {name}" limited="true" range="{float(-d.play / 2)!r} {float(d.play / 2)!r}" {HARD}>' + both)
        if d.spring:
            lines.append(f'<fixed name="spring {name}" springlength="0" stiffness="{float(d.spring)!r}" damping="{float(0.3 * np.sqrt(d.spring * inertia[j]))!r}">' + both)
    lines.append("</tendon><actuator>")
    for j, d in enumerate(drives):
        kp, kv = gains(d, inertia[j])
        lines.append(f'<position joint="{"motor " * d.two_masses()}{machine.names[j]}" kp="{kp!r}" kv="{kv!r}"/>')
    lines.append("</actuator></mujoco>")
    return "\n".join(lines)


def gains(drive, inertia):
    whole = inertia * (1 + drive.rotor)
    kp = drive.stiffness or whole * drive.pace**2
    return float(kp), 2 * drive.damping * float(np.sqrt(kp * whole))


class Bare:
    """The bodies alone: what each joint moves, and the force that a motion takes."""

    def __init__(self, machine, masses):
        self.model = mujoco.MjModel.from_xml_string(text(machine, machine.none, masses, [], None))
        self.data = mujoco.MjData(self.model)
        self.at = [self.model.joint(n).qposadr[0] for n in machine.names]

    def inertia(self, q):
        most = np.zeros(self.model.nv)
        for x in q:
            self.data.qpos[self.at] = x
            mujoco.mj_forward(self.model, self.data)
            most = np.maximum(most, self._diagonal())
        return most[self.at]

    def _diagonal(self):
        full = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self.data, full)
        return np.diag(full)

    def force(self, q, rate=None, gain=None):
        """Force on every joint that a motion takes; weight alone where it has no rates."""
        out = np.empty_like(q)
        self.data.qvel[:], self.data.qacc[:] = 0, 0
        for k, x in enumerate(q):
            self.data.qpos[self.at] = x
            if rate is not None:
                self.data.qvel[self.at], self.data.qacc[self.at] = rate[k], gain[k]
            mujoco.mj_inverse(self.model, self.data)
            out[k] = self.data.qfrc_inverse[self.at]
        return out


class Plant:
    """The machine, ready to be driven."""

    def __init__(self, machine, geometry, masses, drives, inertia, on_tool):
        self.machine, self.drives, self.bare = machine, drives, Bare(machine, masses)
        self.on_tool = on_tool
        self.model = mujoco.MjModel.from_xml_string(text(machine, geometry, masses, drives, inertia))
        self.data = mujoco.MjData(self.model)
        self.load = np.array([self.model.joint(n).qposadr[0] for n in machine.names])
        self.motor = np.array([self.model.joint("motor " * d.two_masses() + n).qposadr[0] for d, n in zip(drives, machine.names)])
        self.kp, self.kv = np.array([gains(d, i) for d, i in zip(drives, inertia)]).T
        self.states = {j: 0.0 for j, d in enumerate(drives) if d.lugre}

    def rest(self, q):
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[self.load] = q
        self.data.qpos[self.motor] = q
        self.states = {j: 0.0 for j in self.states}

    def controls(self, q):
        """What the loops are given for commands `q`, one row a step."""
        late = q.copy()
        for j, d in enumerate(self.drives):
            if d.delay:
                t = np.arange(len(q)) - d.delay / STEP
                late[:, j] = np.interp(t, np.arange(len(q)), q[:, j])
        rate = np.gradient(late, STEP, axis=0) * [d.forward for d in self.drives]
        knots = np.unique(np.append(np.arange(0, len(q), 60), len(q) - 1))
        weight = self.bare.force(q[knots]) * [d.weight for d in self.drives]
        weight = np.stack([np.interp(np.arange(len(q)), knots, w) for w in weight.T], 1)
        return late + (self.kv * rate + weight) / self.kp

    def drive(self, controls, wanted):
        """Loads at the steps `wanted` (sorted) while the loops are given `controls`."""
        model, data, step = self.model, self.data, mujoco.mj_step
        out, wanted, next_one = [], list(wanted) + [-1], 0
        forced = [(j, int(self.load[j]), d.cogging, d.lugre) for j, d in enumerate(self.drives) if d.cogging or d.lugre]
        for k, row in enumerate(controls):
            if k == wanted[next_one]:
                out.append(data.qpos[self.load])
                next_one += 1
            data.ctrl[:] = row
            for j, dof, cogging, lugre in forced:
                force = 0.0
                if cogging:
                    force += cogging[0] * np.sin(cogging[1] * data.qpos[dof] + cogging[2])
                if lugre:
                    force -= self._lugre(j, lugre, float(data.qvel[dof]))
                data.qfrc_applied[dof] = force
            step(model, data)
        return np.array(out)

    def _lugre(self, j, law, speed):
        """Bristles bend at the speed of the load and slip at the Stribeck limit; exact over a step of even speed."""
        coulomb, static, stribeck, stiffness = law
        limit = (coulomb + (static - coulomb) * np.exp(-(speed / stribeck) ** 2)) / stiffness
        z = self.states[j]
        if speed:
            end = np.copysign(limit, speed)
            z = end + (z - end) * np.exp(-abs(speed) * STEP / limit)
        self.states[j] = z
        return stiffness * z

    def read(self, q):
        """The measured point and the pose of t in w that MuJoCo's own kinematics gives for loads `q`, geometry errors within."""
        data = mujoco.MjData(self.model)
        points, turns = np.empty((len(q), 3)), np.empty((len(q), 3, 3))
        w, t = self.model.body("w").id, self.model.body("t").id
        for k, x in enumerate(q):
            data.qpos[self.load] = x
            mujoco.mj_kinematics(self.model, data)
            turn = data.xmat[w].reshape(3, 3).T
            points[k] = turn @ (data.xpos[t] + data.xmat[t].reshape(3, 3) @ self.on_tool - data.xpos[w])
            turns[k] = turn @ data.xmat[t].reshape(3, 3)
        return points, turns
