"""What a short script does with the same recordings: one effect at a time by share, stepwise by BIC, LASSO.

All three know the noise, use the same dictionary of textbook columns at every joint, and fit constant geometry beside them, held by its tolerances. They read positions only.
"""
import csv

import numpy as np

from machine import Machine, inverse
from physics import Scene, sides

UNITS = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "rad": 1.0, "deg": np.pi / 180, "s": 1.0, "1": 1.0}
THIN = 4  # of the samples along a path the rivals take one in four: neighbours say nearly the same
NOISE = {"distance": 0.4e-6, "position": 20e-6, "pose": 20e-6}


def read(path):
    """Header and columns of a recording, SI."""
    lines = path.read_text().splitlines()
    head = dict(l[2:].split(": ", 1) for l in lines if l.startswith("#"))
    rows = list(csv.reader(l for l in lines if not l.startswith("#")))
    names, units = zip(*(n[:-1].split("[") for n in rows[0]))
    return head, dict(zip(names, np.array(rows[1:], float).T * np.array([UNITS[u] for u in units])[:, None]))


class Seen:
    """Recordings of one machine: what was commanded, how it went there, and what was read."""

    def __init__(self, machine, files):
        self.machine, parts, readings, self.starts = machine, [], [], [0]
        for path in files:
            head, c = read(path)
            point = lambda key: np.array([float(x) for x in head.get(f"{key}[mm]", "0, 0, 0").split(",")]) * 1e-3
            self.kind = head["measurement"]
            self.on_tool, self.on_workpiece = point("tool_point"), point("workpiece_point")
            if self.kind == "distance":
                c = {n: x[::THIN] for n, x in c.items()}
            q = np.stack([c[n] for n in machine.names], 1)
            if self.kind == "distance":
                rate = np.gradient(q, c["t"], axis=0)
                gain = np.gradient(rate, c["t"], axis=0)
                side = sides(rate)
                readings.append(c["d"] + float(head["nominal_length[mm]"]) * 1e-3)
            else:
                rate = gain = np.zeros_like(q)
                side = np.stack([c[f"{n}_direction"] for n in machine.names], 1)
                readings.append(np.stack([c["px"], c["py"], c["pz"]], 1).ravel())
            parts.append((q, rate, gain, side))
            self.starts.append(self.starts[-1] + len(q))
        self.parts, self.y = parts, np.concatenate(readings)

    def model(self, geometry):
        """What the machine with this geometry reads, and the scene about it."""
        scene = Scene(self.machine, self.parts, self.on_tool, self.on_workpiece, geometry, "distance" if self.kind == "distance" else "position")
        p = self.machine.point(scene.q, self.on_tool, geometry)
        return (np.linalg.norm(p - self.on_workpiece, axis=1) if self.kind == "distance" else p.ravel()), scene


def loads(machine, q):
    """For every turning joint: torque of its own body's first moment (two columns), and of 1 kg at each frame beyond."""
    _, at = machine.chain(q, machine.none)
    first = machine.frames[0]
    base = at[first.name] @ inverse(first.pose[None])
    pull, out = base[:, :3, :3] @ machine.gravity, {}
    for frames in machine.branches.values():
        for k, f in enumerate(frames):
            if f.kind != "R":
                continue
            j, turn = machine.joints.index(f), at[f.name]
            axis = turn[:, :3, :3] @ f.axis
            across = np.linalg.svd(f.axis[None])[2][1:]
            spin = [np.cos(q[:, j]), np.sin(q[:, j])]
            own = []
            for s, c in ((0, 1), (1, 0)):
                arm = spin[s][:, None] * across[0] + (1 if s == 0 else -1) * spin[c][:, None] * across[1]
                own.append(np.einsum("ni,ni->n", axis, np.cross(np.einsum("nij,nj->ni", turn[:, :3, :3], arm), pull)))
            far = [np.einsum("ni,ni->n", axis, np.cross(at[g.name][:, :3, 3] - turn[:, :3, 3], pull)) for g in frames[k + 1:]]
            far = [x for x in far if np.abs(x).max() > 1e-3]
            out[j] = own, far
    return out


def dictionary(seen, scene, fitted=None):
    """(name, joint, shapes) of every candidate. `fitted`: the travel of the recordings that were fitted."""
    machine, out = seen.machine, []
    travel = fitted or [(scene.q[:, j].min(), max(np.ptp(scene.q[:, j]), 1e-9)) for j in range(len(machine.joints))]
    weights = loads(machine, scene.q)
    for j, f in enumerate(machine.joints):
        q, side, turning = scene.q[:, j], scene.direction[:, j], f.kind == "R"
        low, extent = travel[j]
        s = np.clip(2 * (q - low) / extent - 1, -1, 1)
        out += [("backlash", j, [side]), ("positioning_error", j, [np.cos(n * np.arccos(s)) for n in (2, 3, 4, 5)])]
        if scene.kind == "distance":
            taken = []
            for length in np.radians([1, 4, 12]) if turning else (0.002, 0.008, 0.02):
                h = np.empty_like(q)
                for a, b in zip(seen.starts, seen.starts[1:]):
                    now = side[a]
                    for k in range(a, b):
                        now = side[k] + (now - side[k]) * np.exp(-abs(q[k] - q[max(k - 1, a)]) / length)
                        h[k] = now
                taken.append(h)
            out += [("hysteresis", j, taken), ("servo_lag", j, [scene.rate[:, j]]), ("inertial_error", j, [scene.gain[:, j]])]
        if turning:
            own, far = weights[j]
            out.append(("gravity_compliance", j, own + far))
            if far:
                out.append(("gravity_backlash", j, [np.sign(sum(far))]))
            out.append(("encoder_eccentricity", j, [np.sin(q), np.cos(q)]))
        for n in (range(2, 73) if scene.kind == "distance" else range(2, 25)) if turning else 2 * np.pi * np.arange(2, max(int(extent / 0.008), 2) * 4) / extent / 4:
            out.append(("cyclic_error", j, [np.sin(n * q), np.cos(n * q)]))
    return out, travel


def columns(scene, candidates):
    return [np.stack([(scene.joints[:, :, j] * x[:, None]).ravel() for x in shapes], 1) for _, j, shapes in candidates]


def orthonormal(a):
    u, s, _ = np.linalg.svd(a, full_matrices=False)
    return u[:, s > 1e-6 * max(s[0], 1e-30)]


def gains(x, edges, rest):
    """By how much each block would lower the sum of squares, and its rank."""
    out, ranks = np.zeros(len(edges)), np.zeros(len(edges), int)
    right = x.T @ rest
    for k, (a, b) in enumerate(edges):
        d, v = np.linalg.eigh(x[:, a:b].T @ x[:, a:b])
        good = d > 1e-10 * len(rest)
        out[k], ranks[k] = ((v.T[good] @ right[a:b]) ** 2 / d[good]).sum(), good.sum()
    return out, ranks


def laid_out(blocks):
    """All columns side by side, each of RMS one before anything is taken out, and where each block lies."""
    x = np.hstack(blocks)
    ends = np.cumsum([b.shape[1] for b in blocks])
    return x / (np.sqrt((x**2).mean(0)) + 1e-30), [(e - b.shape[1], e) for e, b in zip(ends, blocks)]


def greedy(y, blocks, noise):
    """Largest share of what is left, as long as it is 5 % of it."""
    x, edges = laid_out(blocks)
    chosen, rest = [], y
    while len(chosen) < 5 and (rest @ rest) / len(rest) > 1.1 * noise**2:
        gain, _ = gains(x, edges, rest)
        gain[chosen] = 0
        k = int(np.argmax(gain))
        if gain[k] < 0.05 * (rest @ rest):
            break
        chosen.append(k)
        u = orthonormal(x[:, slice(*edges[k])])
        rest, x = rest - u @ (u.T @ rest), x - u @ (u.T @ x)
    return chosen


def stepwise(y, blocks, noise):
    """Adds what lowers BIC most, drops what BIC does not miss, until neither helps."""
    x, edges = laid_out(blocks)
    n = len(y)
    bic = lambda squares, k: n * np.log(np.maximum(squares / n, 1e-30)) + k * np.log(n)

    def fit(some):
        u = orthonormal(np.hstack([x[:, slice(*edges[k])] for k in some])) if some else np.zeros((n, 0))
        rest = y - u @ (u.T @ y)
        return bic(rest @ rest, u.shape[1]), rest, u
    chosen, (best, rest, u) = [], fit([])
    while len(chosen) < 12:
        gain, ranks = gains(x - u @ (u.T @ x), edges, rest)
        trial = bic(rest @ rest - gain, u.shape[1] + ranks)
        trial[chosen] = np.inf
        k = int(np.argmin(trial))
        if trial[k] >= best:
            break
        chosen.append(k)
        best, rest, u = fit(chosen)
        for j in list(chosen):
            less = fit([i for i in chosen if i != j])
            if less[0] < best:
                chosen.remove(j)
                best, rest, u = less
    return chosen


def lasso(y, blocks, noise, folds=5):
    """Coordinate descent; its penalty by stretches left out. Returns coefficients of all columns."""
    x = np.hstack(blocks)
    scale = np.sqrt((x**2).sum(0) / len(y)) + 1e-30
    x = x / scale
    cuts = np.linspace(0, len(y), folds + 1).astype(int)
    grams = [(x[a:b].T @ x[a:b], x[a:b].T @ y[a:b]) for a, b in zip(cuts, cuts[1:])]
    whole = sum(g for g, _ in grams), sum(h for _, h in grams)
    path = np.abs(whole[1]).max() * np.geomspace(1, 2e-3, 25)

    def descend(gram, right, penalty, w):
        diagonal = np.maximum(np.diag(gram), 1e-12)
        slope = right - gram @ w
        for _ in range(60):
            most = 0.0
            active = np.flatnonzero((np.abs(slope) > penalty) | (w != 0))
            for k in active:
                z = slope[k] + diagonal[k] * w[k]
                new = np.sign(z) * max(abs(z) - penalty, 0) / diagonal[k]
                if new != w[k]:
                    slope -= gram[:, k] * (new - w[k])
                    most = max(most, abs(new - w[k]) * np.sqrt(diagonal[k] / len(y)))
                    w[k] = new
            if most < 1e-3 * noise:
                break
        return w
    errors = np.zeros(len(path))
    for (a, b), (g, h) in zip(zip(cuts, cuts[1:]), grams):
        w = np.zeros(x.shape[1])
        for k, p in enumerate(path):
            w = descend(whole[0] - g, whole[1] - h, p * (1 - 1 / folds), w)
            errors[k] += ((y[a:b] - x[a:b] @ w) ** 2).sum()
    w = np.zeros(x.shape[1])
    for p in path[:int(np.argmin(errors)) + 1]:
        w = descend(whole[0], whole[1], p, w)
    return w / scale


def compete(folder, machines, answer):
    """What each rival tells, and its error on the judge's path: name to (told, plain, with effects), um."""
    machine = Machine(f"{machines}/{answer['file']}")
    seen = Seen(machine, sorted((folder / answer["case"]).glob("rec_*.csv")))
    path = Seen(machine, [folder / "judge" / f"{answer['case']}.csv"])
    noise, geometry, ridge = NOISE[seen.kind], machine.none, np.eye(len(machine.none))
    for _ in range(4):
        ideal, scene = seen.model(geometry)
        a = np.vstack([scene.columns / noise, ridge])
        b = np.concatenate([(seen.y - ideal) / noise, -geometry / machine.tolerance])
        geometry = geometry + machine.tolerance * np.linalg.lstsq(a, b, rcond=None)[0]
    ideal, scene = seen.model(geometry)
    there, judge = path.model(geometry)
    candidates, travel = dictionary(seen, scene)
    others, _ = dictionary(path, judge, travel)
    left, right = columns(scene, candidates), columns(judge, others)
    y, z = seen.y - ideal, path.y - there
    size = lambda r: float(np.sqrt((r**2).sum() / len(judge.q)) * 1e6)
    free = [scene.left(b) for b in left]
    rest, out = scene.left(y), {}
    for name, choose in (("by share", greedy), ("BIC stepwise", stepwise)):
        chosen = choose(rest, free, noise)
        k = scene.columns.shape[1]
        some = np.hstack([left[c] for c in chosen]) if chosen else np.zeros((len(y), 0))
        norm = np.linalg.norm(some, axis=0) + 1e-30
        x = np.linalg.lstsq(np.vstack([np.hstack([scene.columns, some / norm]) / noise, np.eye(k, k + some.shape[1])]),
                            np.concatenate([y / noise, -geometry / machine.tolerance]), rcond=1e-9)[0]
        those = np.hstack([judge.columns] + [right[c] for c in chosen])
        told = [(candidates[c][0], machine.names[candidates[c][1]]) for c in chosen]
        out[name] = told, size(z), size(z - those @ (x / np.concatenate([np.ones(k), norm])))
    w = lasso(rest, free, noise)
    ends = np.cumsum([b.shape[1] for b in left])
    parts = [w[e - b.shape[1]:e] for e, b in zip(ends, left)]
    sizes = np.array([np.linalg.norm(f @ p) for f, p in zip(free, parts)])
    # It keeps many crumbs; what is told is a tenth of the misfit or more.
    told = [(candidates[k][0], machine.names[candidates[k][1]]) for k in np.argsort(-sizes) if sizes[k] > 0.1 * np.linalg.norm(rest)]
    fitted, foretold = sum(b @ p for b, p in zip(left, parts)), sum(b @ p for b, p in zip(right, parts))
    x = np.linalg.lstsq(np.vstack([scene.columns / noise, ridge]), np.concatenate([(y - fitted) / noise, -geometry / machine.tolerance]), rcond=None)[0]
    out["LASSO"] = told, size(z), size(z - foretold - judge.columns @ x)
    return out
