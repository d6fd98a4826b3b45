"""A ball bearing with one odd ball, in Exudyn: rings, balls and what acts between them; where the balls go is its own.

Seen along the axis. Every ball is a body that rolls between two rings, pressed by Hertz's law and driven by friction alone; neighbours are held apart by a soft cage. The inner ring turns as it is told and may
move across. SI throughout.
"""
import dataclasses

import exudyn as exu
import numpy as np
from exudyn.utilities import NodeGenericODE2, ObjectGenericODE2, SensorNode

STEP = 0.02  # of the integrator, s: the balls roll slowly


@dataclasses.dataclass
class Bearing:
    balls: int
    pitch: float  # radius of the circle of the balls' centres
    ball: float  # their radius
    preload: float  # by how much every ball is too large for its place
    odd: float  # by how much more the radius of the first is
    start: float  # where that stands on the circle at first, rad
    mass: float = 40.0  # of what turns
    load: tuple = (0.0, 0.0)  # on the inner ring, N, fixed to the outer one
    stiffness: float = 1e10  # of a contact, N / m^1.5
    friction: float = 0.1
    slip: float = 1e-3  # speed up to which friction grows, m/s

    def run(self, t, turned):
        """Where the middle of the inner ring goes, m, and how far the balls have gone round, rad, while that ring is `turned`, rad, at the times `t`, s."""
        n, speed = self.balls, np.gradient(turned, t)
        radius = np.full(n, self.ball + self.preload / 2)
        at = self.start + 2 * np.pi * np.arange(n) / n
        inner, outer = self.pitch - self.ball, self.pitch + self.ball
        own = 7800 * 4 / 3 * np.pi * self.ball**3
        masses = np.concatenate([[self.mass] * 2, np.full(2 * n, own), np.full(n, 0.4 * own * self.ball**2)])
        first = np.concatenate([[0, 0], self.pitch * np.cos(at), self.pitch * np.sin(at), np.zeros(n)])
        # The odd ball grows to its size before the ring turns.
        clock = np.asarray(t) - t[0] + 0.5
        apart, damping, k, mu = 2 * np.pi / n, 300.0, self.stiffness, self.friction

        def pressed(depth, rate):
            depth = np.maximum(depth, 0)
            return np.maximum(k * depth * np.sqrt(depth) + damping * rate * (depth > 0), 0)

        def force(_, time, __, q, v):
            q, v = np.asarray(q), np.asarray(v)
            ring, rate = q[:2], v[:2]
            x, y, u, w, spin = q[2:2 + n], q[2 + n:2 + 2 * n], v[2:2 + n], v[2 + n:2 + 2 * n], v[2 + 2 * n:]
            omega = np.interp(time, clock, speed, left=0.0)
            radius[0] = radius[1] + self.odd * min(time / 0.3, 1.0)
            dx, dy = x - ring[0], y - ring[1]
            d = np.hypot(dx, dy)
            nx, ny = dx / d, dy / d
            du, dw = u - rate[0], w - rate[1]
            push = pressed(inner + radius - d, -(du * nx + dw * ny))
            rub = -mu * push * np.tanh((dw * nx - du * ny - spin * radius - omega * inner) / self.slip)
            r = np.hypot(x, y)
            ox, oy = x / r, y / r
            hold = pressed(r + radius - outer, u * ox + w * oy)
            drag = -mu * hold * np.tanh((w * ox - u * oy + spin * radius) / self.slip)
            gap = np.angle(np.exp(1j * (np.roll(np.arctan2(y, x), -1) - np.arctan2(y, x) - apart)))
            cage = 50.0 * (gap - np.roll(gap, 1))
            fx, fy = push * nx - rub * ny, push * ny + rub * nx
            return np.concatenate([
                [self.load[0] - fx.sum() - 2e3 * rate[0], self.load[1] - fy.sum() - 2e3 * rate[1]],
                fx - hold * ox - (drag + cage) * oy, fy - hold * oy + (drag + cage) * ox, radius * (drag - rub)])

        system = exu.SystemContainer()
        mbs = system.AddSystem()
        node = mbs.AddNode(NodeGenericODE2(referenceCoordinates=list(first), initialCoordinates=[0.0] * len(first), initialCoordinates_t=[0.0] * len(first), numberOfODE2Coordinates=len(first)))
        mbs.AddObject(ObjectGenericODE2(nodeNumbers=[node], massMatrix=np.diag(masses), forceUserFunction=lambda m, time, i, q, v: force(m, time, i, first + q, v)))
        sensor = mbs.AddSensor(SensorNode(nodeNumber=node, storeInternal=True, outputVariableType=exu.OutputVariableType.Coordinates, writeToFile=False))
        mbs.Assemble()
        settings = exu.SimulationSettings()
        time = settings.timeIntegration
        time.endTime = float(clock[-1])
        time.numberOfSteps = int(np.ceil(time.endTime / STEP))
        time.generalizedAlpha.spectralRadius, time.verboseMode = 0.5, 0
        time.newton.useModifiedNewton = True
        time.newton.relativeTolerance, time.newton.absoluteTolerance = 1e-6, 1e-7
        settings.solutionSettings.sensorsWritePeriod = STEP
        settings.solutionSettings.writeSolutionToFile = False
        settings.displayStatistics = False
        mbs.SolveDynamic(settings)
        seen = mbs.GetSensorStoredData(sensor)
        q = seen[:, 1:] + first
        round_ = np.unwrap(np.arctan2(q[:, 2 + n], q[:, 2]))
        pick = lambda column: np.interp(clock, seen[:, 0], column)
        return np.stack([pick(q[:, 0]), pick(q[:, 1])], 1), pick(round_) - self.start
