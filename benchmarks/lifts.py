"""Every planar case of the project, and of the tests of general scenes, beside the same case in space."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.scenes import CASES
from mdstopo import Evaluation, evaluate, load_case
from mdstopo.bench.tables import Table, verdict
from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.finalize.lift_case import lifted

FOLDERS = (CASES, Path(__file__).resolve().parent.parent / "tests" / "general" / "cases")
SOLVER = {"solver.integrator": "runge_kutta", "solver.tolerance": "1e-11"}
#: axis and angle (rad) of the planes
PLANES = {"z = 0": ((0.0, 0.0, 1.0), 0.0), "tilted": ((1.0, 0.4, -0.2), 0.7)}
#: relative, of gradients to the largest entry
VALUES, GRADIENTS = 1e-10, 1e-9


def lifts() -> Iterator[Table]:
    """One table: how far values and gradients in space are from those in the plane."""
    rows = []
    for path in (path for folder in FOLDERS for path in sorted(folder.glob("*.yaml"))):
        planar = load_case(path, overrides=SOLVER)
        if planar.dimension != 2:
            continue
        for name, plane in PLANES.items():
            try:
                spatial = read_case(lifted(planar, *plane))
            except CaseError as error:
                rows.append([path.stem, name, "", "", "", str(error).splitlines()[0].rsplit(": ", 2)[-2]])
                continue
            one, two = evaluate(planar), evaluate(spatial)
            if not (one.status.ok and two.status.ok):
                rows.append([path.stem, name, "", "", "no", two.message or one.message])
                continue
            values, gradients = apart(one, two)
            met = verdict(values <= VALUES and gradients <= GRADIENTS)
            rows.append([path.stem, name, f"{values:.0e}", f"{gradients:.0e}", met, ""])
    yield Table(
        "Planar cases in space: relative differences",
        ("case", "plane", f"values (at most {VALUES:g})", f"gradients (at most {GRADIENTS:g})", "met", "refused, why"),
        rows,
        ["`runge_kutta` at a tolerance of 1e-11, the initial design."],
    )


def apart(one: Evaluation, two: Evaluation) -> tuple[float, float]:
    """The largest relative difference of objectives and constraints, and of gradients to their largest entry."""
    values = [abs(two.objectives[name] - value) / max(abs(value), 1e-300) for name, value in one.objectives.items()]
    values += [abs(y - x) / max(abs(x), 1e-12) for x, y in zip(one.constraints, two.constraints, strict=True)]
    pairs = [(one.gradients[name], two.gradients[name]) for name in one.gradients]
    pairs += list(zip(one.constraint_gradients, two.constraint_gradients, strict=True))
    gradients = [float(np.abs(y - x).max() / max(np.abs(x).max(), 1e-300)) for x, y in pairs if len(x)]
    return max(values, default=0.0), max(gradients, default=0.0)
