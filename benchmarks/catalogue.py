"""Sizes from catalogues: what branch and bound chooses beside the best of all choices, on ten scenes."""

import itertools
import json
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from mdstopo.bench.tables import Table
from mdstopo.case.model import Case
from mdstopo.case.reader import read_case
from mdstopo.engine import Evaluator
from mdstopo.session import size_search, sizes
from mdstopo.session.run_session import run_session

SIZES = (0.0, 0.4, 1.0)
#: of every second scene, in which all members have to be
THERE = (0.1, 0.5, 1.0)
#: mounts and hooks of each scene
SCENES = ((2, 3), (2, 4), (3, 3), (2, 5), (3, 3), (2, 5), (3, 4), (2, 6), (4, 3), (3, 4))


def scene(number: int) -> Case:
    """A load between hooks, shaken, with a limit on what its straps may weigh; every scene has its own numbers."""
    rng, offered = np.random.default_rng(number), sizes_of(number)
    mounts, hooks = SCENES[number]
    around = np.sort(rng.uniform(0.0, 2.0 * np.pi, hooks))
    content = {
        "format": 1,
        "time": {"end": 0.3},
        "bodies": {"load": {"mass": 20, "inertia": 1, "position": [0, 0], "velocity": rng.normal(size=2).tolist()}},
        "points": {
            "mounts": {"body": "load", "grid": {"list": rng.uniform(-0.3, 0.3, (mounts, 2)).tolist()}},
            "hooks": {"body": "ground", "grid": {"list": np.stack([np.cos(around), np.sin(around)], axis=1).tolist()}},
        },
        "members": {
            "straps": {
                "from": "mounts", "to": "hooks", "law": {"type": "spring", "stiffness": 3000}, "cost": "length",
            },
        },
        "loads": [{"body": "load", "force": rng.uniform(-300, 300, 2).tolist(), "moment": float(rng.uniform(-60, 60))}],
        "design": {"initial": 0.4, "lower": 0.5 * offered[0], "catalogue": {"straps": list(offered)}},
        "objectives": {"G": {"response": {"displacement": {"body": "load", "at": [0.2, 0.1]}}}},
        "constraints": [{"volume": "all", "fraction": 0.45}],
        "solver": {"tolerance": 1e-7},
    }  # fmt: skip
    return read_case(json.dumps(content))


def sizes_of(number: int) -> tuple[float, ...]:
    """What a scene chooses from."""
    return THERE if number % 2 else SIZES


def all_choices(case: Case, kept: list[int], offered: tuple[float, ...]) -> tuple[float, int]:
    """The lowest objective of all choices for some members that the limit allows, and how many there are."""
    evaluator, row = Evaluator(case), case.constraints[0]
    best, count = float("inf"), 0
    for choice in itertools.product(offered, repeat=len(kept)):
        design = np.full(case.n_design, offered[0])
        design[kept] = choice
        if row.spent(design) > row.bound * (1.0 + 1e-9):
            continue
        count += 1
        best = min(best, evaluator.evaluate(design, gradient=False).objectives["G"])
    return best, count


def catalogue() -> Iterator[Table]:
    """Ten scenes: the search for the members kept beside all their choices, and a run beside all choices of all."""
    few, much_worse = size_search.FEW_CHOICES, sizes.MUCH_WORSE
    rows = []
    for number in range(len(SCENES)):
        case = scene(number)
        plain = replace(case, members=tuple(replace(group, sizes=(), prices=()) for group in case.members))
        continuous = run_session(plain)
        offered = sizes_of(number)
        kept = np.flatnonzero(continuous.alpha >= 0.5 * (offered[0] or offered[1])).tolist()
        # so that it is branch and bound for the members kept that is measured
        size_search.FEW_CHOICES, sizes.MUCH_WORSE = 0, np.inf
        chosen = run_session(case).sizes
        size_search.FEW_CHOICES, sizes.MUCH_WORSE = few, much_worse
        whole = run_session(case).sizes
        assert chosen is not None
        assert whole is not None
        assert chosen.members == len(kept)
        best, count = all_choices(case, kept, offered)
        among_all = all_choices(case, list(range(case.n_design)), offered)[0] if len(kept) < case.n_design else best
        rows.append(
            [
                str(case.n_design), str(len(kept)), f"{continuous.objectives['G']:.6g}", f"{chosen.objective:.6g}",
                f"{chosen.objective / best - 1.0:.1e}", str(chosen.nodes), str(chosen.evaluations), f"{count:,}",
                f"{whole.objective:.6g}", f"{whole.objective / among_all - 1.0:.1e}",
                str(whole.members), str(whole.evaluations),
            ]
        )  # fmt: skip
    head = [
        "members",
        "kept",
        "continuous",
        "chosen of kept",
        "above their best",
        "nodes",
        "evaluations",
        "all choices",
    ]
    run = ["run's choice", "above the best of all", "members in it", "its evaluations"]
    yield Table("Sizes from a catalogue of three", [*head, *run], rows)
