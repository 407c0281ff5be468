"""The tables of the benchmark."""

from collections.abc import Iterator, Sequence

from benchmarks.optimum.problems import Problem, named
from benchmarks.optimum.runs import LEAST, REACHED, Run, run
from mdstopo.bench.tables import Table, verdict

#: numbers of iterations after which the last words are judged; the first is that of the table of values
ITERATIONS = (200, 50, 1000)
#: evaluations within which a convex problem's optimum is to be reached
WITHIN = 100


def everything(names: list[str] | None = None) -> Iterator[Table]:
    """All tables, or those of the problems whose names begin so."""
    yield from convex([each for each in named(names) if each.kind == "convex"])


def convex(chosen: Sequence[Problem], iterations: Sequence[int] = ITERATIONS) -> Iterator[Table]:
    """Driven linkages against their exact optima."""
    if not chosen:
        return
    rows, met, words = [], 0, 0
    for problem in chosen:
        for start in problem.starts():
            runs = [run(problem, start, count) for count in iterations]
            first = runs[0]
            within = first.reached is not None and first.reached <= WITHIN
            met += within
            words += sum(not each.untrue for each in runs)
            rows.append([*convex_row(problem, first), verdict(within), *(_said(each) for each in runs)])
    yield Table(
        "Driven linkages: value against the exact optimum",
        (
            "problem", "start", "exact", "found", "above, %", "reached after", "evaluations", "KKT residual", "within",
            *(f"last word of {count}" for count in iterations),
        ),
        rows,
        (
            f"Reached in {met} of {len(rows)} runs within {WITHIN} evaluations; {words} of "
            f"{len(rows) * len(iterations)} last words are true. Where the limits cannot be kept, `exact` and `found` "
            "are the largest excess over a limit in percent of it.",
            f"`Reached` is a design that keeps the limits and is at most {100 * REACHED:g} % above the exact optimum, "
            f"or one whose excess is at most {100 * LEAST:g} % above the least. The residual is recomputed at the "
            "design found. *NO* marks a last word that is not true.",
        ),
    )  # fmt: skip


def convex_row(problem: Problem, run: Run) -> list[str]:
    """Name to residual."""
    if problem.violation:
        least, found = 100.0 * problem.violation, 100.0 * run.excess
        cells = [f"{least:.3f} %", f"{found:.3f} %", f"{100.0 * (found / least - 1.0):.3f}"]
    else:
        assert problem.exact is not None
        above = 100.0 * (run.value / problem.exact - 1.0)
        cells = [f"{problem.exact:.5g}", f"{run.value:.5g}", f"{above:.3f}" if run.keeps else "limits broken"]
    reached = "never" if run.reached is None else str(run.reached)
    return [problem.name, run.start, *cells, reached, str(run.evaluations), f"{run.kkt:.1e}"]


def _said(run: Run) -> str:
    return word(run) + (f" NO: {run.untrue}" if run.untrue else "")


def word(run: Run) -> str:
    """The last word of a run."""
    return run.status.replace("_", " ")
