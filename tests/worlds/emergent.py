"""Cases whose misfit nobody wrote down as a formula: parts of a machine of ours that Exudyn moves.

`odd_ball`: a rotary axis runs in a bearing with one ball that is too large (bearing.py). `flexible_link`: a link of an arm bends under what hangs on it (link.py). `clean`: neither. What the part does moves a
frame; readings are taken by the kinematics of machine.py. Files are those of make.py.
"""
import numpy as np

import paths
from bearing import Bearing
from link import bent
from machine import Machine, exp
from make import Course, Instrument, arm_courses, deviations, fleet, keep, record, streams
from paths import EVERY, STEP
from plant import bodies

ROUND = ["odd_ball on turns", "flexible_link on arm", "clean on turns", "odd_ball on turns", "flexible_link on arm", "clean on arm"]
REST = 40  # s between two recordings


class Carried:
    """A machine one of whose frames is moved, sample by sample: what `record` reads of it."""

    def __init__(self, machine, geometry, on_tool):
        self.machine, self.geometry, self.on_tool = machine, geometry, on_tool

    def carry(self, frame, moved):
        """The same with this frame moved: twists in itself, one row a sample."""
        self.moving = {frame: np.stack([exp(x) for x in moved])}
        return self

    def read(self, q):
        """The measured point, and the rotation of t, in w, at commands `q`."""
        w_from_t, _ = self.machine.chain(q, self.geometry, self.moving)
        return (w_from_t @ np.append(self.on_tool, 1))[:, :3], w_from_t[:, :3, :3]


def turn_courses(rng, machine, j):
    """One rotary axis turns to and fro while all others stand, a point of the tool measured in the workpiece frame: three recordings, the last one the judge's."""
    f = machine.joints[j]
    low, high = (max(f.travel[0], -13.0), min(f.travel[1], 13.0))
    rest = np.array([0.0 if g.travel[0] < 0 < g.travel[1] else sum(g.travel) / 2 for g in machine.joints])
    rest += [rng.uniform(-0.05, 0.05) if g.kind == "P" else 0.0 for g in machine.joints]
    out = []
    for _ in range(3):
        ends = np.sort(rng.uniform(low, high, 2))
        if ends[1] - ends[0] < 0.7 * (high - low):
            ends = np.array([low, high]) * rng.uniform(0.8, 0.98)
        pace = rng.uniform(0.25, 0.4)
        last = (ends[1] - ends[0]) / pace
        t = np.arange(0, min(2 * last, 100.0) + 1.0, STEP)
        x = ends[0] + (ends[1] - ends[0]) * (paths.eased(t / last) - paths.eased((t - last) / last))
        q = np.tile(rest, (len(t), 1))
        q[:, j] = x
        out.append(Course(q, np.arange(1000, len(t), EVERY)))
    return Instrument("position", np.round([rng.uniform(0.03, 0.1), rng.uniform(-0.05, 0.05), -0.02], 3), np.zeros(3)), out


def one_run(courses, j):
    """Times and commands of joint j over all recordings and the ways between them; when each recording begins."""
    times, values, starts, clock = [], [], [], 0.0
    for k, c in enumerate(courses):
        t = clock + STEP * np.arange(len(c.q))
        starts.append(clock)
        times.append(t)
        values.append(c.q[:, j])
        clock += np.ceil(len(c.q) * STEP) + REST
        if k + 1 < len(courses):
            between = np.arange(t[-1] + STEP, clock, STEP)
            times.append(between)
            values.append(c.q[-1, j] + (courses[k + 1].q[0, j] - c.q[-1, j]) * paths.eased((between - between[0]) / REST))
    return np.concatenate(times), np.concatenate(values), starts


def odd_ball(rng, f, courses, j, left):
    """What moves the frame `f` of joint j, one array of twists for each recording, and what was built; None where no plausible ball would be seen. `left`: what of such arrays stays at the instrument, m."""
    t, q, starts = one_run(courses, j)
    ball = rng.uniform(0.006, 0.012)
    bearing = Bearing(balls=int(rng.integers(9, 15)), pitch=ball * rng.uniform(7, 11), ball=ball, preload=rng.uniform(8e-6, 15e-6), odd=0.0, start=rng.uniform(-np.pi, np.pi))
    x = np.cross(f.axis, [0.3, 0.5, 0.81])
    x /= np.linalg.norm(x)
    across = np.stack([x, np.cross(f.axis, x)])

    def twists(times, middle):
        at = [start + STEP * c.wanted for start, c in zip(starts, courses)]
        return [np.hstack([np.stack([np.interp(s, times, m) for m in middle.T], 1) @ across, np.zeros((len(s), 3))]) for s in at]
    # A circle at the pace of the cage says how large the ball has to be.
    turn = bearing.start + q * (bearing.pitch - bearing.ball) / (2 * bearing.pitch)
    bearing.odd = float(np.exp(rng.uniform(*np.log([2.5e-6, 10e-6]))) / left(twists(t, 0.45 * np.stack([np.cos(turn), np.sin(turn)], 1) * 1e-6)) * 1e-6)
    if bearing.odd > 4e-5:
        return None, {}
    middle, _ = bearing.run(t[::20], q[::20])
    out = twists(t[::20], middle)
    told = {"balls": bearing.balls, "pitch_m": bearing.pitch, "ball_m": bearing.ball, "preload_m": bearing.preload, "odd_m": bearing.odd,
            "cage_per_turn": (bearing.pitch - bearing.ball) / (2 * bearing.pitch)}
    return out, told


def upright(machine):
    """Gravity in w, which stands still, m/s2."""
    w_from = machine.chain(np.zeros((1, len(machine.joints))), machine.none)[1]
    first = machine.branches["tool"][0]
    return w_from[first.name][0, :3, :3] @ first.pose[:3, :3].T @ machine.gravity


def flexible_link(machine, courses, j, masses, stiffness):
    """The frame behind the link of joint j, what moves it, and what was built."""
    f = machine.joints[j]
    frames = machine.branches["tool"]
    k = frames.index(f)
    after = frames[k + 1]
    along = after.pose[:3, 3] - f.axis * (f.axis @ after.pose[:3, 3])
    length = float(np.linalg.norm(along))
    along /= length
    plane = np.stack([along, np.cross(f.axis, along)])
    own = float(masses[f.name][0])
    out = []
    for c in courses:
        q = c.commanded()
        _, w_from = machine.chain(q, machine.none)
        turned = lambda name: w_from[name][:, :3, :3]
        # The plane of the link turns with its joint: it is that of the frame behind it, before that one turns.
        link = turned(after.name) @ after.pose[:3, :3].T
        seen = lambda v: np.einsum("ki,nji,nj->nk", plane, link, v)
        gravity = seen(np.tile(upright(machine), (len(q), 1)))
        force, moment = np.zeros((len(q), 2)), np.zeros(len(q))
        end = w_from[after.name][:, :3, 3]
        for g in frames[k + 1:]:
            mass, centre, _ = masses[g.name]
            # A body moves with the joint of its frame.
            follows = frames[frames.index(g) + 1] if g is not frames[-1] else None
            pose = w_from[follows.name] @ np.linalg.inv(follows.pose) if follows else w_from[g.name]
            arm = seen((pose @ np.append(centre, 1))[:, :3] - end)
            own_force = mass * gravity
            force += own_force
            moment += arm[:, 0] * own_force[:, 1] - arm[:, 1] * own_force[:, 0]
        tip = bent(length, own, stiffness, gravity, force, moment)
        shift, turn = tip[:, :2] @ plane, tip[:, 2:] * f.axis
        back = after.pose[:3, :3]
        out.append(np.hstack([shift @ back, turn @ back]))
    return after.name, out, {"length_m": length, "own_kg": own, "bending_Nm2": stiffness}


def fleets(folder):
    """By kind of case: arms, and machines of which a rotary axis goes round and round."""
    out = fleet(folder)
    round_ = lambda m: max((f.travel[1] - f.travel[0] for f in m.joints if f.kind == "R"), default=0) > 3 * np.pi
    return {"arm": out["arm"], "turns": [m for m in out["mill"] + [Machine(f"{folder}/rotary_axis.ron")] if round_(m)]}


def lying(machine):
    """Joints on horizontal axes with a link behind them."""
    frames, (_, w_from) = machine.branches["tool"], machine.chain(np.zeros((1, len(machine.joints))), machine.none)
    out = []
    for f, after in zip(frames, frames[1:]):
        if f.kind == "R" and np.linalg.norm(np.cross(f.axis, after.pose[:3, 3])) > 0.15 and abs(w_from[f.name][0, :3, :3] @ f.axis @ upright(machine)) < 1.0:
            out.append(machine.joints.index(f))
    return out


def attempt(rng, kind, machines):
    """A case of this kind on a machine that is drawn; None where too little of it, or too much, would be seen."""
    sort, on = kind.split(" on ")
    machine = machines[on][int(rng.integers(len(machines[on])))]
    if on == "turns":
        j = max((j for j, f in enumerate(machine.joints) if f.kind == "R"), key=lambda j: np.ptp(machine.joints[j].travel))
        instrument, courses = turn_courses(rng, machine, j)
    elif lies := lying(machine):
        j = int(rng.choice(lies))
        instrument, courses = arm_courses(rng, machine)
    else:
        return None
    geometry = machine.tolerance * np.clip(rng.normal(size=len(machine.tolerance)), -2, 2)
    scene = instrument.scene(machine, [c.part() for c in courses[:-1]], geometry)
    plant = Carried(machine, geometry, instrument.on_tool)
    none = [np.zeros((len(c.wanted), 6)) for c in courses]

    def left(frame, moved):
        """RMS that is left of it at the instrument, constant geometry projected out, m."""
        read = lambda m, c: plant.carry(frame, m).read(c.commanded())[0].ravel()
        readings = np.concatenate([read(m, c) - read(n, c) for m, n, c in zip(moved, none, courses[:-1])])
        return float(scene.rms(scene.left(readings[:, None]))[0])

    frame, moved, told = machine.joints[j].name, none, {}
    if sort == "odd_ball":
        moved, told = odd_ball(rng, machine.joints[j], courses, j, lambda moved: left(frame, moved))
        if moved is None:
            return None
    elif sort == "flexible_link":
        masses, wanted = bodies(rng, machine), np.exp(rng.uniform(*np.log([40e-6, 160e-6])))
        frame, moved, _ = flexible_link(machine, courses, j, masses, 1e5)
        # Bending goes with one over the stiffness.
        frame, moved, told = flexible_link(machine, courses, j, masses, 1e5 * left(frame, moved) / wanted)
    rms = left(frame, moved)
    if sort != "clean" and not (20e-6 if on == "arm" else 1.5e-6) < rms < (400e-6 if on == "arm" else 30e-6):
        return None
    texts, clock, name = [], 0.0, machine.names[j]
    for k, (c, m) in enumerate(zip(courses, moved)):
        text, _ = record(rng, machine, instrument, plant.carry(frame, m), c, c.commanded(), clock, 0.0 if k + 1 == len(courses) else 1.0)
        texts.append((text, deviations(machine, c, c.commanded(), clock)))
        clock += np.ceil(len(c.q) * STEP) + REST
    hidden = [] if sort == "clean" else [{"kind": sort, "at": name} | told]
    # A link lies between two joints, and moves the frame of the second.
    there = [f.joint for f in machine.joints if hidden and (f.joint == name or f.name == frame)]
    return {"machine": machine.name, "file": machine.path.name, "measurement": instrument.kind, "concealed": [[p["kind"], p["at"]] for p in hidden], "physics": hidden, "samples": len(scene.q),
            "share_and_rms_um": {n: [float(n in there), round(rms * 1e6, 3) if n in there else 0.0] for n in machine.names}, "rms_um": round(rms * 1e6, 3),
            "textbook_um": {"plain": None, "column": None, "best": None}, "texts": texts}


def make(folder, release, count, only, machines):
    fleet_ = fleets(machines)

    def made_of(index, kind):
        for number in range(60):
            if made := attempt(streams(release, 2, index, number), kind, fleet_):
                return made | {"attempts": number + 1}
        raise SystemExit(f"case {index}: {kind} cannot be put into any machine of this kind")
    keep(folder, release, only, ((f"case_{k:03}", k, ROUND[k % len(ROUND)]) for k in range(count)), made_of)
