"""What the page shows, as plain data: everything that the script draws is computed here."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import GROUND, Case, MemberGroup, SpatialJoint
from mdstopo.case.units import unit_of, unit_of_value, words
from mdstopo.engine import Evaluator
from mdstopo.limiting.compare import compared
from mdstopo.plots.scenery import outline, points_of, sizes, start_state
from mdstopo.plots.solids import solid
from mdstopo.plots.source import Source
from mdstopo.plots.surface_lines import surfaces_of
from mdstopo.plots.views import upright
from mdstopo.plots.watch import response_history
from mdstopo.scene.points import point_rates, points_at
from mdstopo.store.whole_front import whole_front

Floats = NDArray[np.float64]

#: frames of a motion, samples of a response; designs of a front that are simulated; members that are drawn, at most
FRAMES, SAMPLES, SIMULATED, DRAWN = 81, 161, 60, 10_000
#: share of its range below which a member is not drawn
FAINT = 0.02


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
        "kkt": _plain(_rounded(kkts[-1:], 2))[0] if view.kind == "run" and len(kkts) else None,
        "kind": view.kind,
        "warnings": list(view.warnings),
        "case": view.case_text,
        "versions": dict(view.provenance),
        "settings": {key: value for key, value in view.settings.items() if not key.startswith("set ")},
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
        "designs": _designs(source),
    }  # fmt: skip
    if case.dimension > 2:
        page |= {"upright": upright(case).tolist(), "joints": _joints(case), "surfaces": _surfaces(case)}
    iterations = view.under("iterations")
    if "combined" in iterations:
        page["iterations"] = {
            "objectives": _rounded(iterations["objectives"].T),
            "combined": _rounded(iterations["combined"]),
        }
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
    """What an objective looks at, and its measure in an uncertain case; what is shown over time is the nominal case."""
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
    """What is drawn of a body beside its points: an outline in the plane, a solid in space."""
    if case.dimension == 2:
        return {"outline": _rounded(outline(case, body))}
    shape = solid(case, body)
    return {"corners": _rounded(shape.corners), "faces": shape.faces, "edges": shape.edges}


def _surfaces(case: Case) -> list[dict[str, Any]]:
    """Lines of the surfaces that points may touch."""
    index = {name: i for i, name in enumerate([*(body.name for body in case.bodies), GROUND])}
    return [
        {"body": index[each.body], "lines": [_rounded(line) for line in each.lines], "endless": each.endless}
        for each in surfaces_of(case)
    ]


def _joints(case: Case) -> list[dict[str, Any]]:
    """Where joints are on their first body, and their axes there."""
    index = {name: i for i, name in enumerate([*(body.name for body in case.bodies), GROUND])}
    return [
        {"name": joint.name, "type": joint.type, "body": index[joint.bodies[0]], "at": _rounded(joint.at_first),
         "axis": _rounded(joint.axes_first[0]) if joint.axis_key else None}
        for joint in case.joints
        if isinstance(joint, SpatialJoint)
    ]  # fmt: skip


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
    members, kept = _members(case, alpha)
    design: dict[str, Any] = {"members": members, "motions": {}}
    for load_case in case.load_cases if moves else ():
        motion = engine.trajectory(alpha, load_case.name)
        last = float(motion.t[-1])
        if len(motion.t) < 2:
            continue
        frames = np.linspace(motion.t[0], last, FRAMES)
        states = motion.at(frames)
        forces = _forces(case, alpha, kept, states.q, states.v)
        times = np.linspace(motion.t[0], last, SAMPLES)
        histories = response_history(engine, alpha, load_case.name, times)
        design["motions"][load_case.name] = {
            "t": _rounded(frames),
            "q": _rounded(states.q),
            "force": None if forces is None else _rounded(forces, 4),
            "whole": motion.status.ok,
            "times": _rounded(times),
            "responses": [
                {"name": name, "unit": unit_of(_objective(case, name).response), "values": _rounded(values)}
                for name, values in histories.items()
            ],
        }
    return design


def _objective(case: Case, name: str) -> Any:
    return next(each for each in case.objectives if each.name == name)


def _members(case: Case, alpha: Floats) -> tuple[dict[str, Any], list[tuple[MemberGroup, NDArray[np.int64]]]]:
    """Members that are thick enough to be seen, the thickest first where there are many; and which they are."""
    slices = case.group_slices
    shares = []
    for group in case.members:
        if group.design:
            shares.append(sizes(group, alpha[slices[group.name]]))
        else:
            shares.append(np.ones(len(group)))
    every = np.concatenate(shares) if shares else np.zeros(0)
    least = max(FAINT, float(np.sort(every)[-DRAWN]) if len(every) > DRAWN else 0.0)
    index = {name: i for i, name in enumerate([*(body.name for body in case.bodies), GROUND])}
    kept, rows = [], []
    for g, (group, share) in enumerate(zip(case.members, shares, strict=True)):
        chosen = np.flatnonzero(share >= least)
        kept.append((group, chosen))
        a, b = index[group.body_from], index[group.body_to]
        p, q = group.p_local[chosen], group.q_local[chosen]
        for k, i in enumerate(chosen.tolist()):
            rows.append([g, a, b, *_rounded(p[k]), *_rounded(q[k]), round(float(share[i]), 3), i])
    return {"groups": [group.name for group in case.members], "rows": rows, "all": len(every)}, kept


def _forces(
    case: Case, alpha: Floats, kept: list[tuple[MemberGroup, NDArray[np.int64]]], q: Floats, v: Floats
) -> Floats | None:
    """f* (T, K) of the members that are drawn, pull positive.

    None where a law's force depends on more than elongation and rate, or acts for a time, and where laws vary.
    """
    slices, columns = case.group_slices, []
    if case.variables:
        return None
    for group, chosen in kept:
        if not all(law.active_from is None and law.active_until is None for law in group.laws):
            return None
        p = points_at(case, group.body_from, group.p_local[chosen], q)
        r = points_at(case, group.body_to, group.q_local[chosen], q) - p
        length = np.linalg.norm(r, axis=2)
        parting = point_rates(case, group.body_to, group.q_local[chosen], q, v)
        parting = parting - point_rates(case, group.body_from, group.p_local[chosen], q, v)
        rate = np.einsum("tki,tki->tk", r, parting) / np.where(length > 0.0, length, 1.0)
        scale = alpha[slices[group.name]][chosen] ** group.power if group.design else np.ones(len(chosen))
        total = np.zeros_like(length)
        for law in group.laws:
            stated = getattr(law, "free_length", None)
            force = law.force_at(length - (group.length[chosen] if stated is None else stated), rate)
            if force is None:
                return None
            total += force
        columns.append(scale * total)
    return np.concatenate(columns, axis=1) if columns else np.zeros((len(q), 0))


def _rounded(array: Any, digits: int = 6) -> Any:
    """Nested lists with so many significant digits; null for what is not finite."""
    values = np.asarray(array, dtype=np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.where((values != 0.0) & np.isfinite(values), np.floor(np.log10(np.abs(values))), 0.0)
    factor = 10.0 ** np.clip(digits - 1 - size, -300, 300)
    plain = np.where(np.isfinite(values), np.round(values * factor) / factor, np.nan)
    return _plain(plain.tolist())


def _plain(value: Any) -> Any:
    if isinstance(value, list):
        return [_plain(each) for each in value]
    return None if value != value else value
