"""Derived quantities that `check` shows."""

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.arrays import Signal, TimeFormula
from mdstopo.case.model import GROUND, Case, Contact, SpringLaw, SurfaceContact, Table, VolumeRow
from mdstopo.case.responses.columns import point_columns
from mdstopo.case.responses.response_units import BOUNDED
from mdstopo.cli.output import number
from mdstopo.cli.values_of_motion import group_names
from mdstopo.scene.bodies import placed

if TYPE_CHECKING:
    from mdstopo.scene.vibration_modes import Modes

Floats = NDArray[np.float64]

_RIGID = 1e-6  # share of the highest frequency below which a mode counts as free motion


class Vibrates(Protocol):
    """What has modes of small motion about the start."""

    def start_modes(self, alpha: Floats, load_case: str) -> "Modes": ...


def growing_rates(modes: "Modes") -> Floats:
    """The rates in 1/s of the modes of negative stiffness, the fastest first."""
    rates: Floats = np.sqrt(-modes.squares[modes.squares < -modes.least])
    return rates


def totals(case: Case) -> list[tuple[str, float, str]]:
    """Name, value and unit of each number that sums up the case."""
    masses = np.array([body.mass for body in case.bodies])
    positions = np.array([body.position for body in case.bodies]).reshape(-1, case.dimension)
    rows = [("mass", float(masses.sum()), "kg")]
    if len(masses):
        center = masses @ positions / masses.sum()
        axes = point_columns(case)
        rows += [(f"centre of mass, {axis}", float(value), "m") for axis, value in zip(axes, center, strict=True)]
    if case.n_design:
        rows += [
            ("volume at alpha = 1", float(case.cost.sum()), ""),
            ("volume of the initial design", float(case.cost @ case.initial), ""),
        ]
    stiffness = sum(
        len(group) * law.stiffness for group in case.members for law in group.laws if isinstance(law, SpringLaw)
    )
    if stiffness:
        rows.append(("stiffness of all springs at alpha = 1", float(stiffness), "N/m"))
    for load_case in case.load_cases:
        label = "" if len(case.load_cases) == 1 else f", {load_case.name}"
        rows.append((f"duration{label}", load_case.end - load_case.start, "s"))
        force = masses.sum() * np.array(load_case.gravity)
        for load in load_case.loads:
            if load.body != GROUND:
                force += [_at(component, load_case.start) for component in load.force]
        rows += [
            (f"external force at the start{label}, {axis}", float(value), "N")
            for axis, value in zip(point_columns(case), force, strict=True)
        ]
    return rows


def body_rows(case: Case) -> list[list[str]]:
    """A table of the bodies: mass, inertia, and how they stand at the start."""
    if case.dimension == 2:
        rows = [["body", "mass, kg", "inertia, kg m2", "x, m", "y, m", "angle, rad"]]
        for body in case.bodies:
            values = (body.mass, body.inertia, *body.position, body.angle)
            rows.append([body.name, *(number(value) for value in values)])
        return rows
    rows = [["body", "mass, kg", "principal moments, kg m2", "x, m", "y, m", "z, m", "turned by, rad"]]
    for body in case.bodies:
        moments = ", ".join(number(value) for value in np.linalg.eigvalsh(body.inertia))
        angle = float(np.arccos(np.clip(0.5 * (np.trace(body.rotation) - 1.0), -1.0, 1.0)))
        rows.append([body.name, number(body.mass), moments, *(number(value) for value in (*body.position, angle))])
    return rows


def material(case: Case) -> list[list[str]]:
    """The volume rows, and what designs make of them."""
    rows = []
    for row in case.constraints:
        if isinstance(row, VolumeRow):
            values = (
                row.bound,
                *(row.spent(x) for x in (case.start, *_bounds(case))),
            )
            rows.append([group_names(row), BOUNDED[row.sense], *(number(value) for value in values)])
    return rows


def _bounds(case: Case) -> tuple[Floats, Floats]:
    """Designs with everything at its lower, and at its upper bound."""
    low, high = [case.lower], [case.upper]
    for each in case.variables:
        low.append(np.full(each.count, each.lower))
        high.append(np.full(each.count, each.upper))
    return np.concatenate(low), np.concatenate(high)


def frequencies(case: Case, engine: Vibrates) -> list[dict[str, Any]]:
    """For each load case the natural frequencies of the initial design and of the lower bounds, in rad/s, and the rates
    of modes that grow for want of stiffness, in 1/s.

    `criterion` is omega(initial) omega(lower bounds) t1^2 of the lowest elastic mode, None where there is
    none: only above 4 is stored energy lowest on the stiff branch.
    """
    found = []
    for load_case in case.load_cases:
        duration = load_case.end - load_case.start
        modes = [engine.start_modes(alpha, load_case.name) for alpha in (case.start, _bounds(case)[0])]
        initial, lower = (_elastic(each.frequencies) for each in modes)
        growing = (growing_rates(each).tolist() for each in modes)
        both = min(len(initial), len(lower)) > 0
        found.append(
            {
                "load_case": load_case.name,
                "duration": duration,
                "initial": initial.tolist(),
                "lower": lower.tolist(),
                "growing": dict(zip(("initial", "lower"), growing, strict=True)),
                "criterion": float(initial[0] * lower[0] * duration**2) if both else None,
            }
        )
    return found


def _elastic(values: Floats) -> Floats:
    """Rising, without free motion."""
    rising: Floats = np.sort(np.asarray(values, dtype=np.float64))
    elastic: Floats = rising[rising > _RIGID * rising.max(initial=0.0)]
    return elastic


def _at(signal: Signal, time: float) -> float:
    """A signal's value at a time, right-continuous."""
    if isinstance(signal, TimeFormula):
        return signal.at(time)
    if not isinstance(signal, Table):
        return float(signal)
    after = int(np.searchsorted(signal.times, time, side="right"))
    if after == 0 or after == len(signal.times):
        return float(signal.values[min(after, len(signal.times) - 1), 0])
    t0, t1 = signal.times[after - 1 : after + 1]
    v0, v1 = signal.values[after - 1 : after + 1, 0]
    return float(v0 + (v1 - v0) * (time - t0) / (t1 - t0))


def depths(case: Case) -> list[Floats]:
    """(n,) the largest depth of each contact's points at the start (m); below 0 where they are in front of it, -inf
    where beside it."""
    return [_surface_depths(case, each) if case.dimension > 2 else _edge_depths(case, each) for each in case.contacts]


def _edge_depths(case: Case, contact: Contact) -> Floats:
    points = _global(case, contact.body, contact.points)
    first, second = _global(case, contact.edge_body, np.array([contact.edge_from, contact.edge_to]))
    along = (second - first) / np.hypot(*(second - first))
    off = points - first
    beside = (off @ along < 0.0) | (off @ along > np.hypot(*(second - first)))
    # the left of the way from the first end to the second is free
    return np.where(beside, -np.inf, along[1] * off[:, 0] - along[0] * off[:, 1])


def _surface_depths(case: Case, contact: SurfaceContact) -> Floats:
    surface, name = contact.surface, contact.edge_body
    points = _global(case, contact.body, contact.points)
    if name != GROUND:
        body = case.body(name)
        points = (points - np.array(body.position)) @ body.rotation
    off = (points - np.array(surface.place)) @ surface.axes.T
    beside = np.zeros(len(off), dtype=bool)
    if surface.shape in ("plane", "rectangle"):
        if surface.shape == "rectangle":
            beside = (np.abs(off[:, :2]) > np.array(surface.sizes)).any(axis=1)
        return np.where(beside, -np.inf, -off[:, 2])
    if surface.shape == "cylinder":
        beside = (off[:, 2] < 0.0) | (off[:, 2] > surface.sizes[1])
        off = off[:, :2]
    inward = surface.sizes[0] - np.linalg.norm(off, axis=1)
    return np.where(beside, -np.inf, -inward if surface.hollow else inward)


def _global(case: Case, name: str, points: Floats) -> Floats:
    """Points (n, d) of a body at the start."""
    return points if name == GROUND else placed(case.body(name), points)
