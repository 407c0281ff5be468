"""The tables of the benchmark."""

from collections.abc import Iterator, Sequence

import numpy as np

from benchmarks.optimum.acceptance import applications, eight_starts, nearby
from benchmarks.optimum.families import families
from benchmarks.optimum.problems import Problem, named
from benchmarks.optimum.race import BUDGET, NEAR, STARTS, best_known, other_solvers_of, ours, within
from benchmarks.optimum.runs import KEPT, LEAST, REACHED, Run, run
from benchmarks.optimum.smooth import smooth
from mdstopo.bench.tables import Table, verdict

#: numbers of iterations after which the last words are judged; the first is that of the table of values
ITERATIONS = (200, 50, 1000)
#: evaluations within which a convex problem's optimum is to be reached
WITHIN = 100
#: what the tables are called on the command line
PARTS = ("convex", "dynamic", "race", "families", "applications", "nearby", "smooth", "bars")


def everything(
    names: list[str] | None = None,
    parts: Sequence[str] = PARTS,
    starts: int = STARTS,
    budget: int = BUDGET,
    iterations: Sequence[int] = ITERATIONS,
) -> Iterator[Table]:
    """All tables, or some parts of them, of all problems or of those whose names begin so."""
    chosen = named(names)
    if "convex" in parts:
        yield from convex([each for each in chosen if each.kind == "convex"], iterations)
    if "dynamic" in parts:
        yield from dynamic([each for each in chosen if each.kind == "dynamic"], iterations)
    if "race" in parts:
        yield from race([each for each in chosen if each.kind == "dynamic"], starts, budget)
    if "families" in parts and not names:
        yield from families()
    if "applications" in parts and not names:
        yield from applications()
    if "nearby" in parts and not names:
        yield from nearby()
    if "smooth" in parts and not names:
        yield from smooth()
    if "bars" in parts and not names:
        from benchmarks.bars import bars

        yield from eight_starts()
        yield from bars()


def convex(chosen: Sequence[Problem], iterations: Sequence[int] = ITERATIONS) -> Iterator[Table]:
    """Driven linkages against their exact optima."""
    if not chosen:
        return
    rows, untrue, met, words = [], [], 0, 0
    for problem in chosen:
        for start in problem.starts():
            runs = [run(problem, start, count) for count in iterations]
            first = runs[0]
            reached = first.reached is not None and first.reached <= WITHIN
            met += reached
            words += sum(not each.untrue for each in runs)
            rows.append([*convex_row(problem, first), verdict(reached), *(said(each) for each in runs)])
            untrue += untrue_rows(runs)
    yield Table(
        "Driven linkages: value against the exact optimum",
        (
            "problem", "start", "exact", "found", "above, %", "reached after", "evaluations", "KKT residual", "within",
            *(f"word of {count}" for count in iterations),
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
    yield from untrue_table("Driven linkages", untrue)


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


def dynamic(chosen: Sequence[Problem], iterations: Sequence[int] = ITERATIONS) -> Iterator[Table]:
    """Single runs of the dynamic problems against the best that is known, and their last words."""
    if not chosen:
        return
    rows, untrue, words = [], [], 0
    for problem in chosen:
        best = best_known(problem)
        for start in problem.starts():
            runs = [run(problem, start, count, best) for count in iterations]
            first = runs[0]
            beside = "" if best is None else f"{_above(first.value, best):.2f}"
            above = beside if first.keeps else "limits broken"
            words += sum(not each.untrue for each in runs)
            rows.append(
                [
                    problem.name, start, str(problem.case().space.size), _number(best), f"{first.value:.5g}", above,
                    str(first.evaluations), f"{first.kkt:.1e}", *(said(each) for each in runs),
                ]
            )  # fmt: skip
            untrue += untrue_rows(runs)
    yield Table(
        "Dynamic problems: one start",
        (
            "problem", "start", "variables", "best known", "found", "above, %", "evaluations", "KKT residual",
            *(f"word of {count}" for count in iterations),
        ),
        rows,
        (
            f"{words} of {len(rows) * len(iterations)} last words are true. *Best known* is the closed form, or the "
            "best that anybody found with several starts; a single start may end at another optimum.",
        ),
    )  # fmt: skip
    yield from untrue_table("Dynamic problems", untrue)


def race(chosen: Sequence[Problem], starts: int, budget: int) -> Iterator[Table]:
    """mdstopo with several starts beside what is kept of the others."""
    rows, level, quick, cheap, told = [], 0, 0, 0, set()
    methods = ("IPOPT", "MMA", "CCSAQ", "SLSQP")
    for problem in chosen:
        entry = other_solvers_of(problem)
        if entry is None:
            continue
        told.add((entry["starts"], entry["budget"]))
        found, evaluations, _ = ours(problem, starts, budget)
        own = found[-1][1] if found else None
        lasts = [each["improvements"][-1][1] for each in entry["methods"].values() if each["improvements"]]
        best = min([*lasts, *([] if own is None else [own])], default=None)
        if best is None:
            rows.append([problem.name, "none found", *[""] * (len(methods) + 7)])
            continue
        counts = {name: within(each["improvements"], best) for name, each in entry["methods"].items()}
        least = min((count for count in counts.values() if count is not None), default=None)
        mine = within(found, best)
        good = own is not None and own <= best * (1.0 + NEAR)
        fast = mine is not None and (least is None or mine <= least / 2.0)
        theirs = min(
            (each["evaluations"] for name, each in entry["methods"].items() if counts[name] is not None), default=None
        )
        saved = good and (theirs is None or evaluations <= theirs / 2.0)
        level, quick, cheap = level + good, quick + fast, cheap + saved
        rows.append(
            [
                problem.name, f"{best:.5g}", _share(own, best), _count(mine),
                *(_other_solver(entry, name, best, counts) for name in methods), verdict(good), verdict(fast),
                str(evaluations), "nobody" if theirs is None else str(theirs), verdict(saved),
            ]
        )  # fmt: skip
    if not rows:
        return
    kept = "; ".join(f"{n} starts of {m} evaluations" for n, m in sorted(told))
    yield Table(
        f"Dynamic problems: {starts} starts beside other optimisers",
        (
            "problem", "best", "mdstopo above, %", "to 1 %",
            *(f"{name} above, % (to 1 %)" for name in methods), "within 1 %", "half to 1 %",
            "mdstopo in all", "others in all", "half in all",
        ),
        rows,
        (
            f"Within 1 % of the best of all in {level} of {len(rows)}; with all its starts in at most half the "
            f"evaluations of all the starts of the most sparing of the others that came so near in {cheap}. Others: "
            f"{kept}. A limit is kept to {KEPT:g} of its bound.",
            "To 1 %, and in brackets: evaluations, one start after another, until the first design within 1 % of the "
            "best, which nobody knows to be that before all starts are over. There mdstopo needs at most half of those "
            f"of the quickest of the others in {quick}.",
        ),
    )  # fmt: skip


def untrue_rows(runs: Sequence[Run]) -> list[list[str]]:
    """What is not true of the last words of runs."""
    return [[each.problem, each.start, str(each.iterations), word(each), each.untrue] for each in runs if each.untrue]


def untrue_table(what: str, rows: list[list[str]]) -> Iterator[Table]:
    """The last words that are not true, and why."""
    if rows:
        yield Table(f"{what}: last words that are not true", ("problem", "start", "iterations", "word", "why"), rows)


def said(run: Run) -> str:
    """The last word, marked where it is not true."""
    return word(run) + (" NO" if run.untrue else "")


def word(run: Run) -> str:
    """The last word of a run."""
    return run.status.replace("_", " ")


def _above(value: float, best: float) -> float:
    return 100.0 * (value - best) / abs(best)


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.5g}"


def _share(value: float | None, best: float) -> str:
    return "none found" if value is None else f"{_above(value, best):.2f}"


def _count(count: int | None) -> str:
    return "never" if count is None else str(count)


def _other_solver(entry: dict[str, object], name: str, best: float, counts: dict[str, int | None]) -> str:
    methods = entry["methods"]
    assert isinstance(methods, dict)
    if name not in methods:
        return "not run"
    last = methods[name]["improvements"][-1][1] if methods[name]["improvements"] else None
    share = _share(last, best)
    return share if last is None or not np.isfinite(last) else f"{share} ({_count(counts[name])})"
