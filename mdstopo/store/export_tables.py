"""A result file as tables of text, or as one JSON document, for programs that read no HDF5."""

import csv
import io
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from mdstopo.case.model import Case
from mdstopo.case.responses.columns import point_columns, reaction_columns, state_columns
from mdstopo.store.json_values import json_value
from mdstopo.store.labels import WITHOUT_POINTS
from mdstopo.store.result_reader import ResultView
from mdstopo.store.whole_front import whole_front

Table = tuple[list[str], list[Sequence[Any]]]


def tables(view: ResultView, case: Case) -> dict[str, Table]:
    """Header and rows by name: members, iterations, front, sweep, fit, samples, each load case's trajectory."""
    found: dict[str, Table] = {"members": _members(view, case)}
    names = view.lines("objectives")
    iterations = view.under("iterations")
    if "combined" in iterations:
        found["iterations"] = _columns("iteration", iterations, {"objectives": names, "peak_time": names}, "combined")
    if "pareto/objectives" in view.arrays:
        front = {key: value for key, value in whole_front(view).items() if "/" not in key}
        texts = {key: front.pop(key) for key in ("status", "reason")}
        front = {key: value for key, value in front.items() if key != "alpha" and key not in WITHOUT_POINTS}
        front |= {key: np.array(value) for key, value in texts.items() if value}
        per_name = dict.fromkeys(("weights", "objectives", "utopia", "maxima"), names)
        found["front"] = _columns("point", front, per_name, "weights")
    sweep = {key: value for key, value in view.under("sweep").items() if "/" not in key}
    if "objectives" in sweep:
        values = {path: np.array(text) for path, text in view.texts.items() if path.startswith("sweep/values/")}
        named = {path.removeprefix("sweep/values/"): value for path, value in values.items()}
        sweep = {key: value for key, value in sweep.items() if key != "alpha" and value.ndim <= 2}
        found["sweep"] = _columns("run", named | sweep, {"objectives": names}, "objectives")
    if view.kind == "fit":
        found |= _fit(view)
    for name, group in (("sample", "uncertainty"), ("fresh-sample", "uncertainty/validation")):
        if f"{group}/objectives" in view.arrays:
            found[name] = _points(view, group)
    for load_case in case.load_cases:
        motion = view.under(f"trajectories/{load_case.name}")
        if "q" in motion:
            found[f"trajectory-{load_case.name}"] = _trajectory(case, motion)
    return found


def _members(view: ResultView, case: Case) -> Table:
    p, q, design = (view.array(f"members/{name}") for name in ("p", "q", "design"))
    ends = [f"{end}_{axis}_m" for end in ("from", "to") for axis in point_columns(case)]
    header = ["member", "group", *ends, "length_m", "design"]
    columns: list[Any] = [
        range(len(p)), view.lines("members/group"), *p.T.tolist(), *q.T.tolist(),
        np.linalg.norm(np.subtract(q, p), axis=1).tolist(), design.astype(int).tolist(),
    ]  # fmt: skip
    places = np.flatnonzero(design)
    extra: dict[str, Any] = {}
    if "design/alpha" in view.arrays:
        extra["alpha"] = view.alpha
    if "pareto/alpha" in view.arrays:
        extra |= {f"alpha_point_{k}": row for k, row in enumerate(whole_front(view)["alpha"])}
    for path, array in view.under("sensitivities").items():
        if "history/" not in path and "variables" not in path.split("/")[:-1]:
            extra["dG/dalpha " + path.replace("/", " ")] = array
    for name, values in extra.items():
        if values.shape == places.shape:
            whole = np.full(len(p), np.nan)
            whole[places] = values
            header.append(name)
            columns.append(whole.tolist())
    return header, [list(row) for row in zip(*columns, strict=True)]


def _fit(view: ResultView) -> dict[str, Table]:
    """Estimates, each measured series, and all that was tried."""
    arrays, names = view.under("fit"), view.lines("fit/estimates")
    columns = [key for key in ("value", "deviation", "low", "high", "lower", "upper", "initial") if key in arrays]
    rows: list[Sequence[Any]] = [[name, *(arrays[key][i].item() for key in columns)] for i, name in enumerate(names)]
    found: dict[str, Table] = {"estimates": (["estimate", *columns], rows)}
    series = view.lines("fit/series/name")
    for name in series:
        own = view.under(f"fit/measured/{name}")
        found[f"measured-{name}"] = _columns("number", own, {}, "t")
    tried = view.under("fit/evaluations")
    found["evaluations"] = _columns("evaluation", tried, {"x": names, "root_mean_square": series}, "start")
    return found


def _points(view: ResultView, group: str) -> Table:
    """The points of a sample of an uncertain case, and the values there."""
    names, objectives = view.lines("uncertainty/keys"), view.lines("objectives")
    values, found = view.array(f"{group}/sample"), view.array(f"{group}/objectives")
    limits = view.array(f"{group}/constraints")
    header = ["point", "scenario", *names, *objectives, *(f"constraints {i}" for i in range(limits.shape[1]))]
    columns: list[Any] = [range(len(found)), view.lines(f"{group}/scenario")]
    columns += [*values.T.tolist(), *found.T.tolist(), *limits.T.tolist()]
    return header, [list(row) for row in zip(*columns, strict=True)]


def _trajectory(case: Case, motion: Mapping[str, Any]) -> Table:
    header, columns = ["t_s"], [motion["t"]]
    for name in ("q", "v", "a"):
        if name in motion:
            header += [f"{name} {column}" for column in state_columns(case, name)]
            columns += list(motion[name].T)
    for name, array in motion.items():
        if name.startswith("reactions/"):
            header += [f"{name.removeprefix('reactions/')}.{part}" for part in reaction_columns(case)]
            columns += list(array.T)
    return header, [list(row) for row in zip(*(column.tolist() for column in columns), strict=True)]


def _columns(first: str, arrays: Mapping[str, Any], names: Mapping[str, Sequence[str]], leader: str) -> Table:
    count = len(arrays[leader])
    header: list[str] = [first]
    columns: list[Any] = [range(count)]
    for key, array in arrays.items():
        if len(array) != count or array.ndim > 2 or key == first:
            continue
        if array.ndim == 1:
            header.append(key)
            columns.append(array.tolist())
            continue
        given = names.get(key, ())
        labels = given if len(given) == array.shape[1] else [str(i) for i in range(array.shape[1])]
        header += [f"{key} {label}" for label in labels]
        columns += array.T.tolist()
    return header, [list(row) for row in zip(*columns, strict=True)]


def as_csv(table: Table) -> str:
    """One table as text; a number has all its digits, nothing stands for what is not known."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    header, rows = table
    writer.writerow(header)
    for row in rows:
        writer.writerow(["" if isinstance(x, float) and math.isnan(x) else x for x in row])
    return stream.getvalue()


def as_json(view: ResultView) -> Iterator[str]:
    """The whole file as one JSON object, in pieces: attributes, and every dataset by its path; null for NaN."""
    head = {
        "kind": view.kind,
        "status": view.status,
        "reason": view.reason,
        "name": view.name,
        "title": view.title,
        "mdstopo": view.version,
        "case_sha256": view.case_sha256,
        "provenance": dict(view.provenance),
        "settings": dict(view.settings),
    }
    yield json.dumps(head, indent=1)[:-2] + ',\n "datasets": {'
    separator = "\n"
    for path, text in sorted(view.texts.items()):
        yield f"{separator}  {json.dumps(path)}: {json.dumps(text)}"
        separator = ",\n"
    for path, array in sorted(view.arrays.items()):
        yield f"{separator}  {json.dumps(path)}: {json.dumps(json_value(array))}"
        separator = ",\n"
    yield "\n }\n}\n"
