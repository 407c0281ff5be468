"""Candidates that are priced beside candidates that are built: prices, optima, times and memory.

The engine is pushed and turned so slowly, on struts so stiff, that its energy is all but that at rest: one basin. The
plate is the paper's scene with stiff members, on grids of which each has all points of the one before.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.peak_memory import peak_memory
from mdstopo import Case
from mdstopo.bench.tables import Table
from mdstopo.case.reader import read_case
from mdstopo.case.scene.candidates import with_members
from mdstopo.engine import Evaluator
from mdstopo.plan.pricing import price
from mdstopo.session.outcome import Outcome
from mdstopo.session.run_session import run_session

#: points of the mounts and of the frame, for 1e3 to 1e6 candidates
ENGINES = ((20, 50), (80, 125), (200, 500), (800, 1250))
#: on the sides of the torso and on each of three sides of the frame, the last with more than 1e8 candidates
PLATES = ((20, 17), (160, 129), (1280, 1025), (10240, 4097))
#: candidates whose prices are compared with the gradient
CHECKED = 100_000
#: candidates that are priced to see how long one takes
TIMED = 40_960
#: of laws that switch, whose steps end at every switch of every candidate that is built
FEW_CHECKED = 300
#: points of the arm and of the floor, for passes over 1e6, 1e7 and 1e8 candidates of a scene with a joint, and of the
#: floor in space along its sides
DENSE = ((200, 5000), (500, 20_000), (2000, 50_000))
SIDES = {5000: [100, 50], 20_000: [200, 100], 50_000: [250, 200]}
#: members that are built in such a scene, as at an optimum
BUILT = 100
#: candidates from which on a run of all of them ends after so many iterations
MANY, SHORT = 500_000, 20
#: the run that a process of its own makes, whose memory is its own
PROGRAM = "from benchmarks.priced import nested; import sys; nested(int(sys.argv[1]), int(sys.argv[2]))"
#: a pass that a process of its own makes
PASS_PROGRAM = "from benchmarks.priced import passed; import sys; passed(*map(int, sys.argv[1:3]), sys.argv[3])"


def engine(mounts: int, frame: int, candidates: str = "priced", iterations: int = 1000) -> Case:
    """The engine on its struts; iterations: of each round at most."""
    times = np.linspace(0.0, 0.5, 41)
    turn = np.pi * times / 0.5
    force = np.stack([times, 300 * np.sin(2 * turn), 200 * np.sin(turn) ** 2], axis=1)
    moment = np.stack([times, 60 * np.sin(3 * turn)], axis=1)
    grids = {
        "mounts": ("engine", {"center": [0, 0], "size": [0.5, 0.5], "count": mounts}),
        "frame": ("ground", {"center": [0.1, 0.05], "size": [2, 1.6], "count": frame}),
    }
    scene = {
        "format": 1,
        "time": {"end": 0.5},
        "bodies": {"engine": {"mass": 10, "inertia": 0.5, "position": [0, 0]}},
        "points": {name: {"body": body, "grid": {"rectangle": grid}} for name, (body, grid) in grids.items()},
        "members": {
            "struts": {
                "from": "mounts", "to": "frame", "law": {"type": "spring", "stiffness": 20000},
                "candidates": candidates,
            },
        },
        "loads": [{"body": "engine", "force": {"table": force.tolist()}, "moment": {"table": moment.tolist()}}],
        "design": {"initial": 0.1, "lower": 0, "upper": 1},
        "objectives": {"G": {"response": "energy", "over_time": "mean"}},
        "constraints": [{"volume": "all", "limit": 30}],
        "solver": {"tolerance": 1e-6},
        "optimizer": {"max_iterations": iterations},
    }  # fmt: skip
    return read_case(json.dumps(scene))


def plate(torso: int, side: int) -> Case:
    """The paper's two bodies with stiff members between them."""
    lines = (([-1, -0.8], [-1, 0.8]), ([-0.8, -1], [0.8, -1]), ([1, -0.8], [1, 0.8]))
    scene = {
        "format": 1,
        "gravity": [0, -9.8],
        "time": {"end": 0.2},
        "bodies": {
            "torso": {"mass": 60, "inertia": 10, "position": [0, 0]},
            "vehicle": {"mass": 2000, "inertia": 6000, "position": [0, -1]},
        },
        "points": {
            "torso": {
                "body": "torso", "grid": {"rectangle": {"center": [0, 0], "size": [0.5, 0.5], "count": torso}},
            },
            "frame": {
                "body": "vehicle",
                "grid": [{"line": {"from": first, "to": last, "count": side}} for first, last in lines],
            },
        },
        "members": {
            "belts": {
                "from": "torso", "to": "frame", "law": {"type": "spring", "stiffness": 2250}, "candidates": "priced",
            },
        },
        "loads": [{"body": "vehicle", "acceleration": [9.8, 0], "angular_acceleration": 20}],
        "design": {"initial": 0.1, "lower": 0},
        "objectives": {"G": {"response": "energy"}},
        "constraints": [{"volume": "all", "limit": 102}],
    }  # fmt: skip
    return read_case(json.dumps(scene))


def whole_of(outcome: Outcome, case: Case) -> np.ndarray[Any, np.dtype[np.float64]]:
    """The design of a priced run as one of all candidates."""
    (group,), (every,) = outcome.case.members, case.members
    alpha = np.zeros(case.n_design)
    alpha[group.from_index * len(every.to_local) + group.to_index] = outcome.alpha
    return alpha


def priced() -> Iterator[Table]:
    """Prices beside the gradient; passes; optima and times beside those of all candidates; nested grids."""
    yield prices()
    yield passes()
    yield optima()
    yield grids()


def swing(dimension: int, law: dict[str, Any], points: tuple[int, int] = (400, 500)) -> Case:
    """An arm that hangs on a joint and is pushed, with candidates from it to the ground, in a plane or in space.

    points: of the arm and of the floor; where these are many, steps are as long as the accuracy allows.
    """
    up = [0.0] * (dimension - 1)
    flat = dimension == 2
    grids = {
        "arm": {"line": {"from": [0.2, *up], "to": [1.0, *up], "count": points[0]}},
        "floor": {"line": {"from": [-1.0, *up[:-1], -1.2], "to": [2.0, *up[:-1], -1.0], "count": points[1]}},
    }
    if not flat:
        count = SIDES.get(points[1], [25, 20])
        grids["floor"] = {"plane": {"corner": [-1, -1, -1.2], "edges": [[3, 0, 0.1], [0, 2, 0]], "count": count}}
    push = [30.0, 4.0, 9.0][:dimension]
    scene = {
        "format": 1,
        "dimension": dimension,
        "gravity": [*up, -9.8],
        "time": {"end": 0.4},
        "bodies": {"arm": {"mass": 5, "inertia": 0.5 if flat else [0.1, 0.5, 0.5], "position": [0.5, *up]}},
        "joints": [
            {"type": "revolute" if flat else "spherical", "bodies": ["ground", "arm"], "at": [0.0, *up]},
        ],
        "points": {
            "arm": {"body": "arm", "grid": grids["arm"]},
            "floor": {"body": "ground", "grid": grids["floor"]},
        },
        "members": {"stays": {"from": "arm", "to": "floor", "law": law, "candidates": "priced"}},
        "loads": [{"body": "arm", "force": push, "at": [1.0, *up], "frame": "body"}],
        "design": {"initial": 0.01, "lower": 0},
        "objectives": {"G": {"response": {"acceleration": {"body": "arm", "at": [1.0, *up]}}, "over_time": "rms"}},
        "constraints": [{"volume": "all", "limit": 20}],
        "solver": {} if points in DENSE else {"integrator": "runge_kutta", "step": 0.005},
    }  # fmt: skip
    return read_case(json.dumps(scene))


#: laws whose candidates are priced on the arm: smooth ones, and one that switches
LAWS: dict[str, dict[str, Any]] = {
    "springs": {"type": "spring", "stiffness": 300},
    "dampers": {"type": "spring", "stiffness": 300, "damping": 5, "preload": 1},
    "cubic": {"type": "cubic", "stiffness": 300, "cubic": 5000},
    "props": {"type": "gap", "stiffness": 300, "gap": 0.03, "side": "compression"},
    "props, damped": {"type": "gap", "stiffness": 300, "gap": 0.03, "side": "compression", "damping": 5},
}

#: others with modes over whose candidates passes go
MODES: dict[str, dict[str, Any]] = {
    "crushed legs": {"type": "crush", "stiffness": 9000, "force": 40, "side": "compression"},
    "curves": {"type": "curve", "curve": [[-0.5, -90], [-0.1, -30], [0, 0], [0.05, 10], [0.4, 140]]},
    "actuators": {"type": "actuator", "proportional": 80, "derivative": 4, "target": -0.05, "limit": 6},
    "formulas": {"type": "expression", "force": "k*max(x - g, 0) + c*xd", "parameters": {"k": 500, "g": 0.02, "c": 3}},
}
#: laws by whose candidates passes go, in a plane and in space
PASSES: dict[int, tuple[str, ...]] = {
    2: ("cubic", "props", *MODES),
    3: ("props", "crushed legs"),
}


def compared(name: str, case: Case) -> list[str]:
    """A row of `prices`: candidates of a case drawn at random, priced and built."""
    (group,) = case.members
    assert group.candidates is not None
    width, rng = len(group.to_local), np.random.default_rng(1)
    own = group.from_index * width + group.to_index
    if all(law.is_smooth for law in group.laws):
        every = np.unique(np.concatenate([own, rng.integers(0, group.candidates.count, CHECKED)]))
    else:
        every = np.unique(rng.integers(0, group.candidates.count, FEW_CHECKED))
        own = every[:5]
        case = with_members(case, {group.name: np.divmod(own, width)})
        (group,) = case.members
    evaluator = Evaluator(case)
    problem = evaluator.problem()
    evaluation = problem.evaluation(case.initial)  # type: ignore[attr-defined]
    first = np.eye(len(problem.sample_of(evaluation).rows))[0]  # type: ignore[attr-defined]
    states = problem.pricing_states(evaluation, first)  # type: ignore[attr-defined]
    candidates = evaluator.candidates_of(group)
    found = candidates.prices(states, every // width, every % width)
    many = rng.integers(0, candidates.candidates.count, TIMED)
    began = time.process_time()
    candidates.prices(states, many // width, many % width)
    seconds = time.process_time() - began
    built = with_members(case, {group.name: np.divmod(every, width)})
    alpha = np.where(np.isin(every, own), case.initial[0], 0.0)
    gradient = Evaluator(built).evaluate(alpha).gradients["G"]
    worst = np.abs(found - gradient).max() / np.abs(gradient).max()
    return [
        name, f"{candidates.candidates.count:,}", f"{len(every):,}", f"{worst:.1e}",
        f"{1e9 * seconds / TIMED:,.0f} ns",
    ]  # fmt: skip


def prices() -> Table:
    """The prices of candidates drawn at random, beside the gradient of a case in which they are built."""
    cases = [("springs between free bodies", plate(torso, side)) for torso, side in PLATES[1:]]
    for dimension, where in ((2, "on a hinge"), (3, "on a ball joint, in space")):
        cases += [(f"{name} {where}", swing(dimension, law)) for name, law in LAWS.items()]
    return Table(
        "Prices beside the gradient, the largest difference relative to the largest entry",
        ["candidates", "of these", "compared", "difference", "processor time of one"],
        [compared(name, case) for name, case in cases],
        (
            "Props act from a shortening on. Those that are built have steps end at their switches, and those that are "
            "priced do not: there the difference falls with the steps.",
        ),
    )


def passed(dimension: int, dense: int, name: str) -> None:
    """Go through all candidates of a dense scene, of the number `dense` in DENSE, and print what is told of it."""
    case = swing(dimension, {**LAWS, **MODES}[name], DENSE[dense])
    (group,) = case.members
    assert group.candidates is not None
    chosen = np.sort(np.random.default_rng(1).choice(group.candidates.count, BUILT, replace=False))
    case = with_members(case, {group.name: np.divmod(chosen, len(group.to_local))})
    evaluator = Evaluator(case)
    problem = evaluator.problem()
    evaluation = problem.evaluation(case.initial)  # type: ignore[attr-defined]
    states = problem.pricing_states(evaluation, np.ones(1))  # type: ignore[attr-defined]
    candidates = evaluator.candidates_of(case.members[0])
    part = evaluator.candidates_of(case.members[0], TIMED)
    part.go_through(states, 0.0, 1)
    began, spent = time.perf_counter(), time.process_time()
    candidates.go_through(states, 0.0, 1)
    told = {
        "candidates": group.candidates.count,
        "states": len(states.scenes[0].when),
        "pass": time.perf_counter() - began,
        "processor": time.process_time() - spent,
        "megabytes": peak_memory() / 1e6,
    }
    print(json.dumps(told))


def passes() -> Table:
    """Passes over 1e6 to 1e8 candidates of scenes with a joint, each in a process of its own."""
    rows = []
    for dimension, where in ((2, "on a hinge"), (3, "on a ball joint, in space")):
        for name in PASSES[dimension]:
            told = []
            for dense in range(len(DENSE)):
                done = subprocess.run(
                    [sys.executable, "-c", PASS_PROGRAM, str(dimension), str(dense), name],
                    capture_output=True, text=True, check=True, cwd=Path(__file__).parents[1],
                )  # fmt: skip
                told.append(json.loads(done.stdout.splitlines()[-1]))
            last = told[-1]
            rows.append([
                f"{name} {where}", str(last["states"]), *(f"{each['pass']:.2f} s" for each in told),
                f"{last['processor']:.1f} s", f"{1e9 * last['processor'] / last['candidates']:,.0f} ns",
                f"{last['megabytes']:.0f} MB",
            ])  # fmt: skip
    columns = ["candidates", "states", "1e6", "1e7", "1e8", "processor time, 1e8", "of one", "memory"]
    note = f"With {BUILT} members that are built. A price is a sum over the states of the motion."
    return Table("Passes over all candidates of a scene with a joint", columns, rows, (note,))


def optima() -> Table:
    """Runs with prices beside runs of all candidates, from the stated design and from what the first have found."""
    rows = []
    run_session(engine(*ENGINES[0]))  # what it compiles is no part of the times
    for mounts, frame in ENGINES:
        count = mounts * frame
        began = time.perf_counter()
        found = run_session(engine(mounts, frame))
        seconds = time.perf_counter() - began
        assert found.pricing is not None
        every = engine(mounts, frame, "enumerated", SHORT if count > MANY else 200)
        began = time.perf_counter()
        whole = run_session(every)
        beside = time.perf_counter() - began
        again = run_session(every, initial=whole_of(found, every))
        value = found.objectives["G"]
        rows.append([
            f"{count:,}", f"{value:.9g}", f"{again.objectives['G'] / value - 1:+.1e}", f"{again.kkt:.1e}",
            f"{whole.objectives['G'] / value - 1:+.1e}", f"{found.pricing.rounds}", f"{seconds:.1f} s",
            f"{beside:.1f} s, {whole.iterations} iterations",
        ])  # fmt: skip
    return Table(
        "Optima with prices, beside runs of all candidates",
        [
            "candidates",
            "G, priced",
            "all, from there",
            "its KKT residual",
            "all, from the start",
            "rounds",
            "time, priced",
            "time, all from the start",
        ],
        rows,
        (
            "Relative changes of G in runs of all candidates: begun at the optimum with prices, and begun at the "
            "stated design. The latter end after 200 iterations, with a million candidates after 20, unless they "
            "converge before; those that did not would come lower with more.",
        ),
    )


def grids() -> Table:
    """Nested grids up to more than 1e8 candidates, each in a process of its own."""
    rows = []
    for torso, side in PLATES:
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM, str(torso), str(side)],
            capture_output=True, text=True, check=True, cwd=Path(__file__).parents[1],
        )  # fmt: skip
        told = json.loads(done.stdout.splitlines()[-1])
        rows.append([
            f"{told['candidates']:,}", f"{told['G']:.6f}", str(told["rounds"]), str(told["members"]),
            f"{told['pass']:.2f} s", f"{told['processor']:.2f} s", f"{told['seconds']:.0f} s",
            f"{told['megabytes']:.0f} MB", f"{told['best']:.1e}",
        ])  # fmt: skip
    columns = [
        "candidates", "G", "rounds", "members", "one pass", "its processor time", "time", "memory",
        "largest gain, relative",
    ]  # fmt: skip
    note = "The largest gain is that of one candidate, to first order; 0: none that is not built would lower G."
    return Table("Nested grids", columns, rows, (note,))


def nested(torso: int, side: int) -> None:
    """Optimise one plate and print what is told of it."""
    began = time.perf_counter()
    found = run_session(plate(torso, side))
    seconds = time.perf_counter() - began
    evaluator = Evaluator(found.case)
    problem = evaluator.problem()
    price(found.case, problem, found.alpha)
    began, spent = time.perf_counter(), time.process_time()
    price(found.case, problem, found.alpha)
    passed = time.perf_counter() - began
    assert found.pricing is not None
    told = {
        "candidates": found.pricing.candidates,
        "G": found.objectives["G"],
        "rounds": found.pricing.rounds,
        "members": int(np.count_nonzero(found.alpha)),
        "pass": passed,
        "processor": time.process_time() - spent,
        "seconds": seconds,
        "megabytes": peak_memory() / 1e6,
        "best": found.pricing.best,
        "threads": os.environ.get("MDSTOPO_THREADS", ""),
    }
    print(json.dumps(told))
