"""What the format allows and the engine cannot compute, or not with the chosen method: refused by name and place."""

from __future__ import annotations

from collections.abc import Iterator

from mdstopo.case.errors import Mistake
from mdstopo.case.integrators import INTEGRATORS
from mdstopo.case.model import Case, VolumeRow
from mdstopo.scene.family import beyond_collocation, beyond_springs
from mdstopo.settings.optimizers import OPTIMIZERS

#: methods that differentiate by parameters of laws
BY_PARAMETERS = frozenset({"auto", "adjoint", "direct"})


def no_parameters(method: str) -> str:
    """Why a method does not go with variables."""
    return f"{method} gives no derivatives by parameters of laws; adjoint does, and direct"


def refusals(case: Case) -> list[Mistake]:
    """Every part of `case` that the engine cannot compute, each at its place in the file."""
    found = [case.marks.mistake(path, what) for path, what in _refused(case)]
    return sorted(found, key=lambda mistake: (bool(mistake.origin), mistake.line, mistake.column))


def _refused(case: Case) -> Iterator[tuple[str, str]]:
    beyond = beyond_springs(case)
    solver = case.solver
    kind = INTEGRATORS.get(solver.integrator)
    if kind is not None and beyond and kind.free_only and case.dimension > 2:
        refused = beyond_collocation(case)
    else:
        goes = kind is None or (kind.general and not kind.free_only if beyond else kind.springs)
        refused = "" if goes else beyond or "springs between free bodies"
    if kind is not None and refused:
        what = refused
        yield "solver.integrator", f"{kind.name} does not compute {what}; runge_kutta does, and auto takes it"
    if kind is not None and not (kind.adaptive or kind.finds_step) and solver.step is None:
        yield "solver.integrator", f"{kind.name} needs a `step`, which is not given"
    optimizer = OPTIMIZERS[case.optimizer.name]
    for i, row in enumerate(case.constraints):
        volume = isinstance(row, VolumeRow)
        if not (optimizer.takes_volumes if volume else optimizer.takes_limits):
            what = "volumes" if volume else "responses"
            yield f"constraints[{i}]", f"the optimiser {optimizer.name} takes no limits on {what}; gsao does"
    if case.variables and solver.sensitivity not in BY_PARAMETERS:
        yield "solver.sensitivity", no_parameters(solver.sensitivity)
