"""`mdstopo show`: a result file in words."""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mdstopo.cli.fit_numbers import say_fit
from mdstopo.cli.options import output_options, result_argument
from mdstopo.cli.output import Output, duration, number
from mdstopo.cli.uncertain_numbers import say_result
from mdstopo.shown import counted

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from numpy.typing import NDArray

    from mdstopo.store.result_reader import ResultView

_ROWS = 12  # iterates that a condensed history shows
_SHOWN = 6  # iterates that are named of those that failed for one reason


@click.command("show")
@result_argument
@click.option("--members", "count", type=click.IntRange(0), default=10, show_default=True, help="How many members.")
@output_options
def command(result_path: Path, count: int, as_json: bool, quiet: bool) -> int:
    """Say in words what a result file holds."""
    from mdstopo.store.result_reader import read_result

    output = Output(json=as_json, quiet=quiet)
    fit: dict[str, Any] = {}
    view = read_result(result_path, leave_out=("optimizer", "pareto/tasks", "sweep/tasks", "combine/tasks"))
    output.say(f"{view.title or view.name}: {_ended(view)} - {view.reason}")
    output.say(f"made by `{view.provenance.get('command') or view.kind}` on {view.provenance.get('created', '?')}")
    if view.kind == "run" and "iterations/combined" in view.arrays:
        _say_iterations(output, view)
        _say_starts(output, view)
        say_result(output, view)
    if view.kind == "pareto":
        _say_front(output, view)
    if view.kind == "sweep":
        _say_sweep(output, view)
    if view.kind == "fit":
        from mdstopo.fit.fit_record import content as fit_of

        fit = {"fit": fit_of(view)}
        say_fit(output, fit["fit"])
    _say_trajectories(output, view)
    _say_sensitivities(output, view)
    _say_members(output, view, count)
    known = _say_bounds(output, view)
    for title, pairs in (("settings", view.settings), ("made with", view.provenance)):
        output.say(title)
        output.table([[key, str(value)] for key, value in pairs.items()])
    for warning in view.warnings:
        output.say(f"warning: {warning}")
    if not view.finished:
        output.say(f"to go on: {resume_command(view)}")
    output.document(_document(view) | ({"bounds": known} if known else {}) | fit)
    return 0


def _ended(view: "ResultView") -> str:
    """The status, of a run with the residual that tells how far from an optimum it is."""
    word = view.status.replace("_", " ")
    kkt = residual_of(view)
    return word if kkt is None else f"{word}, KKT residual {number(kkt, 2)}"


def residual_of(view: "ResultView") -> float | None:
    """The projected KKT residual at the last iterate of a run; None of other files, and where it is unknown."""
    import numpy as np

    if view.kind != "run" or "iterations/kkt" not in view.arrays or not len(view.arrays["iterations/kkt"]):
        return None
    kkt = float(view.array("iterations/kkt")[-1])
    return kkt if np.isfinite(kkt) else None


def objective_names(view: "ResultView") -> list[str]:
    """The objectives' names, in the order of the columns."""
    return list(view.lines("objectives"))


def resume_command(view: "ResultView") -> str:
    """The command that continues what is unfinished."""
    words = shlex.split(view.provenance.get("command", ""))
    if words[:1] != ["mdstopo"] or words[1:2] not in (["run"], ["pareto"], ["sweep"], ["fit"]):
        words = ["mdstopo", view.kind, view.case_path or "CASE", "--out", str(view.path)]
    words = [word for word in words if word not in ("--overwrite", "--resume")]
    place = 3 if words[1] in ("run", "fit") else len(words)
    return shlex.join([*words[:place], "--resume", *words[place:]])


def values_text(values: "NDArray[np.generic]", shown: int = 6) -> str:
    """The values of a variable as text; of many only the first."""
    more = f", ... ({len(values)} values)" if len(values) > shown else ""
    return ", ".join(number(value, 9) for value in values[:shown]) + more


def condensed(count: int, rows: int = _ROWS) -> list[int]:
    """Indices of about `rows` out of `count` rows: the first, the last, and closer together at the start."""
    if count <= rows:
        return list(range(count))
    picked = {round((count - 1) * (i / (rows - 1)) ** 1.5) for i in range(rows)}
    return sorted(picked)


def _say_iterations(output: Output, view: "ResultView") -> None:
    columns = view.under("iterations")
    names = objective_names(view)
    total = len(columns["combined"])
    stages = _stages(columns)
    within = f" in {stages} {'rounds' if 'round' in columns else 'stages'}" if stages > 1 else ""
    output.say(f"{total - stages} iterations{within}, {int(columns['evaluations'][-1])} evaluations")
    rows = [["iterate", *names, "violation", "change", "KKT", "evaluations", "time"]]
    violations = _violations(view)
    rows += [
        [
            str(k),
            *(number(value) for value in columns["objectives"][k]),
            number(violations[k], 3),
            number(columns["change"][k], 3),
            number(columns["kkt"][k], 2) if "kkt" in columns else "",
            str(int(columns["evaluations"][k])),
            duration(float(columns["seconds"][k])),
        ]
        for k in condensed(total)
    ]
    output.table(rows)
    _say_failures(output, view)


def _violations(view: "ResultView") -> "NDArray[Any]":
    """(K + 1,) by how much each iterate breaks the constraint that it breaks most, each in its own unit; 0 where it
    keeps all of them, NaN where it could not be evaluated, or where the case cannot be read any more."""
    import numpy as np

    from mdstopo.case.text.errors import CaseError
    from mdstopo.starts.constraint_columns import exceeded
    from mdstopo.store.stored_case import case_of

    excess = np.asarray(view.array("iterations/constraints"), dtype=np.float64)
    try:
        rows = case_of(view).constraints if excess.size else ()
    except CaseError:  # a file that it needs is gone
        rows = ()
    broken = [np.maximum(exceeded(row.sense, excess[:, i]), 0.0) for i, row in enumerate(rows)]
    return np.max(broken, axis=0) if broken else np.full(len(excess), np.nan)


def _say_failures(output: Output, view: "ResultView") -> None:
    """Which iterates could not be evaluated, and why; those with the same reason together, of many only the first."""
    by_reason: dict[str, list[int]] = {}
    for k, reason in _failures(view):
        by_reason.setdefault(reason, []).append(k)
    for reason, failed in by_reason.items():
        more = f", ... ({len(failed)})" if len(failed) > _SHOWN else ""
        word = "iterates" if len(failed) > 1 else "iterate"
        output.say(f"{word} {', '.join(map(str, failed[:_SHOWN]))}{more} failed: {reason}")


def _failures(view: "ResultView") -> list[tuple[int, str]]:
    """The iterates that could not be evaluated, and why. Raises DamagedError where the file has not both for each."""
    from mdstopo.store.store_errors import DamagedError

    reasons = view.lines("failures/reason")
    iterates = view.array("failures/iterate").tolist() if reasons else []
    if len(iterates) != len(reasons):
        raise DamagedError(f"{view.path}: damaged: failures/iterate and failures/reason are not of one length")
    return list(zip(map(int, iterates), reasons, strict=True))


def _stages(columns: "Mapping[str, NDArray[Any]]") -> int:
    """How many stages, or rounds, there are so far: each begins with a row that is no iteration."""
    return next((int(columns[name][-1]) + 1 for name in ("stage", "round") if name in columns), 1)


def _say_starts(output: Output, view: "ResultView") -> None:
    starts = view.under("starts")
    if not starts:
        return
    output.say("starts")
    rows = [["start", *objective_names(view), "status", "KKT"]]
    reasons = view.lines("starts/reason")
    for index, word in enumerate(view.lines("starts/status")):
        known = word != "not_begun"
        values = (number(value) if known else "" for value in starts["objectives"][index])
        kkt = number(starts["kkt"][index], 2) if known and "kkt" in starts else ""
        dropped = bool(reasons) and reasons[index].startswith("dropped")
        rows.append([str(index + 1), *values, reasons[index] if dropped else word.replace("_", " "), kkt])
    output.table(rows)


def _say_front(output: Output, view: "ResultView") -> None:
    from mdstopo.cli.pareto import front_rows, quality_rows
    from mdstopo.store.whole_front import whole_front

    front, names = whole_front(view), objective_names(view)
    output.table(front_rows(names, front))
    output.table(quality_rows(names, view.settings, front))
    for j, word in enumerate(front["status"]):
        if word not in ("converged", "running"):
            output.say(f"point {j}: {front['reason'][j]}")


def _say_sweep(output: Output, view: "ResultView") -> None:
    keys = list(view.lines("sweep/keys"))
    columns = [view.lines(f"sweep/values/{key}") for key in keys]
    objectives, status = view.array("sweep/objectives"), view.lines("sweep/status")
    residuals = view.arrays.get("sweep/kkt")
    rows = [[*keys, *objective_names(view), "status", "KKT"]]
    for i, word in enumerate(status):
        cells = [*(column[i] for column in columns), *(number(value, 7) for value in objectives[i])]
        rows.append([*cells, word.replace("_", " "), "" if residuals is None else number(residuals[i], 2)])
    output.table(rows)
    reasons = view.lines("sweep/reason")
    for i, word in enumerate(status):
        if word == "failed":
            output.say(f"run {i}: {reasons[i]}")


def _say_trajectories(output: Output, view: "ResultView") -> None:
    for path, t in view.under("trajectories").items():
        if path.endswith("/t") and len(t):
            output.say(f"motion {path[:-2]}: {counted(len(t) - 1, 'step')} from {number(t[0])} to {number(t[-1])} s")


def _say_sensitivities(output: Output, view: "ResultView") -> None:
    for path, gradient in view.under("sensitivities").items():
        if gradient.ndim == 1 and len(gradient):
            output.say(f"sensitivities {path}: from {number(gradient.min())} to {number(gradient.max())}")


def _say_members(output: Output, view: "ResultView", count: int) -> None:
    import numpy as np

    if "design/alpha" not in view.arrays or count == 0:
        return
    values = view.under("design/variables")
    if values:
        output.say("design variables beside alpha")
        output.table([["name", "value"], *([name, values_text(each)] for name, each in values.items())])
    if not len(view.alpha):
        return
    alpha, design = view.alpha, np.asarray(view.array("members/design"), dtype=np.bool_)
    p, q = view.array("members/p")[design], view.array("members/q")[design]
    groups = np.array(view.lines("members/group"))[design]
    order = np.argsort(-alpha, kind="stable")[:count]
    output.say(f"the {len(order)} largest of {len(alpha)} design variables")
    axes = ["x", "y", "z"][1 : p.shape[1]]
    rows = [["number", "group", "alpha", "from x", *axes, "to x", *axes]]
    rows += [[str(i), str(groups[i]), *(number(v) for v in (alpha[i], *p[i], *q[i]))] for i in order]
    output.table(rows)


def _say_bounds(output: Output, view: "ResultView") -> dict[str, Any]:
    """Print the bounds that no members can do better than, where theory gives them; the same as data."""
    from mdstopo.cli.bound import document, result_bounds, say_bounds

    known = result_bounds(view)
    if known is None:
        return {}
    case, found = known
    output.say("bounds over all members")
    say_bounds(output, case, found)
    return {name: document(each) for name, each in found.items()}


def _document(view: "ResultView") -> dict[str, Any]:
    content: dict[str, Any] = {
        "command": "show",
        "kind": view.kind,
        "case": view.name,
        "title": view.title,
        "status": view.status,
        "reason": view.reason,
        "case_sha256": view.case_sha256,
        "settings": view.settings,
        "provenance": view.provenance,
        "warnings": view.warnings,
        "datasets": {path: list(array.shape) for path, array in view.arrays.items()},
        "resume": None if view.finished else resume_command(view),
    }
    if view.kind == "pareto":
        for name in ("weights", "objectives", "dominated", "evaluations", "kkt"):
            content[name] = view.array(f"pareto/{name}")
        content["point_status"] = list(view.lines("pareto/status"))
        content["further"] = {
            name: view.arrays[f"pareto/further/{name}"]
            for name in ("objectives", "dominated", "point", "iterate")
            if f"pareto/further/{name}" in view.arrays
        }
        content |= {
            name: view.arrays[f"pareto/{name}"] for name in ("ideal", "nadir") if f"pareto/{name}" in view.arrays
        }
    if view.kind == "run" and "iterations/combined" in view.arrays:
        columns = view.under("iterations")
        content["iterations"] = len(columns["combined"]) - _stages(columns)
        content["evaluations"] = int(columns["evaluations"][-1])
        content["kkt"] = residual_of(view)
        content["failures"] = [{"iterate": k, "reason": reason} for k, reason in _failures(view)]
        content["objectives"] = {name: columns["objectives"][:, i] for i, name in enumerate(objective_names(view))}
    if variables := view.under("design/variables"):
        content["variables"] = variables
    return content
