"""Cases: a machine, its paths, what is concealed, what MuJoCo makes of it, and the files that hold it."""
import dataclasses
import hashlib
import json
import pathlib
import time

import numpy as np

import paths
import physics
from machine import Machine, quaternion, turned
from paths import EVERY, STEP
from physics import Scene
from plant import Bare, Drive, Plant, bodies

BAR_NOISE, ARM_NOISE, TURN_NOISE = 0.4e-6, 20e-6, 50e-6
# One round: every kind on a machine with a ballbar, the kinds that show at rest on an arm.
ROUND = [("mill", k) for k in ["clean", *physics.GROUPS]] + [("arm", k) for k in ["clean", "play", "play_held", "friction|lugre", "flex|weight", "cogging"]]
MOVE, SETTLE = np.radians(120), 1.2  # of arms: peak speed is nearly twice this mean


def streams(release, *key):
    words = np.frombuffer(hashlib.sha256(release.encode()).digest(), np.uint32)
    return np.random.default_rng(np.random.SeedSequence([int(w) for w in words], spawn_key=key))


def fleet(folder):
    machines = [Machine(p) for p in sorted(pathlib.Path(folder).glob("*.ron"))]
    mills = [m for m in machines if m.plain and m.drives_a_point()]
    arms = [m for m in machines if m.plain and not m.drives_a_point() and len(m.joints) >= 4]
    return {"mill": mills, "arm": arms}


def plan(release, fleet, count):
    """What each case is: kind of machine, machine, kind of physics."""
    out, orders = [], {"mill": [], "arm": []}
    while len(out) < count:
        rng = streams(release, 0, len(out))
        for at in rng.permutation(len(ROUND)):
            sort, kind = ROUND[at]
            if not orders[sort]:
                orders[sort] = list(rng.permutation(len(fleet[sort])))
            out.append((sort, orders[sort].pop(0), str(rng.choice(kind.split("|")))))
    return out[:count]


@dataclasses.dataclass
class Course:
    """Commands of one recording on the simulator's steps, and the steps at which samples are taken."""
    q: np.ndarray
    wanted: np.ndarray
    direction: np.ndarray | None = None  # of approach, where samples are settled positions

    def commanded(self):
        return self.q[self.wanted]

    def part(self):
        """Commands, rates, accelerations and directions at the samples."""
        q = self.commanded()
        if self.direction is not None:
            return q, np.zeros_like(q), np.zeros_like(q), self.direction
        rate = np.gradient(self.q, STEP, axis=0)
        gain = np.gradient(rate, STEP, axis=0)
        rate, gain = rate[self.wanted], gain[self.wanted]
        return q, rate, gain, physics.sides(rate)


@dataclasses.dataclass
class Instrument:
    kind: str
    on_tool: np.ndarray
    on_workpiece: np.ndarray
    length: float | None = None

    def scene(self, machine, parts, geometry):
        return Scene(machine, parts, self.on_tool, self.on_workpiece, geometry, self.kind)


def bar_courses(rng, machine):
    """A ballbar, two recordings in two styles and the judge's path; None where travel does not suffice."""
    bar = paths.Bar(rng, machine)
    styles, out = [*rng.permutation(["blocks", "waves"]), str(rng.choice(["blocks", "waves"]))], []
    for style in styles:
        found = next(filter(None, (paths.ballbar(rng, machine, bar, style) for _ in range(40))), None)
        if not found:
            return None
        q, first = found
        out.append(Course(q, np.arange(first, len(q), EVERY)))
    return Instrument("distance", bar.on_tool, bar.on_workpiece, bar.length), out


def arm_courses(rng, machine):
    """A target on the flange, one recording of settled poses and the judge's."""
    out, speeds = [], np.array([MOVE if f.kind == "R" else 0.4 for f in machine.joints])
    for n in (int(rng.integers(260, 400)), 120):
        at = np.round(paths.poses(rng, machine, n + 1), 8)
        now = int(1 / STEP)
        pieces, wanted = [np.repeat(at[:1], now, 0)], []
        for before, after in zip(at, at[1:]):
            last = max(np.max(np.abs(after - before) / speeds), 0.4)
            x = np.arange(0, last + SETTLE, STEP) / last
            pieces.append(before + paths.eased(x)[:, None] * (after - before))
            now += len(x)
            wanted.append(now - 1)
        out.append(Course(np.vstack(pieces), np.array(wanted), np.sign(np.diff(at, axis=0))))
    on_tool = np.round(rng.uniform(-0.03, 0.03, 3) + [0, 0, 0.05], 3)
    return Instrument(str(rng.choice(["position", "pose"])), on_tool, np.zeros(3)), out


def make_case(release, fleet, index, sort, which, kind):
    """Tries until something is there to be found: at an axis that carries it, and large enough."""
    machines = fleet[sort]
    for attempt in range(60):
        # After many tries another machine.
        made = attempt_case(streams(release, 1, index, attempt), machines[(which + attempt // 6) % len(machines)], sort == "mill", kind)
        if made:
            return made | {"attempts": attempt + 1}
    raise SystemExit(f"case {index}: {kind} cannot be put into any machine of this kind")


def attempt_case(rng, machine, mill, kind):
    found = bar_courses(rng, machine) if mill else arm_courses(rng, machine)
    if not found:
        return None
    instrument, courses = found
    geometry = machine.tolerance * np.clip(rng.normal(size=len(machine.tolerance)), -2, 2)
    masses = bodies(rng, machine)
    bare = Bare(machine, masses)
    parts = [c.part() for c in courses]
    scene, judge = instrument.scene(machine, parts[:-1], geometry), instrument.scene(machine, parts[-1:], geometry)
    inertia = bare.inertia(scene.q[::max(len(scene.q) // 200, 1)])
    drives = [loop(rng, f, mill) for f in machine.joints]
    told = conceal(rng, kind, mill, scene, bare, inertia, drives)
    if told is None:
        return None
    plant = Plant(machine, geometry, masses, drives, inertia, instrument.on_tool)
    loads = []
    for c in courses:
        plant.rest(c.q[0])
        loads.append(plant.drive(plant.controls(c.q), c.wanted))
        # A loop that has come loose.
        if not np.isfinite(loads[-1]).all() or np.abs(loads[-1] - c.commanded()).max() > 0.02:
            return None
    share, rms = truth(machine, scene, np.vstack([l - c.commanded() for l, c in zip(loads, courses)][:-1]))
    carried = [share[p["at"]][0] for p in told]
    if told and (max(carried) < 0.25 or min(carried) < 0.05 or carried[0] < 0.15 or rms < (1.5 if mill else 20)):
        return None
    texts, clock, read = [], 0.0, []
    for k, (course, load) in enumerate(zip(courses, loads)):
        text, readings = record(rng, machine, instrument, plant, course, load, clock, 0.0 if k + 1 == len(courses) else 1.0)
        texts.append((text, deviations(machine, course, load, clock)))
        read.append(readings.ravel())
        clock += np.ceil(len(course.q) * STEP) + 40
    return {"machine": machine.name, "file": machine.path.name, "measurement": instrument.kind,
            "concealed": [[physics.NAMED[p["kind"]], p["at"]] for p in told], "physics": told, "samples": len(scene.q), "share_and_rms_um": share, "rms_um": rms,
            "textbook_um": textbook(scene, judge, bare, told, np.concatenate(read[:-1]), read[-1]), "texts": texts}


def loop(rng, frame, mill):
    """An axis with nothing amiss. Gears make the rotors of an arm heavier than its links."""
    return Drive(pace=2 * np.pi * (rng.uniform(14, 26) if mill else rng.uniform(20, 35)),
                 rotor=rng.uniform(0.3, 1.0) if frame.kind == "P" else rng.uniform(1, 3) if mill else rng.uniform(3, 10),
                 weight=rng.uniform(0.93, 1.0) if mill else rng.uniform(0.98, 1.0))


def conceal(rng, kind, mill, scene, bare, inertia, drives):
    """Puts the kind of physics, and in one case of three another one, into the drives. None where no axis can show the first."""
    if kind == "clean":
        return []
    kinds, told, names = [kind], [], scene.machine.names
    if rng.random() < 0.35:
        others = [k for k in (physics.GROUPS if mill else physics.SETTLED) if physics.GROUPS[k] != physics.GROUPS[kind]]
        kinds.append(str(rng.choice(others)))
    free = list(rng.permutation(len(drives)))
    for k in kinds:
        wanted = float(np.exp(rng.uniform(*np.log((2.5e-6, 12e-6) if mill else (40e-6, 160e-6)))))
        for j in list(free):
            before = dataclasses.replace(drives[j])
            if what := physics.put(rng, k, j, drives[j], scene, bare, inertia[j], wanted):
                free.remove(j)
                told.append({"kind": k, "at": names[j], "wanted_um": round(wanted * 1e6, 2)} | what)
                break
            drives[j] = before
        else:
            if k == kind:
                return None
    return told


def truth(machine, scene, off):
    """What the deviations of each axis leave at the instrument: its share and RMS, and the RMS of all, um."""
    seen = scene.left(scene.seen(off))
    whole = seen.sum(1)
    share = {n: [round(float(seen[:, j] @ whole / (whole @ whole)), 4), round(float(scene.rms(seen[:, [j]])[0]) * 1e6, 3)] for j, n in enumerate(machine.names)}
    return share, round(float(scene.rms(whole[:, None])[0]) * 1e6, 3)


def record(rng, machine, instrument, plant, course, loads, clock, noise):
    """Text of a recording, and what was read less what the machine without deviations of its joints would read."""
    points, turns = plant.read(loads)
    ideal, _ = plant.read(course.commanded())
    point = lambda p: ", ".join(f"{v * 1e3:g}" for v in p)
    head = [f"# machine: {machine.name}", f"# measurement: {instrument.kind}"]
    head += [f"# tool_point[mm]: {point(instrument.on_tool)}"] * bool(np.any(instrument.on_tool))
    head += [f"# workpiece_point[mm]: {point(instrument.on_workpiece)}"] * bool(np.any(instrument.on_workpiece))
    names = ["t[s]"] + [f"{f.joint}[{'deg' if f.kind == 'R' else 'mm'}]" for f in machine.joints]
    names += [f"{n}_direction[1]" for n in machine.names] * (course.direction is not None)
    if instrument.kind == "distance":
        head.append(f"# nominal_length[mm]: {instrument.length * 1e3:g}")
        names.append("d[mm]")
        reach = lambda p: np.linalg.norm(p - instrument.on_workpiece, axis=1)
        d = reach(points) + noise * rng.normal(size=len(points)) * BAR_NOISE
        readings = d - reach(ideal)
        columns = [f"{(x - instrument.length) * 1e3:.5f}" for x in d]
    else:
        points = points + noise * rng.normal(size=points.shape) * ARM_NOISE
        readings = points - ideal
        names += ["px[mm]", "py[mm]", "pz[mm]"]
        columns = [",".join(f"{v * 1e3:.5f}" for v in p) for p in points]
        if instrument.kind == "pose":
            names += ["qw[1]", "qx[1]", "qy[1]", "qz[1]"]
            shake = noise * rng.normal(size=points.shape) * TURN_NOISE
            columns = [f"{c},{','.join(f'{v:.8f}' for v in quaternion(t @ turned(s)))}" for c, t, s in zip(columns, turns, shake)]
    lines = head + [",".join(names)]
    for k, i in enumerate(course.wanted):
        q = ",".join(f"{np.degrees(x):.6f}" if f.kind == "R" else f"{x * 1e3:.6f}" for x, f in zip(course.q[i], machine.joints))
        side = "," + ",".join(f"{int(s)}" for s in course.direction[k]) if course.direction is not None else ""
        lines.append(f"{clock + i * STEP:.4f},{q}{side},{columns[k]}")
    return "\n".join(lines) + "\n", readings


def deviations(machine, course, loads, clock):
    """Text of what every axis really did less what it was told."""
    off = (loads - course.commanded()) * 1e6
    lines = [",".join(["t[s]"] + [f"{f.joint}_off[{'urad' if f.kind == 'R' else 'um'}]" for f in machine.joints])]
    lines += [f"{clock + i * STEP:.4f}," + ",".join(f"{x:.3f}" for x in row) for i, row in zip(course.wanted, off)]
    return "\n".join(lines) + "\n"


def textbook(scene, judge, bare, told, y, z):
    """The judge's path with geometry alone, and with the one textbook column, of the axis that is at fault, that does best there. `y`, `z`: what the recordings and the path read."""
    forces = [(bare.force(s.q), bare.force(s.q, s.rate, s.gain)) for s in (scene, judge)]

    def error(shapes, j):
        a, b = ([(s.joints[:, :, j] * x[:, None]).ravel() for x in xs] for s, xs in zip((scene, judge), shapes))
        sizes = [max(np.linalg.norm(x), 1e-30) for x in a]
        left = np.column_stack([scene.columns] + [x / n for x, n in zip(a, sizes)])
        right = np.column_stack([judge.columns] + [x / n for x, n in zip(b, sizes)])
        x = np.linalg.lstsq(left, y, rcond=1e-6)[0]
        return round(float(np.sqrt(((z - right @ x) ** 2).sum() / len(judge.q)) * 1e6), 3)
    out = {"plain": error(([], []), 0), "column": None, "best": None}
    for p in told:
        j = scene.machine.names.index(p["at"])
        here, there = (s.textbook(j, f, p.get("waves")) for s, f in zip((scene, judge), forces))
        for name in here:
            e = error((here[name], there[name]), j)
            if out["best"] is None or e < out["best"]:
                out |= {"column": f"{name} of {p['at']}", "best": e}
    return out


def make(folder, release, count, only, machines):
    fleet_ = fleet(machines)
    cases = ((f"case_{index:03}", index, what) for index, what in enumerate(plan(release, fleet_, count)))
    keep(folder, release, only, cases, lambda index, what: make_case(release, fleet_, index, *what))


def keep(folder, release, only, cases, made_of):
    """Writes cases as they are made: recordings, the judge's path, what the axes did, and the answers."""
    folder = pathlib.Path(folder)
    answers = folder / "answers.json"
    known = {a["case"]: a for a in json.loads(answers.read_text())} if only and answers.exists() else {}
    for name, index, what in cases:
        if only and index not in only:
            continue
        start, made = time.time(), made_of(index, what)
        texts = made.pop("texts")
        for sub in (folder / name, folder / "axes" / name, folder / "judge"):
            sub.mkdir(parents=True, exist_ok=True)
        for k, (recording, off) in enumerate(texts):
            last = k + 1 == len(texts)
            (folder / "judge" / f"{name}.csv" if last else folder / name / f"rec_{k + 1}.csv").write_text(recording)
            (folder / "axes" / name / ("judge.csv" if last else f"rec_{k + 1}.csv")).write_text(off)
        known[name] = {"case": name, "release": release} | made
        answers.write_text(json.dumps([known[n] for n in sorted(known)], indent=1) + "\n")
        print(f"{name} {made['machine']:24} {'; '.join(p['kind'] + ' ' + p['at'] for p in made['physics']) or 'clean':28} "
              f"{made['rms_um']:8.2f} um  try {made['attempts']:2}  {time.time() - start:5.1f} s", flush=True)
