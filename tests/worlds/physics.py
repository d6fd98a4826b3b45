"""What is concealed: kinds of physics, how large they are made, and the textbook column of each.

A size is chosen at the instrument: the RMS that a textbook form of the effect would leave there, constant geometry projected out. What MuJoCo then makes of it is its own.
"""
import numpy as np

from plant import gains

GROUPS = {"play": "reversal", "play_held": "reversal", "friction": "reversal", "lugre": "reversal", "flex": "give", "weight": "give",
          "cogging": "wave", "delay": "late", "no_forward": "late"}
NAMED = {"play": "backlash", "play_held": "backlash", "friction": "hysteresis", "lugre": "hysteresis", "flex": "gravity_compliance",
         "weight": "gravity_compliance", "cogging": "cyclic_error", "delay": "servo_lag", "no_forward": "servo_lag"}
SETTLED = ["play", "play_held", "friction", "lugre", "flex", "weight", "cogging"]  # what shows where an arm rests


def sides(rate):
    """Direction of travel: -1 or 1, kept at rest."""
    out = np.sign(rate) * (np.abs(rate) > 1e-4 * np.abs(rate).max(0))
    for k in range(1, len(out)):
        out[k] = np.where(out[k] == 0, out[k - 1], out[k])
    return out


class Scene:
    """What the instrument sees: commands at the samples, what a displacement of each joint does there, and constant geometry to project out."""

    def __init__(self, machine, parts, on_tool, on_workpiece, geometry, kind):
        """`parts`: commands, rates, accelerations and directions of each recording."""
        self.machine, self.kind = machine, kind
        self.q, self.rate, self.gain, self.direction = (np.vstack(x) for x in zip(*parts))
        columns = machine.columns(self.q, on_tool, geometry)
        if kind == "distance":
            along = machine.point(self.q, on_tool, geometry) - on_workpiece
            along /= np.linalg.norm(along, axis=1)[:, None]
            columns = np.einsum("ni,nij->nj", along, columns)[:, None, :]
        self.joints = np.stack([columns[:, :, 6 * k:6 * k + 6] @ f.twist for k, f in enumerate(machine.frames) if f.kind], 2)
        self.columns = (columns * machine.tolerance).reshape(-1, columns.shape[2])
        u, s, _ = np.linalg.svd(self.columns, full_matrices=False)
        self.basis = u[:, s > 1e-6 * s[0]]

    def seen(self, off):
        """Readings that deviations of the joints make, n x joints, one column a joint."""
        return (self.joints * off[:, None, :]).reshape(-1, off.shape[1])

    def left(self, readings):
        return readings - self.basis @ (self.basis.T @ readings)

    def rms(self, readings):
        """Over samples, of the norm of a sample's readings."""
        return np.sqrt((readings**2).sum(0) / len(self.q))

    def unit(self, j, shape):
        """RMS left at the instrument by a deviation of joint j of this shape."""
        return float(self.rms(self.left((self.joints[:, :, j] * shape[:, None]).reshape(-1, 1)))[0])

    def textbook(self, j, force, waves=None):
        """Columns that a book would try for one joint: name to shapes. `force`: of weight alone, and of motion and weight."""
        weight, whole = force
        out = {"direction": [self.direction[:, j]], "weight": [weight[:, j]], "flank": [np.sign(weight[:, j])]}
        if self.kind == "distance":
            out |= {"velocity": [self.rate[:, j]], "acceleration": [self.gain[:, j]], "flank in motion": [np.sign(whole[:, j])]}
        if waves:
            out["wave"] = [np.sin(waves * self.q[:, j]), np.cos(waves * self.q[:, j])]
        return out


def bounds(mill, turning):
    """Least and largest play, lost motion or wave of a joint."""
    return ((5e-6, 4e-4) if turning else (1.5e-6, 8e-5)) if mill else ((2e-5, 1.5e-3) if turning else (2e-5, 5e-4))


def put(rng, kind, j, drive, scene, bare, inertia, wanted):
    """Puts the effect into the drive of joint j, and says what it did; None if this axis cannot show it."""
    joint = scene.machine.joints[j]
    mill, turning = scene.kind == "distance", joint.kind == "R"
    low, high = bounds(mill, turning)
    group = GROUPS[kind]
    if group in ("reversal", "wave"):
        waves = None
        if kind == "cogging":
            waves = float(rng.integers(12, 61)) if turning else 2 * np.pi / float(rng.uniform(0.012, 0.04))
            if scene.kind != "distance":
                waves = float(rng.integers(3, 13)) if turning else waves
        shape = np.sin(waves * scene.q[:, j]) if waves else scene.direction[:, j]
        unit = scene.unit(j, shape)
        half = np.clip(wanted / max(unit, 1e-12), low / 2, high / 2)
        if half * unit < 0.5 * wanted or np.abs(np.diff(scene.direction[:, j])).sum() < 8 and not waves:
            return None
        most = np.abs(bare.force(scene.q, scene.rate, scene.gain)[:, j]).max()
        told = {"half": float(half)}
        if kind in ("play", "play_held"):
            drive.play = 2 * half
            if kind == "play_held":
                drive.friction = 1.5 * most + 1e-3
                told["friction"] = float(drive.friction)
            # A little friction is everywhere; here it does not hold the load against all that drives it.
            else:
                drive.friction = float(rng.uniform(0.05, 0.6)) * most
                told["friction"] = float(drive.friction)
        elif kind == "friction":
            drive.spring = inertia * (2 * np.pi * float(rng.uniform(80, 120))) ** 2
            # Drive and loop both give way to it.
            drive.friction = half / (1 / drive.spring + 1 / gains(drive, inertia)[0])
            told |= {"spring": drive.spring, "friction": drive.friction}
        elif kind == "lugre":
            coulomb = gains(drive, inertia)[0] * half
            presliding = half * float(rng.uniform(0.5, 1.5))
            drive.lugre = (coulomb, coulomb * float(rng.uniform(1.1, 1.5)), float(rng.uniform(0.3, 1)) * (0.05 if turning else 0.01), coulomb / presliding)
            told |= {"coulomb": coulomb, "presliding": presliding}
        else:
            drive.cogging = (gains(drive, inertia)[0] * half, waves, float(rng.uniform(0, 6)))
            told["waves"] = waves
        return told
    if group == "give":
        force = bare.force(scene.q, scene.rate, scene.gain) if kind == "flex" and mill else bare.force(scene.q)
        unit = scene.unit(j, force[:, j])
        give = wanted / max(unit, 1e-15)
        # It has to stay a machine: no axis swings slower than this.
        slowest = 2 * np.pi * (14 if mill else 6)
        if kind == "flex":
            drive.spring = 1 / give
            pace = np.sqrt(drive.spring / inertia)
            if not slowest < pace < 2 * np.pi * 160:
                return None
        else:
            drive.stiffness, drive.weight, drive.damping = 1 / give, 0.0, 1.0
            pace = np.sqrt(drive.stiffness / inertia / (1 + drive.rotor))
            if not slowest / 2 < pace < 2 * np.pi * 60:
                return None
        return {"give": float(give)}
    unit = scene.unit(j, scene.rate[:, j])
    lag = wanted / max(unit, 1e-12)
    if kind == "delay":
        if not 0.0002 < lag < 0.03:
            return None
        drive.delay = float(lag)
    else:
        drive.forward = 1 - lag * drive.pace / (2 * drive.damping)
        if not 0.0 <= drive.forward < 0.985:
            return None
    return {"lag": float(lag)}
