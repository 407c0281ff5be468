"""What the page shows, as plain data: everything that the script draws is computed here."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import GROUND, Case
from mdstopo.case.responses.response_units import unit_of, unit_of_value, words
from mdstopo.engine import Evaluator
from mdstopo.limiting.compare import compared, kept_iterates
from mdstopo.plots.acting import DOTS, IDLE, NOT_ACTING
from mdstopo.plots.beside import FREE, side_places
from mdstopo.plots.body_shapes import planar_shapes
from mdstopo.plots.cloud import FAR_SIZES
from mdstopo.plots.glyphs import glyphs
from mdstopo.plots.member_forces import Chosen, forces_of
from mdstopo.plots.objectives_over_time import response_history
from mdstopo.plots.scenery import points_of, start_state
from mdstopo.plots.slack import CORNERS, DASHES, DEEPEST, SLACK, THIN, belt_lengths, down
from mdstopo.plots.solids import solid
from mdstopo.plots.source import Source
from mdstopo.plots.style import ink
from mdstopo.plots.surface_lines import surfaces_of
from mdstopo.plots.symbols import LOADS, Symbol, symbols
from mdstopo.plots.thickness import families, strongest, thickness
from mdstopo.plots.views import upright
from mdstopo.plots.windows_of_laws import active_windows
from mdstopo.report.fit_tables import fit_part
from mdstopo.report.report_tables import best_iterate, constraint_rows, member_peaks, objective_rows, parts, peak_of
from mdstopo.store.json_values import json_value
from mdstopo.store.set_keys import without_set_keys
from mdstopo.store.whole_front import whole_front

Floats = NDArray[np.float64]

#: frames of a motion, samples of a response; designs of a front that are simulated; members that are drawn, at most
FRAMES, SAMPLES, SIMULATED, DRAWN = 81, 161, 60, 10_000
#: moments beside the steps at which the largest forces are looked for
PEAKS = 401
#: pixels of a screen in a point
PIXELS = 96.0 / 72.0


def content(source: Source) -> dict[str, Any]:
    """The page's data; numbers are rounded to what a screen can show."""
    case, view = source.case, source.view
    names = list(source.names)
    known = _bounds(source)
    kkts = view.arrays.get("iterations/kkt", np.zeros(0))
    objectives = {each.name: each for each in case.objectives}
    page: dict[str, Any] = {
        "title": source.title,
        "status": view.status.replace("_", " "),
        "reason": view.reason,
        "kkt": _rounded(kkts[-1:], 2)[0] if view.kind == "run" and len(kkts) else None,
        "kind": view.kind,
        "warnings": list(view.warnings),
        "case": view.case_text,
        "versions": dict(view.provenance),
        "settings": without_set_keys(view.settings),
        "objectives": [
            {"name": name, "unit": unit_of_value(objectives[name]), "what": _what(case, name),
             "load_case": objectives[name].load_case, "over_time": objectives[name].over_time,
             "bound": known.get(name)}
            for name in names
        ],
        "load_cases": list(source.load_cases),
        "dimension": case.dimension,
        "bodies": _bodies(case),
        "start": _rounded(start_state(case)),
        "symbols": _symbols(case),
        "far": FAR_SIZES,
        "hang": {"slack": SLACK, "deepest": DEEPEST, "corners": CORNERS, "down": _rounded(down(case)),
                 "thin": THIN, "dashes": DASHES, "free": FREE * PIXELS,
                 "idle": {"word": NOT_ACTING, "width": IDLE * PIXELS, "dots": DOTS, "colour": ink("middle")}},
        "designs": _designs(source),
    }  # fmt: skip
    if case.dimension > 2:
        page |= {"upright": upright(case).tolist(), "surfaces": _surfaces(case)}
    else:
        page["contacts"] = _contacts(case)
    told = [each for one in page["symbols"].values() for some in (one["still"], *one["loads"]) for each in some]
    kinds = {each["kind"] for each in told} | {"ground", "gravity"}
    page["glyphs"] = {
        kind: {"strokes": [_rounded(stroke, 4) for stroke in glyph.strokes], "fill": glyph.fill, "words": glyph.words}
        for kind, glyph in glyphs().items()
        if kind in kinds
    }
    if view.kind == "fit":
        page["fit"] = _rounded_part(fit_part(source))
    iterations = view.under("iterations")
    if "combined" in iterations:
        page["iterations"] = {
            "objectives": _rounded(iterations["objectives"].T),
            "combined": _rounded(iterations["combined"]),
            "kept": kept_iterates(case, view).tolist() if view.kind == "run" else None,
            "best": best_iterate(source),
        }
        page["summary"] = json_value(objective_rows(source))
        page["limits"] = json_value(constraint_rows(source))
    if "pareto/objectives" in view.arrays:
        front = whole_front(view)
        page["front"] = {
            "objectives": _rounded(front["objectives"]),
            "weights": _rounded(front["weights"]),
            "dominated": front["dominated"].tolist(),
            "status": front["status"],
            "reason": front["reason"],
            "kkt": _rounded(front["kkt"], 2),
        }
    return page


def _bounds(source: Source) -> dict[str, dict[str, Any]]:
    """What no members do better, beside the best of a run or a front; of the objectives for which theory gives it."""
    if source.view.kind not in ("run", "pareto"):
        return {}
    found = compared(source.case, source.view)
    largest = {each.name for each in source.case.objectives if each.sense == "maximize"}
    return {
        name: {"value": each.bound, "why": each.why, "best": each.best, "gap": each.gap, "above": name in largest}
        for name, each in found.items()
        if each.bound is not None
    }


def _what(case: Case, name: str) -> str:
    """The response of an objective, and its measure in an uncertain case; courses over time are of the nominal case."""
    what = words(_objective(case, name).response)
    return what if case.uncertainty is None else f"{what}, {case.uncertainty.objectives[name].words}"


def _bodies(case: Case) -> list[dict[str, Any]]:
    found = []
    for name in [*(body.name for body in case.bodies), GROUND]:
        if name == GROUND and not len(points_of(case, name)):
            continue
        points = [grid.local for grid in case.points.values() if grid.body == name]
        cloud = np.concatenate(points) if points else np.zeros((0, case.dimension))
        found.append({"name": name, **_shape(case, name), "points": _rounded(cloud)})
    return found


def _shape(case: Case, body: str) -> dict[str, Any]:
    """What is drawn of a body beside its points: shapes in the plane, a solid in space."""
    if case.dimension == 2:
        shapes = planar_shapes(case, body)
        borders = [shape.border for shape in shapes if shape.border is not None]
        return {
            "areas": [[_rounded(area) for area in shape.areas] for shape in shapes if shape.areas],
            "lines": [_rounded(line) for shape in shapes for line in shape.lines],
            "arms": [_rounded(arm) for shape in shapes for arm in shape.arms],
            "thin_arms": any(shape.thin_arms for shape in shapes),
            "borders": [_rounded(border) for border in borders],
        }
    shape = solid(case, body)
    return {"corners": _rounded(shape.corners), "faces": shape.faces, "edges": shape.edges, "convex": shape.convex}


def _contacts(case: Case) -> list[dict[str, Any]]:
    """Edges that points may touch, in the plane, and these points."""
    index = _numbers(case)
    return [
        {"edge_body": index[each.edge_body], "edge": [list(each.edge_from), list(each.edge_to)],
         "body": index[each.body], "points": _rounded(each.points)}
        for each in case.contacts
    ]  # fmt: skip


def _numbers(case: Case) -> dict[str, int]:
    """Bodies by their names, ground last."""
    return {name: i for i, name in enumerate([*(body.name for body in case.bodies), GROUND])}


def _symbols(case: Case) -> dict[str, Any]:
    """Of each load case: what stands still, and the loads over its time, FRAMES of them evenly."""
    found = {}
    for each in case.load_cases:
        still = [_symbol(case, symbol) for symbol in symbols(case, each.name) if symbol.kind not in LOADS]
        times = np.linspace(each.start, each.end, FRAMES).tolist()
        loads = [
            [_symbol(case, symbol) for symbol in symbols(case, each.name, t) if symbol.kind in LOADS] for t in times
        ]
        found[each.name] = {
            "still": still, "start": each.start, "end": each.end, "gravity": list(each.gravity),
            "loads": loads[:1] if all(some == loads[0] for some in loads) else loads,
        }  # fmt: skip
    return found


def _symbol(case: Case, symbol: Symbol) -> dict[str, Any]:
    index = _numbers(case)
    end = None if symbol.end is None else [index[symbol.end[0]], _rounded(symbol.end[1])]
    way = None if symbol.way is None else _rounded(symbol.way, 4)
    return {"kind": symbol.kind, "body": index[symbol.body], "at": _rounded(symbol.at), "end": end, "way": way,
            "axes": index[symbol.axes], "size": round(symbol.size, 3)}  # fmt: skip


def _surfaces(case: Case) -> list[dict[str, Any]]:
    """Lines of the surfaces that points may touch."""
    index = _numbers(case)
    return [
        {"body": index[each.body], "lines": [_rounded(line) for line in each.lines], "endless": each.endless}
        for each in surfaces_of(case)
    ]


def _designs(source: Source) -> list[dict[str, Any]]:
    """One design of a run, or all of a front; each with its members, motions and responses."""
    arrays = source.view.arrays
    if "pareto/alpha" not in arrays:
        return [_design(source, source.engine, source.design)]
    front = whole_front(source.view)
    values = [front[f"variables/{each.name}"] for each in source.case.variables]
    designs = np.concatenate([front["alpha"], *values], axis=1).astype(np.float64)
    usable = [k for k in range(len(designs)) if np.isfinite(designs[k]).all()]
    chosen = set(usable[:: max(1, math.ceil(len(usable) / SIMULATED))])
    return [_design(source, source.engine, designs[k], k in chosen) if k in usable else {} for k in range(len(designs))]


def _design(source: Source, engine: Evaluator, alpha: Floats, moves: bool = True) -> dict[str, Any]:
    case = source.case
    members, kept = _members(source, alpha)
    design: dict[str, Any] = {"members": members, "motions": {}}
    moved: dict[str, Any] = {}
    for load_case in case.load_cases if moves else ():
        motion = engine.trajectory(alpha, load_case.name)
        last = float(motion.t[-1])
        if len(motion.t) < 2:
            continue
        frames = np.linspace(motion.t[0], last, FRAMES)
        states = motion.at(frames)
        forces = forces_of(case, alpha, kept, states.q, states.v)
        times = np.linspace(motion.t[0], last, SAMPLES)
        histories = response_history(engine, alpha, load_case.name, times)
        fine = np.unique(np.concatenate([motion.t, np.linspace(motion.t[0], last, PEAKS)]))
        moved[load_case.name] = (fine, motion.at(fine))
        design["motions"][load_case.name] = {
            "t": _rounded(frames),
            "q": _rounded(states.q),
            "force": None if forces is None else _rounded(forces, 4),
            "whole": motion.status.ok,
            "times": _rounded(times),
            "responses": [
                {"name": name, "unit": unit_of(_objective(case, name).response), "values": _rounded(values),
                 "peak": _peak(source, (alpha, load_case.name, name), times, values)}
                for name, values in histories.items()
            ],
        }  # fmt: skip
    peaks = member_peaks(source, alpha, kept, moved) if moved else None
    design["parts"] = [
        {key: _rounded(value, 5) if key in _NUMBERS and value is not None else value for key, value in part.items()}
        for part in parts(source, alpha, kept, peaks)
    ]
    return design


#: of a part: what is rounded
_NUMBERS = ("p", "q", "length", "size", "force", "time")


def _peak(source: Source, chosen: tuple[Floats, str, str], times: Floats, values: Floats) -> Any:
    """Time and value of the peak of an objective's response. chosen: the design, the load case, the objective."""
    design, load_case, name = chosen

    def at(other: Floats) -> Floats:
        return response_history(source.engine, design, load_case, other)[name]

    found = peak_of(_objective(source.case, name).over_time, times, values, at)
    return None if found is None else _rounded(found)


def _objective(case: Case, name: str) -> Any:
    return next(each for each in case.objectives if each.name == name)


def _members(source: Source, alpha: Floats) -> tuple[dict[str, Any], Chosen]:
    """Members that are thick enough to be seen, the thickest first where there are many; and which they are.

    Rows of: the number of the group, of both bodies, the ends in their coordinates, the thickness, the number in the
    group. Of each row besides: the place beside others of the same ends (`side_places`), the length as a belt or null,
    from when on and until when each of its laws acts or null (`active_windows`).
    """
    case = source.case
    thick = thickness(source, alpha[: case.n_design])
    index, named = _numbers(case), families(case)
    order = list(dict.fromkeys(named))
    kept: Chosen = []
    rows: list[list[Any]] = []
    beside: list[float] = []
    belts: list[float | None] = []
    windows: list[Any] = []
    timed = active_windows(source.stated, alpha)
    strong = strongest(thick.shares, DRAWN)
    every = zip(case.members, thick.shares, strong, side_places(case, strong), named, strict=True)
    for group, share, chosen, side, family in every:
        kept.append((group, chosen))
        longest = belt_lengths(case, group)
        beside += side.tolist()
        belts += [None] * len(chosen) if longest is None else _rounded(longest[chosen])
        windows += _rounded(timed[group.name][chosen]) if group.name in timed else [None] * len(chosen)
        a, b = index[group.body_from], index[group.body_to]
        p, q = group.p_local[chosen], group.q_local[chosen]
        for k, i in enumerate(chosen.tolist()):
            own = [*_rounded(p[k]), *_rounded(q[k]), round(float(share[i]), 3), i]
            rows.append([order.index(family), a, b, *own])
    fixed = [all(not group.design for group, each in zip(case.members, named, strict=True) if each == family)
             for family in order]  # fmt: skip
    found = {"groups": order, "fixed": fixed, "what": thick.what, "all": case.n_members,
             "rows": rows, "beside": beside, "belts": belts, "windows": windows}  # fmt: skip
    return found, kept


def _rounded(array: Any, digits: int = 6) -> Any:
    """Nested lists with so many significant digits; null for what is not finite."""
    values = np.asarray(array, dtype=np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.where((values != 0.0) & np.isfinite(values), np.floor(np.log10(np.abs(values))), 0.0)
    factor = 10.0 ** np.clip(digits - 1 - size, -300, 300)
    return json_value(np.where(np.isfinite(values), np.round(values * factor) / factor, np.nan))


def _rounded_part(value: Any) -> Any:
    """A mapping, or a list of such, with its lists of numbers rounded."""
    if isinstance(value, dict):
        return {key: _rounded_part(each) for key, each in value.items()}
    if isinstance(value, list):
        numbers = all(isinstance(each, (int, float)) for each in value)
        return _rounded(value) if numbers and value else [_rounded_part(each) for each in value]
    return value
