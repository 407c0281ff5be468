"""Exudyn, forward runs: rigid bodies, revolute joints, one connector for each spring."""

from typing import Any

import exudyn
import numpy as np
from exudyn import itemInterface as items  # noqa: N813

from benchmarks.peers.problem import GROUND, Floats, Problem
from benchmarks.peers.table import Objective


def make(problem: Problem, steps: int = 100, solver: str = "GeneralizedAlpha") -> Objective:
    """As the table says. solver: a name of `exudyn.DynamicSolverType`; explicit ones only without hinges."""
    container = exudyn.SystemContainer()
    system = container.AddSystem()
    ground = system.AddObject(items.ObjectGround())
    bodies = [_body(system, problem, k) for k in range(problem.bodies)]

    def marker(body: int, at: Floats) -> Any:
        number = ground if body == GROUND else bodies[body]
        return system.AddMarker(items.MarkerBodyPosition(bodyNumber=number, localPosition=[*map(float, at), 0.0]))

    known: dict[tuple[int, float, float], Any] = {}

    def point(body: int, at: Floats) -> Any:
        key = body, float(at[0]), float(at[1])
        if key not in known:
            known[key] = marker(body, at)
        return known[key]

    def spring(one: int, two: int, i: int) -> Any:
        return system.AddObject(
            items.ObjectConnectorSpringDamper(
                markerNumbers=[point(one, problem.p[i]), point(two, problem.q[i])],
                referenceLength=float(problem.length[i]),
                stiffness=float(problem.stiffness[i]),
            )
        )

    springs: list[Any] = []
    for (one, two), part in zip(problem.groups.tolist(), problem.slices(), strict=True):
        springs += [spring(one, two, i) for i in range(part.start, part.stop)]
    for (one, two), ends in zip(problem.hinges.tolist(), problem.at, strict=True):
        system.AddObject(items.ObjectJointRevolute2D(markerNumbers=[point(one, ends[0]), point(two, ends[1])]))
    system.Assemble()
    settings, kind = settings_of(problem, steps), getattr(exudyn.DynamicSolverType, solver)
    rest = np.zeros(3 * problem.bodies)
    last: Floats | None = None

    def objective(alpha: Floats, _: bool) -> tuple[float, None]:
        nonlocal last
        if last is None or not np.array_equal(alpha, last):
            for spring, stiffness in zip(springs, (problem.stiffness * alpha).tolist(), strict=True):
                system.SetObjectParameter(spring, "stiffness", stiffness)
            last = alpha.copy()
        initial = exudyn.ConfigurationType.Initial
        system.systemData.SetODE2Coordinates(rest, configuration=initial)
        system.systemData.SetODE2Coordinates_t(rest, configuration=initial)
        if not system.SolveDynamic(settings, solverType=kind):
            raise RuntimeError("SolveDynamic did not succeed")
        pose = problem.start + np.asarray(system.systemData.GetODE2Coordinates()).reshape(-1, 3)
        return problem.energy(alpha, pose), None

    return objective


def _body(system: Any, problem: Problem, k: int) -> Any:
    (mass, _, inertia), force = problem.mass[k].tolist(), problem.force[k].tolist()
    place = items.NodeRigidBody2D(referenceCoordinates=problem.start[k].tolist())
    node = system.AddNode(place)
    body = system.AddObject(items.ObjectRigidBody2D(physicsMass=mass, physicsInertia=inertia, nodeNumber=node))
    centre = system.AddMarker(items.MarkerBodyRigid(bodyNumber=body))
    system.AddLoad(items.LoadForceVector(markerNumber=centre, loadVector=[*force[:2], 0.0]))
    system.AddLoad(items.LoadTorqueVector(markerNumber=centre, loadVector=[0.0, 0.0, force[2]]))
    return body


def settings_of(problem: Problem, steps: int) -> Any:
    """Of a run in so many steps, without files."""
    settings = exudyn.SimulationSettings()
    time = settings.timeIntegration
    time.endTime, time.numberOfSteps, time.verboseMode = problem.end, steps, 0
    time.automaticStepSize = False
    time.newton.useModifiedNewton = True
    time.newton.relativeTolerance, time.newton.absoluteTolerance = 1e-10, 1e-12
    time.generalizedAlpha.spectralRadius = 0.9
    settings.solutionSettings.writeSolutionToFile = False
    settings.solutionSettings.sensorsWritePeriod = 2.0 * problem.end
    settings.displayComputationTime = False
    settings.parallel.numberOfThreads = 1
    return settings
