"""`mdstopo bench skip`: what is skipped where nothing needs it, counted and timed with and without.

Each omission is a pair of cases that differ in just the thing that may be left out, and a count of work. Where the
count is the same on both sides, only the time of each unit can differ.
"""

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mdstopo.bench.tables import Table, significant
from mdstopo.bench.timing import interleaved
from mdstopo.case.reader import read_case
from mdstopo.engine import Evaluator

Floats = NDArray[np.float64]
Scene = dict[str, Any]


@dataclass(frozen=True)
class Side:
    """One of the two measurements: a call that is timed, and how much work it is in the omission's unit."""

    call: Callable[[], object]
    work: int


@dataclass(frozen=True)
class Omission:
    """Work that may be left out, measured with all of it and without; and the unit in which it is counted."""

    what: str
    unit: str
    full: Side
    left_out: Side


def skip() -> Iterator[Table]:
    """One table: every omission, its counts, its times."""
    found = [make() for make in OMISSIONS]
    calls = {(k, side): getattr(each, side).call for k, each in enumerate(found) for side in ("full", "left_out")}
    times = interleaved(calls, rounds=7, seconds=0.01)
    rows = []
    for k, each in enumerate(found):
        full, less = (median(times[k, side]) for side in ("full", "left_out"))
        rows.append(
            [
                each.what,
                each.unit,
                str(each.full.work),
                str(each.left_out.work),
                significant(1e3 * full),
                significant(1e3 * less),
                significant(less / full, 2),
            ]
        )
    columns = ("left out", "counted", "with", "without", "with, ms", "without, ms", "ratio")
    note = "Times are medians over interleaved rounds of whole evaluations with gradient."
    yield Table("What is left out, and what that is worth", columns, rows, (note,))


def scene(count: int = 40, **changes: Any) -> Scene:
    """Two bodies joined by count x count springs; changes replace its sections."""
    grid = {"count": count}
    made: Scene = {
        "format": 1,
        "gravity": [0, -9.8],
        "time": {"end": 0.2},
        "bodies": {
            "torso": {"mass": 60, "inertia": 10, "position": [0, 0]},
            "vehicle": {"mass": 2000, "inertia": 6000, "position": [0, -1]},
        },
        "points": {
            "p": {"body": "torso", "grid": {"rectangle": {"center": [0, 0], "size": [0.5, 0.5], **grid}}},
            "q": {"body": "vehicle", "grid": {"line": {"from": [-1, -1], "to": [1, -1], **grid}}},
        },
        "members": {"belts": {"from": "p", "to": "q", "law": {"type": "spring", "stiffness": 150}}},
        "loads": [{"body": "vehicle", "acceleration": [9.8, 0], "angular_acceleration": 20}],
        "design": {"initial": 0.5, "lower": 0},
        "objectives": {"G": {"response": "energy", "over_time": "max"}},
    }
    return made | changes


def side(made: Scene, count: str = "force_sums", alpha: Floats | None = None, **solver: Any) -> Side:
    """An evaluation of a scene; its work is a count of the engine's (`Evaluation.work`)."""
    evaluator = Evaluator(read_case(json.dumps(made | {"solver": solver})))
    design = np.array(evaluator.case.initial) if alpha is None else alpha
    found = evaluator.evaluate(design)
    if not found.status.ok:
        raise RuntimeError(f"{found.status.value} {found.message}".rstrip())
    return Side(partial(evaluator.evaluate, design), int(found.work[count]))


def fixed_members() -> Omission:
    """Members that are no design variables have no gradient."""
    two = {
        name: {"from": "p", "to": "q", "law": {"type": "spring", "stiffness": 75}, "design": name == "belts"}
        for name in ("belts", "struts")
    }
    all_design = {name: {**group, "design": True} for name, group in two.items()}

    def entries(members: Scene) -> Side:
        made = scene(members=members, design={"initial": 1})
        evaluator = Evaluator(read_case(json.dumps(made)))
        design = np.array(evaluator.case.initial)
        found = evaluator.evaluate(design)
        return Side(partial(evaluator.evaluate, design), len(design) * int(found.work["design_states"]))

    return Omission("gradient of fixed members", "members x states", entries(all_design), entries(two))


def undamped() -> Omission:
    """Where nothing depends on velocity the explicit method is Nystroem's and no damping is summed."""
    belts = {"from": "p", "to": "q", "law": {"type": "spring", "stiffness": 150, "damping": 1e-9}}
    solver: Any = {"integrator": "runge_kutta", "tolerance": 1e-8}
    return Omission(
        "damping where there is none", "force sums", side(scene(members={"belts": belts}), **solver),
        side(scene(), **solver),
    )  # fmt: skip


def zero_weight() -> Omission:
    """An objective of weight 0, and its load case, cost nothing."""
    loads = {
        "turn": {"loads": [{"body": "vehicle", "angular_acceleration": 20}]},
        "push": {"loads": [{"body": "vehicle", "acceleration": [9.8, 0]}]},
    }
    objectives = {name: {"response": "energy", "load_case": name} for name in loads}
    made = scene(load_cases=loads, loads=[], objectives=objectives, combine={"weights": {"turn": 1, "push": 0}})
    evaluator = Evaluator(read_case(json.dumps(made)))
    design = np.array(evaluator.case.initial)
    narrow = evaluator.with_objectives(["turn"])
    sides = [
        Side(partial(each.evaluate, design), int(each.evaluate(design).work["force_sums"]))
        for each in (evaluator, narrow)
    ]
    return Omission("an objective of weight 0", "force sums", *sides)


def shared_load_case() -> Omission:
    """Objectives of one load case share its simulation."""
    kinds = ("max", "mean", "final")
    together = {name: {"response": "energy", "over_time": name} for name in kinds}
    cases = {name: {"loads": [{"body": "vehicle", "acceleration": [9.8, 0]}]} for name in kinds}
    apart = {name: {"response": "energy", "over_time": name, "load_case": name} for name in kinds}
    weights: Any = {"combine": {"weights": dict.fromkeys(kinds, 1)}}
    return Omission(
        "a load case simulated for each of 3 objectives", "steps",
        side(scene(loads=[], load_cases=cases, objectives=apart, **weights), "steps"),
        side(scene(loads=cases["max"]["loads"], objectives=together, **weights), "steps"),
    )  # fmt: skip


def reverse_from_the_peak() -> Omission:
    """The reverse sweep begins at t_n, not at the end of the motion."""
    # pushed for one period, so that the first peak is the only one: then the mass rests
    push = [[0.0, 20.0], [0.7, 20.0], [0.7, 0.5], [2.0, 0.0]]
    made: Scene = {
        "format": 1,
        "time": {"end": 2.0},
        "bodies": {"mass": {"mass": 2, "inertia": 1, "position": [1, 0]}},
        "members": {
            "spring": {
                "from": {"body": "ground", "at": [0, 0]},
                "to": {"body": "mass", "at": [1, 0]},
                "law": {"type": "spring", "stiffness": 200},
            }
        },
        "loads": [{"body": "mass", "force": [{"table": push}, 0]}],
        "design": {"initial": 1},
    }
    solver: Any = {"integrator": "runge_kutta", "tolerance": 1e-10}

    def evaluating(over_time: str) -> Side:
        objectives = {"G": {"response": "energy", "over_time": over_time}}
        return side(made | {"objectives": objectives}, "reverse_steps", **solver)

    return Omission("the reverse sweep after the peak", "reverse steps", evaluating("final"), evaluating("max"))


def absent_members() -> Omission:
    """Members with alpha^mu = 0 carry nothing."""
    made = scene()
    case = read_case(json.dumps(made))
    design = np.array(case.initial)
    sparse = design.copy()
    sparse[: len(sparse) // 2] = 0.0
    return Omission(
        "members with alpha = 0, half of them",
        "springs x states",
        side(made, "spring_states", design),
        side(made, "spring_states", sparse),
    )


def inactive_members() -> Omission:
    """A law that has not begun, or is over, is not computed."""

    def group(**times: float) -> Scene:
        law = {"type": "spring", "stiffness": 75}
        return {
            name: {"from": "p", "to": "q", "law": law | (times if name == "late" else {})} for name in ("now", "late")
        }

    acting, waiting = group(active_until=9.0), group(active_from=9.0)
    return Omission(
        "a group that is not active yet", "force sums", side(scene(members=acting)), side(scene(members=waiting))
    )


def prescribed_body() -> Omission:
    """A body whose motion is prescribed in all coordinates has no equations of motion."""
    still = {key: {"velocity": 0} for key in ("x", "y", "angle")}
    partly = {key: value for key, value in still.items() if key == "y"}

    def free(motion: Scene) -> Side:
        made = scene(motions=[{"body": "vehicle", **motion}], loads=[])
        return _unknowns(made)

    return Omission("equations of a prescribed body", "unknowns", free(partly), free(still))


def no_joints() -> Omission:
    """Without joints there are no multipliers, and springs alone have kernels of their own."""
    joint = {"type": "revolute", "bodies": ["vehicle", "ground"], "at": [0, -1]}
    return Omission(
        "multipliers where there are no joints", "unknowns", _unknowns(scene(joints=[joint])), _unknowns(scene())
    )


def _unknowns(made: Scene) -> Side:
    """As `side`, where the work is the accelerations and multipliers that each balance solves for."""
    case = read_case(json.dumps(made))
    (load_case,) = case.load_cases
    driven = sum(each is not None for motion in load_case.motions for each in (motion.x, motion.y, motion.angle))
    rows = len(Evaluator(case).trajectory(case.initial, load_case.name).lam[0]) - driven
    return Side(side(made).call, 3 * len(case.bodies) - driven + rows)


OMISSIONS: tuple[Callable[[], Omission], ...] = (
    absent_members,
    inactive_members,
    fixed_members,
    undamped,
    prescribed_body,
    no_joints,
    zero_weight,
    shared_load_case,
    reverse_from_the_peak,
)
