"""A link that bends, in Exudyn: an elastic line clamped to its joint, with what hangs on its end. SI throughout."""
import exudyn as exu
import numpy as np
from exudyn.beams import GenerateStraightLineANCFCable2D
from exudyn.utilities import Cable2D, Force, MarkerBodyRigid, MarkerNodePosition, SensorMarker, Torque

ELEMENTS = 6


def bent(length, own, stiffness, gravity, force, moment):
    """How the end of a link is displaced, m, along it and across, and turned, rad: n x 3, one row a pose.

    `length`, `own` mass and bending `stiffness`, N m2, of the link; in its plane, x along it, one row a pose: `gravity`, m/s2, `force` on its end, N, and `moment` there, Nm.
    """
    system = exu.SystemContainer()
    mbs = system.AddSystem()
    cable = Cable2D(physicsMassPerLength=own / length, physicsBendingStiffness=stiffness, physicsAxialStiffness=1e3 * stiffness / length**2)
    nodes, elements, *_ = GenerateStraightLineANCFCable2D(mbs, [0, 0, 0], [length, 0, 0], ELEMENTS, cable, fixedConstraintsNode0=[1, 1, 0, 1])
    # The solver's time goes from 0 to 1, one step a pose.
    now = lambda rows, time: rows[max(int(round(time * len(rows))), 1) - 1]
    for k, node in enumerate(nodes):
        # Its own weight stands at the nodes.
        mass = own / ELEMENTS * (0.5 if k in (0, ELEMENTS) else 1.0)
        mbs.AddLoad(Force(markerNumber=mbs.AddMarker(MarkerNodePosition(nodeNumber=node)), loadVector=[0, 0, 0],
                          loadVectorUserFunction=lambda _, time, __, mass=mass: [*(mass * now(gravity, time)), 0.0]))
    end = mbs.AddMarker(MarkerBodyRigid(bodyNumber=elements[-1], localPosition=[length / ELEMENTS, 0, 0]))
    mbs.AddLoad(Force(markerNumber=end, loadVector=[0, 0, 0], loadVectorUserFunction=lambda _, time, __: [*now(force, time), 0.0]))
    mbs.AddLoad(Torque(markerNumber=end, loadVector=[0, 0, 0], loadVectorUserFunction=lambda _, time, __: [0.0, 0.0, now(moment, time)]))
    watch = lambda kind: mbs.AddSensor(SensorMarker(markerNumber=end, outputVariableType=kind, storeInternal=True, writeToFile=False))
    kinds = exu.OutputVariableType
    place, turn = watch(kinds.Position), watch(kinds.Rotation)
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.staticSolver.numberOfLoadSteps, settings.staticSolver.verboseMode = len(force), 0
    settings.staticSolver.adaptiveStep, settings.staticSolver.newton.relativeTolerance = False, 1e-6
    settings.solutionSettings.writeSolutionToFile = False
    settings.solutionSettings.sensorsWritePeriod = 0.2 / len(force)
    settings.displayStatistics = False
    mbs.SolveStatic(settings)
    at, about = mbs.GetSensorStoredData(place)[-len(force):], mbs.GetSensorStoredData(turn)[-len(force):]
    return np.stack([at[:, 1] - length, at[:, 2], about[:, -1]], 1)
