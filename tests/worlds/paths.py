"""Where machines are sent: a ballbar along continuous paths, an arm from pose to pose.

Both give the commands of every joint on the simulator's steps. Nothing here knows a machine: linear joints follow from where the ball has to be.
"""
import numpy as np

STEP = 0.0005  # s
EVERY = 40  # steps from one sample to the next


def eased(x):
    """From 0 to 1 with speed and acceleration zero at both ends."""
    x = np.clip(x, 0, 1)
    return x**3 * (10 - 15 * x + 6 * x * x)


def ranges(machine):
    """Middle and half of the stretch that each turning joint is sent over."""
    out = []
    for f in machine.joints:
        if f.kind == "R":
            low, high = (max(f.travel[0], -2.2), min(f.travel[1], 2.2)) if f.travel[1] - f.travel[0] > 4 * np.pi else (
                max(0.85 * f.travel[0], -np.pi / 2), min(0.85 * f.travel[1], np.pi / 2))
            out.append(((low + high) / 2, (high - low) / 2))
    return np.array(out).reshape(-1, 2)


class Bar:
    """A ballbar from a point fixed to the workpiece to one fixed to the tool."""

    def __init__(self, rng, machine):
        turning = [f for f in machine.joints if f.kind == "R"]
        self.length = float(rng.choice([0.1, 0.15]))
        tables = any(f.branch == "workpiece" for f in turning)
        self.on_workpiece = np.round(np.append(rng.uniform(-0.08, 0.08, 2), 0), 3) * tables
        self.on_tool = np.round(np.array([0, 0, -rng.uniform(0, 0.04)]), 3)

    def linear(self, machine, turning, direction):
        """Commands of all joints that hold the bar at its length along `direction` (in w), turning joints given."""
        q = np.zeros((len(turning), len(machine.joints)))
        q[:, [j for j, f in enumerate(machine.joints) if f.kind == "R"]] = turning
        slides = [j for j, f in enumerate(machine.joints) if f.kind == "P"]
        at = machine.point(q, self.on_tool, machine.none)
        steps = np.empty((len(q), 3, 3))
        for k, j in enumerate(slides):
            q[:, j] = 1.0
            steps[:, :, k] = machine.point(q, self.on_tool, machine.none) - at
            q[:, j] = 0.0
        q[:, slides] = np.linalg.solve(steps, (self.on_workpiece + self.length * direction - at)[:, :, None])[:, :, 0]
        return q


def along(azimuth, elevation):
    return np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], 1)


def blocks(rng, middle, half, seconds):
    """From point to point, all together and each at rest there; some hold still for a block."""
    points, lasts = [middle + half * rng.uniform(-0.9, 0.9, len(middle))], []
    while sum(lasts) < seconds:
        new = middle + half * rng.uniform(-1, 1, len(middle))
        far = np.abs(new - points[-1]) < 0.5 * half
        new[far] = (2 * middle - new)[far]
        hold = rng.random(len(middle)) < 0.25
        new[hold] = points[-1][hold]
        points.append(new)
        lasts.append(float(max(np.abs(points[-1] - points[-2]).max() / np.radians(10), 3.0) * rng.uniform(1, 1.4)))
    starts = np.concatenate([[0], np.cumsum(lasts)])

    def at(t):
        out = np.tile(points[0], (len(t), 1))
        for k, last in enumerate(lasts):
            out += eased((t - starts[k]) / last)[:, None] * (points[k + 1] - points[k])
        return out
    return at, starts[-1]


def waves(rng, middle, half, seconds):
    """To and fro without a rest, each at its own pace; the pace itself is eased in and out."""
    n = len(middle)
    periods = rng.permutation(np.geomspace(18, 40, max(n, 2)))[:n] * rng.uniform(0.9, 1.1, n)
    phases, big, small = rng.uniform(0, 2 * np.pi, n), half * rng.uniform(0.6, 0.8, n), half * rng.uniform(0.05, 0.2, n)

    def at(t):
        ramp = 3.0
        x = np.clip(t, 0, seconds)
        rise = lambda u: ramp * (lambda s: 2.5 * s**4 - 3 * s**5 + s**6)(np.clip(u / ramp, 0, 1))
        tau = x - (np.minimum(x, ramp) - rise(x)) - (np.maximum(x - seconds + ramp, 0) - (ramp / 2 - rise(seconds - x)) * (x > seconds - ramp))
        turns = 2 * np.pi * tau[:, None] / periods + phases
        return middle + big * np.sin(turns) + small * np.sin(2.6 * turns)
    return at, seconds


def ballbar(rng, machine, bar, style, seconds=58.0):
    """Commands on the simulator's steps, and the step from which samples are taken. None where travel does not suffice."""
    turning = ranges(machine)
    reach = rng.uniform(0.55, 0.95, len(turning)) if len(turning) else np.zeros(0)
    spin = np.array([[rng.uniform(-np.pi, np.pi), rng.uniform(0.8, 2.4) if len(turning) else np.pi], [np.radians(35), np.radians(rng.uniform(10, 25))]])
    middle = np.concatenate([turning[:, 0] + turning[:, 1] * (1 - reach) * rng.uniform(-1, 1, len(turning)), spin[:, 0]])
    half = np.concatenate([turning[:, 1] * reach, spin[:, 1]])
    at, seconds = {"blocks": blocks, "waves": waves}[style](rng, middle, half, seconds)
    n = len(turning)

    def commands(t):
        u = at(t)
        return bar.linear(machine, u[:, :n], along(u[:, n], u[:, n + 1]))
    slow = 1.0
    coarse = np.arange(0, seconds, 0.05)
    q = commands(coarse)
    for j, f in enumerate(machine.joints):
        speed, rate = (0.075, 0.15) if f.kind == "P" else (np.radians(22), np.radians(40))
        slow = max(slow, np.abs(np.diff(q[:, j])).max() / 0.05 / speed, np.sqrt(np.abs(np.diff(q[:, j], 2)).max() / 0.05**2 / rate))
        if q[:, j].min() < f.travel[0] or q[:, j].max() > f.travel[1]:
            return None
    if seconds * slow > 130:
        return None
    run = commands(np.arange(0, seconds + 0.3 / slow, STEP / slow))
    # Every joint comes from a little beside its first place, and rests before and after.
    off = np.array([(np.radians(0.6) if f.kind == "R" else 0.003) * rng.choice([-1, 1]) for f in machine.joints])
    near = run[0] + (eased(np.arange(-1.0, 2.5, STEP) / 1.5)[:, None] - 1) * off
    return np.vstack([near, run]), len(near)


def poses(rng, machine, n):
    """Settled poses of an arm, one far from the other."""
    out = []
    for f in machine.joints:
        low, high = f.travel
        if f.kind == "R":
            middle = np.clip((low + high) / 2, -np.pi, np.pi)
            half = min(0.75 * (high - low) / 2, np.radians(140))
        else:
            middle, half = (low + high) / 2, 0.4 * (high - low)
        out.append(middle + half * rng.uniform(-1, 1, n))
    return np.stack(out, 1)
