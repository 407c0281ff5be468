"""Joints, bushings, loads and prescribed motions: which symbol stands where, and where it points."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from mdstopo.case.arrays import Table, TimeFormula
from mdstopo.case.model import GROUND, Case, Load, LoadCase, Prescribed, PrescribedRotation
from mdstopo.case.scene.prescribed import size_of
from mdstopo.plots.scenery import Floats
from mdstopo.scene.point_positions import points_at

#: of the largest: what is smaller has no arrow
NO_ARROW = 1e-6
#: times at which a load that is a formula is sampled for its largest value
SAMPLES = 201
#: kinds that change with time
LOADS = ("load", "moment")
#: kinds of prescribed motions
MOTIONS = ("motion", "turning", "held", "unturned")


@dataclass(frozen=True)
class Symbol:
    """A symbol in a picture. kind: of `glyphs`. at (d,): in coordinates of `body`; end: the same of another body, to
    which a line is drawn.

    way (d,): where it points, in coordinates of `axes`, a body or ground; zero where it points nowhere. size: of the
    largest of its kind, negative for a turn that is clockwise in the plane, 0 of a load that does not act.
    """

    kind: str
    body: str
    at: Floats
    end: tuple[str, Floats] | None = None
    way: Floats | None = None
    axes: str = GROUND
    size: float = 1.0

    @property
    def is_tie(self) -> bool:
        """Whether it is that of a joint or a bushing."""
        return self.kind not in (*LOADS, *MOTIONS)


def symbols(case: Case, load_case: str | None = None, time: float | None = None) -> list[Symbol]:
    """Everything that is drawn of a load case, the first where none is named.

    time: at which loads are shown, if they act then; None shows each at its largest. What stands in several places is
    there once.
    """
    return [each for each in every_symbol(case, load_case, time) if each.size != 0.0]


def every_symbol(case: Case, load_case: str | None = None, time: float | None = None) -> list[Symbol]:
    """The same with loads that do not act at the time, of size 0: so many, in this order, there are at all times."""
    chosen = case.load_cases[0] if load_case is None else case.load_case(load_case)
    return [*_ties(case), *_motions(case, chosen), *_loads(case, chosen, time)]


def _ties(case: Case) -> Iterator[Symbol]:
    for joint in case.joints:
        far = (joint.bodies[1], np.array(joint.at_second)) if joint.is_link else None
        way = getattr(joint, "axis", None)
        if case.dimension == 3:
            own: Any = joint
            way = own.axes_first[0] if own.axis_key else None
        axis = None if way is None else np.array(way, dtype=np.float64)
        yield Symbol(joint.type, joint.bodies[0], np.array(joint.at_first), far, axis, joint.bodies[0])
    for bushing in case.bushings:
        yield Symbol("bushing", bushing.bodies[0], np.array(bushing.at_first))


def _motions(case: Case, chosen: LoadCase) -> Iterator[Symbol]:
    middle = np.zeros(case.dimension)
    for motion in chosen.motions:
        body = case.body(motion.body)
        for k, name in enumerate("xyz"[: case.dimension]):
            own = getattr(motion, name)
            if own is not None:
                rate = float(body.velocity[k])
                kind = "held" if _is_held(own, rate) else "motion"
                way = np.eye(case.dimension)[k] * (_sense(own, rate, chosen) if kind == "motion" else 1.0)
                yield Symbol(kind, motion.body, middle, way=way)
        if motion.angle is not None:
            kind = "unturned" if _is_held(motion.angle, _rate(body)) else "turning"
            size = _sense(motion.angle, _rate(body), chosen) if kind == "turning" else 1.0
            yield Symbol(kind, motion.body, middle, size=size)
        if motion.rotation is not None:
            yield Symbol("unturned" if _stands(motion.rotation) else "turning", motion.body, middle)


def _sense(own: Prescribed, rate: float, chosen: LoadCase) -> float:
    """1 or -1, the sign of what is prescribed of a coordinate, within the load case: of an acceleration or a velocity
    where it is largest, of a position less its first where that is largest, and of the rate at the start where the
    acceleration is 0. The same braking points backwards as an acceleration and forwards as a velocity."""
    signal, span = own.signal, (chosen.start, chosen.end)
    first = _value(signal, chosen.start) if own.kind == "position" else 0.0
    inner = [t for t in _times((signal,), span) if chosen.start < t < chosen.end]
    values = np.array([_value(signal, t) for t in (chosen.start, *inner, chosen.end)]) - first
    largest = float(values[np.abs(values).argmax()])
    return float(np.copysign(1.0, largest or rate))


def _rate(body: Any) -> float:
    """The angular velocity of a body in the plane at the start, rad/s."""
    return float(body.angular_velocity)


def _is_held(own: Prescribed, rate: float) -> bool:
    """Whether what is prescribed of a coordinate is that it stays. rate: of the coordinate at the start, as stated."""
    if own.kind == "position" and isinstance(own.signal, Table):
        return float(np.ptp(own.signal.values)) == 0.0
    return size_of(own.signal) == 0.0 and (own.kind != "acceleration" or rate == 0.0)


def _stands(rotation: PrescribedRotation) -> bool:
    """Whether what is prescribed of a rotation is that there is none; accelerations may turn what turns already."""
    return all(size_of(signal) == 0.0 for signal in rotation.signals) and not any(
        angle.kind == "acceleration" for angle in rotation.angles
    )


def _loads(case: Case, chosen: LoadCase, time: float | None) -> Iterator[Symbol]:
    d, span = case.dimension, (chosen.start, chosen.end)
    found: list[tuple[str, Load, Floats]] = []
    for load in chosen.loads:
        found.append(("load", load, _shown(load.force, time, span)))
        turning = load.angular_acceleration if load.angular_acceleration is not None else load.moment
        found.append(("moment", load, _shown(turning if isinstance(turning, tuple) else (turning,), time, span)))
    largest = {
        kind: max(
            (float(np.linalg.norm(_shown(_signals(each, kind), None, span))) for _, each, _ in found), default=0.0
        )
        for kind in ("load", "moment")
    }
    for kind, load, value in found:
        size = float(np.linalg.norm(value))
        acts = size > NO_ARROW * largest[kind]
        axes = load.body if load.frame == "body" else GROUND
        way = (value / size if acts else np.zeros(d)) if kind == "load" or d == 3 else None
        share = float(np.copysign(size / largest[kind], value[0] if way is None else 1.0)) if acts else 0.0
        yield Symbol(kind, load.body, np.array(load.at_local), None, way, axes, share)


def _signals(load: Load, kind: str) -> tuple[Any, ...]:
    if kind == "load":
        return load.force
    turning = load.angular_acceleration if load.angular_acceleration is not None else load.moment
    return turning if isinstance(turning, tuple) else (turning,)


def _shown(signals: tuple[Any, ...], time: float | None, span: tuple[float, float]) -> Floats:
    """The vector at a time; without one, where its norm is largest between two times."""
    if time is not None:
        return np.array([_value(each, time) for each in signals])
    values = np.array([[_value(each, t) for each in signals] for t in _times(signals, span)])
    return np.asarray(values[int(np.linalg.norm(values, axis=1).argmax())])


def _times(signals: tuple[Any, ...], span: tuple[float, float]) -> list[float]:
    """Times among which signals are searched for their largest values: of rows, and of formulas evenly in a span."""
    times = np.unique(np.concatenate([[0.0], *(each.times for each in signals if isinstance(each, Table))]))
    if any(isinstance(each, TimeFormula) for each in signals):
        times = np.union1d(times, np.linspace(*span, SAMPLES))
    return [float(t) for t in times]


def _value(signal: Any, time: float) -> float:
    if isinstance(signal, TimeFormula):
        return signal.at(time)
    if isinstance(signal, Table):
        return float(np.interp(time, signal.times, signal.values[:, 0]))
    return float(signal)


def placed(case: Case, symbol: Symbol, q: Floats) -> tuple[Floats, Floats | None, Floats | None]:
    """At a state q: the place of a symbol (d,), its direction (d,), and the place (d,) of its other end."""
    state = q[None]
    at = points_at(case, symbol.body, symbol.at[None], state)[0, 0]
    end = None if symbol.end is None else points_at(case, symbol.end[0], symbol.end[1][None], state)[0, 0]
    if symbol.way is None:
        return at, None, end
    ends = points_at(case, symbol.axes, np.array([symbol.way, np.zeros_like(symbol.way)]), state)[0]
    return at, np.asarray(ends[0] - ends[1]), end
