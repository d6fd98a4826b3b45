"""A machine of ours, read from its file: where frames stand, what joints move, and what every small deviation does at the instrument.

SI throughout. Poses are 4 x 4 matrices, stacks of them n x 4 x 4. Twists are (v; w), linear first.
"""
import pathlib

import numpy as np

import ron

LENGTHS = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "nm": 1e-9, "in": 0.0254}
ANGLES = {"rad": 1.0, "mrad": 1e-3, "urad": 1e-6, "deg": np.pi / 180, "arcsec": np.pi / 648000}


def hat(w):
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def turned(w):
    """Rotation matrix of a rotation vector."""
    angle = np.linalg.norm(w)
    if angle < 1e-12:
        return np.eye(3) + hat(w)
    k = hat(w / angle)
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def exp(twist):
    """Pose of a twist (v; w)."""
    v, w = np.asarray(twist[:3], float), np.asarray(twist[3:], float)
    angle, k = np.linalg.norm(w), hat(w)
    if angle < 1e-8:
        left = np.eye(3) + k / 2
    else:
        left = np.eye(3) + (1 - np.cos(angle)) / angle**2 * k + (angle - np.sin(angle)) / angle**3 * k @ k
    return pose(left @ v, turned(w))


def pose(at, rotation=np.eye(3)):
    out = np.eye(4)
    out[:3, 3], out[:3, :3] = at, rotation
    return out


def quaternion(rotation):
    """Unit quaternion (w, x, y, z) of a rotation matrix, by its largest component."""
    r = rotation
    four = np.array([1 + r[0, 0] + r[1, 1] + r[2, 2], 1 + r[0, 0] - r[1, 1] - r[2, 2],
                     1 - r[0, 0] + r[1, 1] - r[2, 2], 1 - r[0, 0] - r[1, 1] + r[2, 2]])
    k, s = int(np.argmax(four)), np.sqrt(four.max()) / 2
    q = np.array([[4 * s * s, r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]],
                  [r[2, 1] - r[1, 2], 4 * s * s, r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]],
                  [r[0, 2] - r[2, 0], r[0, 1] + r[1, 0], 4 * s * s, r[1, 2] + r[2, 1]],
                  [r[1, 0] - r[0, 1], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], 4 * s * s]][k]) / (4 * s)
    return q / np.linalg.norm(q)


class Frame:
    """One dyad: `pose` in the frame before it, and its joint, if it has one (`kind` "R" or "P", `axis`, `travel`)."""

    def __init__(self, dyad, branch, length, angle, tolerance):
        self.name, self.branch = dyad["frame"], branch
        self.pose = np.eye(4)
        if "moves" in dyad:
            for move in dyad["moves"]:
                unit = np.eye(3)["xyz".index(move["_"][1])]
                x = move["values"][0]
                self.pose = self.pose @ (pose(unit * x * length) if move["_"][0] == "T" else pose(np.zeros(3), turned(unit * x * angle)))
        else:
            at = np.array(dyad.get("at", [0, 0, 0]), float) * length
            self.pose = pose(at, turned(np.array(dyad.get("rotation", [0, 0, 0]), float) * angle))
        own = dyad.get("tolerance", {})
        self.tolerance = np.repeat([own.get("translation", tolerance[0]) * length, own.get("rotation", tolerance[1]) * angle], 3)
        self.mass = dyad.get("mass")
        self.centre = np.array(dyad.get("centre_of_mass", [0, 0, 0]), float) * length
        joint = dyad.get("joint")
        self.kind = joint and joint["_"][0]
        if joint:
            axis = joint["axis"]
            self.axis = np.eye(3)["xyz".index(axis[-1])] * (-1 if axis[0] == "-" else 1) if isinstance(axis, str) else np.array(axis)
            self.joint = joint.get("name", self.name)
            self.follows = "follows" in joint
            unit = angle if self.kind == "R" else length
            self.travel = tuple(x * unit for x in joint.get("travel", (-1e9, 1e9)))
            self.twist = np.concatenate([np.zeros(3), self.axis] if self.kind == "R" else [self.axis, np.zeros(3)])


class Machine:
    def __init__(self, path):
        path = pathlib.Path(path)
        file = ron.read(path.read_text())
        length, angle = LENGTHS[file["units"]["length"]], ANGLES[file["units"]["angle"]]
        t = file.get("tolerance", {})
        tolerance = t.get("translation", 1e-4 / length), t.get("rotation", 5e-4 / angle)
        self.path, self.name = path, file["name"]
        self.gravity = np.array(file.get("gravity", [0, 0, -1]), float)
        self.gravity *= 9.81 / np.linalg.norm(self.gravity)
        self.branches = {b: [Frame(d, b, length, angle, tolerance) for d in file[b]] for b in ("workpiece", "tool")}
        self.frames = self.branches["workpiece"] + self.branches["tool"]
        self.joints = [f for f in self.frames if f.kind]
        self.names = [f.joint for f in self.joints]
        self.plain = not any(f.follows for f in self.joints) and not file.get("side_branches")
        self.tolerance = np.concatenate([f.tolerance for f in self.frames])
        self.none = np.zeros(6 * len(self.frames))

    def placed(self, geometry):
        """Pose of every frame in the one before it, with its constant deviation."""
        return {f.name: f.pose @ exp(geometry[6 * k:6 * k + 6]) for k, f in enumerate(self.frames)}

    def chain(self, q, geometry, moving={}):
        """w_from_t and, for every frame, w from that frame before its joint. `q`: n x joints; `moving`: poses (n x 4 x 4) by which frames are moved besides, in themselves."""
        placed, at, n = self.placed(geometry), {}, len(q)
        ends = {}
        for branch, frames in self.branches.items():
            now = np.broadcast_to(np.eye(4), (n, 4, 4))
            for f in frames:
                now = now @ placed[f.name] @ moving.get(f.name, np.eye(4))
                at[f.name] = now
                if f.kind:
                    x, motion = q[:, self.joints.index(f)], np.broadcast_to(np.eye(4), (n, 4, 4)).copy()
                    if f.kind == "P":
                        motion[:, :3, 3] = x[:, None] * f.axis
                    else:
                        k = hat(f.axis)
                        motion[:, :3, :3] = np.eye(3) + np.sin(x)[:, None, None] * k + (1 - np.cos(x))[:, None, None] * (k @ k)
                    now = now @ motion
            ends[branch] = now
        w_from_b = inverse(ends["workpiece"])
        return w_from_b @ ends["tool"], {name: w_from_b @ b_from for name, b_from in at.items()}

    def point(self, q, tool_point, geometry):
        """The measured point in frame w, n x 3."""
        return (self.chain(q, geometry)[0] @ np.append(tool_point, 1))[:, :3]

    def columns(self, q, tool_point, geometry):
        """What a small constant deviation of every frame does to the measured point in w: n x 3 x (6 frames)."""
        w_from_t, at = self.chain(q, geometry)
        p_w, out = (w_from_t @ np.append(tool_point, 1))[:, :3], np.empty((len(q), 3, 6 * len(self.frames)))
        for k, f in enumerate(self.frames):
            sign = 1 if f.branch == "tool" else -1
            turn, arm = at[f.name][:, :3, :3], p_w - at[f.name][:, :3, 3]
            for i in range(3):
                out[:, :, 6 * k + i] = sign * turn[:, :, i]
                out[:, :, 6 * k + 3 + i] = sign * np.cross(turn[:, :, i], arm)
        return out

    def of_joints(self, columns):
        """Out of those: what a small displacement of every joint does, n x 3 x joints."""
        return np.stack([columns[:, :, 6 * k:6 * k + 6] @ f.twist for k, f in enumerate(self.frames) if f.kind], 2)

    def drives_a_point(self):
        """Three linear joints place the measured point wherever turning joints stand: what a ballbar is driven along."""
        linear = [j for j, f in enumerate(self.joints) if f.kind == "P"]
        if len(linear) != 3:
            return False
        q = np.zeros((1, len(self.joints)))
        return abs(np.linalg.det(self.of_joints(self.columns(q, np.zeros(3), self.none))[0][:, linear])) > 0.3


def inverse(poses):
    out = np.broadcast_to(np.eye(4), poses.shape).copy()
    turn = np.swapaxes(poses[:, :3, :3], 1, 2)
    out[:, :3, :3], out[:, :3, 3] = turn, -(turn @ poses[:, :3, 3:])[:, :, 0]
    return out
