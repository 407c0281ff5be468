"""Exudyn in space, forward runs: rigid bodies, spherical joints, one connector for each spring."""

from typing import Any

import exudyn
import numpy as np
from exudyn import itemInterface as items  # noqa: N813

from benchmarks.peers.exudyn_forward import settings_of
from benchmarks.peers.problem import GROUND, Floats
from benchmarks.peers.space_problem import SpatialProblem, rotation
from benchmarks.peers.table import Objective

#: nodes of bodies by solver: explicit ones move on the rotation group, implicit ones by Euler parameters
NODES = {"GeneralizedAlpha": items.NodeRigidBodyEP}


def make(problem: SpatialProblem, steps: int = 100, solver: str = "GeneralizedAlpha") -> Objective:
    """As the table says. solver: a name of `exudyn.DynamicSolverType`; explicit ones only without joints."""
    container = exudyn.SystemContainer()
    system = container.AddSystem()
    ground = system.AddObject(items.ObjectGround())
    made = [_body(system, problem, k, NODES.get(solver, items.NodeRigidBodyRotVecLG)) for k in range(problem.bodies)]
    known: dict[tuple[int, ...], Any] = {}

    def point(body: int, at: Floats) -> Any:
        key = body, *at.tolist()
        if key not in known:
            number = ground if body == GROUND else made[body][1]
            known[key] = system.AddMarker(items.MarkerBodyPosition(bodyNumber=number, localPosition=at.tolist()))
        return known[key]

    springs: list[Any] = []
    for (one, two), part in zip(problem.groups.tolist(), problem.slices(), strict=True):
        for i in range(part.start, part.stop):
            spring = items.ObjectConnectorSpringDamper(
                markerNumbers=[point(one, problem.p[i]), point(two, problem.q[i])],
                referenceLength=float(problem.length[i]),
                stiffness=float(problem.stiffness[i]),
            )
            springs.append(system.AddObject(spring))
    for (one, two), ends in zip(problem.hinges.tolist(), problem.at, strict=True):
        system.AddObject(items.ObjectJointSpherical(markerNumbers=[point(one, ends[0]), point(two, ends[1])]))
    system.Assemble()
    settings, kind = settings_of(problem, steps), getattr(exudyn.DynamicSolverType, solver)
    rest = system.systemData.GetODE2Coordinates(configuration=exudyn.ConfigurationType.Initial)
    still = np.zeros(len(system.systemData.GetODE2Coordinates_t(configuration=exudyn.ConfigurationType.Initial)))
    last: Floats | None = None

    def objective(alpha: Floats, _: bool) -> tuple[float, None]:
        nonlocal last
        if last is None or not np.array_equal(alpha, last):
            for spring, stiffness in zip(springs, (problem.stiffness * alpha).tolist(), strict=True):
                system.SetObjectParameter(spring, "stiffness", stiffness)
            last = alpha.copy()
        initial = exudyn.ConfigurationType.Initial
        system.systemData.SetODE2Coordinates(rest, configuration=initial)
        system.systemData.SetODE2Coordinates_t(still, configuration=initial)
        if not system.SolveDynamic(settings, solverType=kind):
            raise RuntimeError("SolveDynamic did not succeed")
        return _energy(system, problem, [node for node, _ in made], alpha), None

    return objective


def _energy(system: Any, problem: SpatialProblem, nodes: list[Any], alpha: Floats) -> float:
    """Energy of the springs as the bodies stand."""
    outputs = exudyn.OutputVariableType
    places = [np.asarray(system.GetNodeOutput(node, outputs.Position)) for node in nodes]
    turns = [np.asarray(system.GetNodeOutput(node, outputs.RotationMatrix)).reshape(3, 3) for node in nodes]

    def world(body: int, points: Floats) -> Floats:
        moved: Floats = points if body == GROUND else places[body] + points @ turns[body].T
        return moved

    whole = 0.0
    for (one, two), part in zip(problem.groups.tolist(), problem.slices(), strict=True):
        between = world(two, problem.q[part]) - world(one, problem.p[part])
        stretch = np.linalg.norm(between, axis=1) - problem.length[part]
        whole += float(0.5 * np.sum(alpha[part] * problem.stiffness[part] * stretch**2))
    return whole


def _body(system: Any, problem: SpatialProblem, k: int, node: Any) -> tuple[Any, Any]:
    """The numbers of a body's node and of the body."""
    turn = rotation(problem.turn[k])
    if node is items.NodeRigidBodyEP:
        turning = problem.turn[k].tolist()
    else:
        from exudyn.rigidBodyUtilities import RotationMatrix2RotationVector

        turning = np.asarray(RotationMatrix2RotationVector(turn)).tolist()
    number = system.AddNode(node(referenceCoordinates=[*problem.start[k].tolist(), *turning]))
    j = problem.inertia[k]
    inertia = [j[0, 0], j[1, 1], j[2, 2], j[1, 2], j[0, 2], j[0, 1]]
    body = system.AddObject(
        items.ObjectRigidBody(physicsMass=float(problem.mass[k]), physicsInertia=inertia, nodeNumber=number)
    )
    centre = system.AddMarker(items.MarkerBodyRigid(bodyNumber=body))
    force = problem.force[k].tolist()
    system.AddLoad(items.LoadForceVector(markerNumber=centre, loadVector=force[:3]))
    system.AddLoad(items.LoadTorqueVector(markerNumber=centre, loadVector=force[3:]))
    return number, body
