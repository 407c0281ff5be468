"""`mdstopo bench work-precision`: run time against error, over integrators, tolerances and sensitivity methods.

The reference is a much tighter run of the *other* explicit or collocation integrator than the one that is measured,
where the case can be computed by both; so its steps and its reverse sweep are others.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from statistics import median

from mdstopo.api import evaluate
from mdstopo.bench.reference import Floats, Reference, solution
from mdstopo.bench.scenes import plate
from mdstopo.bench.tables import Table, significant
from mdstopo.bench.timing import interleaved
from mdstopo.case.methods.integrators import INTEGRATORS
from mdstopo.case.methods.sensitivities import SENSITIVITIES
from mdstopo.case.model import Case
from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.plots.style import COLOURS, MARKERS, new_figure, save, styled
from mdstopo.scene.family import beyond_springs, collocates

TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)
#: with fixed steps of second order tighter ones would take minutes
TOLERANCES_FIXED = (1e-2, 1e-3, 1e-4, 1e-5)
TIGHTEST = 1e-13
_ROUNDS = 5


@dataclass(frozen=True)
class Point:
    """One way to evaluate a case: relative errors of G and of its gradient, seconds (the median), force sums."""

    integrator: str
    sensitivity: str
    tolerance: float
    value_error: float
    gradient_error: float
    seconds: float
    force_sums: int


def paper(overrides: Mapping[str, object] | None = None) -> Case:
    """The paper's scene, with some thousand members."""
    return read_case(plate(1020), overrides=dict(overrides or {}))


def work_precision(case: Case, tell: Callable[[str], None] = print) -> Iterator[Point]:
    """Every way, timed in interleaved rounds; tell: given a sentence for what cannot be measured.

    Raises CaseError for a case without an objective.
    """
    if not case.objectives:
        raise CaseError([case.marks.mistake("objectives", "nothing to look at")], str(case.path or case.name))
    alpha = case.initial
    truth = references(case, alpha)
    ways: dict[tuple[str, str, float], tuple[float, float, int]] = {}
    calls: dict[tuple[str, str, float], Callable[[], object]] = {}
    for integrator, reference in truth.items():
        kind = INTEGRATORS[integrator]
        exact = [each for each in SENSITIVITIES.values() if each.is_exact]
        methods = [each.name for each in exact if not each.steps or getattr(kind, each.steps)]
        for tolerance in TOLERANCES if kind.adaptive else TOLERANCES_FIXED:
            varied = with_solver(case, integrator, tolerance)
            for method in methods:
                try:
                    errors = reference.errors(*solution(varied, alpha, method))
                except RuntimeError as error:
                    tell(f"{integrator}, {method}, tolerance {tolerance:.0e}: {error}")
                    continue
                key = integrator, method, tolerance
                work = evaluate(varied, alpha, method=method).work
                ways[key] = *errors, int(work["force_sums"])
                calls[key] = partial(evaluate, varied, alpha, method=method)
    times = interleaved(calls, rounds=_ROUNDS, seconds=0.01)
    for key, (value, gradient, sums) in ways.items():
        yield Point(*key, value, gradient, median(times[key]), sums)


def with_solver(case: Case, integrator: str, tolerance: float) -> Case:
    """The same case on another integrator, to another tolerance, with steps of the integrator's own choice."""
    solver = replace(case.solver, integrator=integrator, tolerance=tolerance, sensitivity="auto", step=None)
    if not INTEGRATORS[integrator].has_radius:
        solver = replace(solver, spectral_radius=None)
    return replace(case, solver=solver)


def _has_both(case: Case) -> bool:
    """Whether both adaptive methods of high order compute the case, so that each can judge the other."""
    return not beyond_springs(case) or collocates(case)


def references(case: Case, alpha: Floats) -> dict[str, Reference]:
    """What each integrator's results are measured against, by its name."""
    truths = {}
    for name in ("gauss", "runge_kutta") if _has_both(case) else ("runge_kutta",):
        truths[name] = Reference(*solution(with_solver(case, name, TIGHTEST), alpha))
    explicit = truths["runge_kutta"]
    if "gauss" not in truths:
        return {"runge_kutta": explicit, "generalized_alpha": explicit}
    return {"gauss": explicit, "runge_kutta": truths["gauss"], "generalized_alpha": explicit}


def table(case: Case, points: Sequence[Point]) -> Table:
    """The measured points as a table, in the order of measuring."""
    rows = [
        [
            each.integrator,
            each.sensitivity,
            f"{each.tolerance:.0e}",
            f"{each.value_error:.1e}",
            f"{each.gradient_error:.1e}",
            significant(1e3 * each.seconds),
            str(each.force_sums),
        ]
        for each in points
    ]
    other = "the other of gauss and runge_kutta" if _has_both(case) else "itself"
    notes = (
        f"{case.objectives[0].name} of {case.title or case.name}, {case.n_design} design variables, at the initial "
        "design.",
        f"Errors are relative (of the gradient: of its largest entry), against {other} at tolerance {TIGHTEST:.0e}.",
        f"Times are medians over {_ROUNDS} interleaved rounds of whole evaluations.",
    )
    columns = ("integrator", "sensitivity", "tolerance", "error of G", "error of gradient", "ms", "force sums")
    return Table("Work and precision", columns, rows, notes)


def draw(case: Case, points: Sequence[Point], path: Path) -> None:
    """Time over error, both axes logarithmic: of G above, of the gradient below.

    Raises StoreError where matplotlib is missing or the picture cannot be written.
    """
    with styled() as module:
        figure, axes = new_figure(module, 2)
        lines: dict[tuple[str, str], list[Point]] = {}
        for each in points:
            lines.setdefault((each.integrator, each.sensitivity), []).append(each)
        for k, ((integrator, sensitivity), own) in enumerate(lines.items()):
            for axis, name in zip(axes, ("value_error", "gradient_error"), strict=True):
                # rounding has no logarithm where it is exactly zero
                errors = [max(getattr(each, name), 1e-16) for each in own]
                axis.plot(
                    errors,
                    [1e3 * each.seconds for each in own],
                    color=COLOURS[k % len(COLOURS)],
                    marker=MARKERS[k % len(MARKERS)],
                    label=f"{integrator}, {sensitivity}",
                )
        for axis, text in zip(axes, ("G", "gradient"), strict=True):
            axis.set_xscale("log")
            axis.set_yscale("log")
            axis.set_ylabel("time, ms")
            axis.set_title(f"relative error of {text}")
        axes[0].legend(fontsize=5)
        axes[-1].set_xlabel("relative error")
        save(figure, path)
