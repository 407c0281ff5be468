"""Up to what size responses are rounding, by what the bodies of a scene do.

What joints hold at zero is a difference of large numbers that cancel. Its own size is then rounding, and tells nothing;
how far, how fast and with what forces bodies move tells how large rounding may be.
"""

from collections.abc import Mapping

import numpy as np

from mdstopo.case.arrays import TimeFormula
from mdstopo.case.model import GROUND, Signal
from mdstopo.case.responses.response_kinds import kind_of
from mdstopo.general.driver_interface import DriverWithRun
from mdstopo.general.dynamics.members import SCALE
from mdstopo.general.model.general_model import GROUP, START, STOP
from mdstopo.general.scene.extent import size_of
from mdstopo.general.scene.timed_loads import at_ends
from mdstopo.mechanics.kinematics.kinematics_interface import Kinematics
from mdstopo.scene.bodies import distances
from mdstopo.scene.signal_segments import segment_values, signals_of
from mdstopo.scene.springs_model import FloatArray

#: below this share of what it may be a response is rounding
ROUNDING_SHARE = 1e-12
#: elongations are at least so large, relative to the scene: they are differences of coordinates, whose rounding is this
#: share of ROUNDING_SHARE
LEAST_ELONGATION = 1e-3
#: by the unit of a number of a law: which size it makes a force of
MAKES_FORCE = {"N/m": "elongation", "N s/m": "m/s", "kg": "m/s^2"}


def motion_sizes(driver: DriverWithRun, count: int) -> dict[str, float]:
    """The size of what bodies do in a run of `count` steps, by the unit of responses; `elongation`: how far points go.

    Velocities and accelerations are those of points within the scene's size of a body, and at least the scene's size
    over the duration: of a scene at rest these are rounding themselves. Forces are mass times acceleration of what
    nothing drives, and the applied loads. An energy is one of forces over the scene's size, and what springs store.
    """
    bodies, model, size = driver.scene.kinematics, driver.scene.model, size_of(driver.case)
    places = np.column_stack([np.append(np.arange(count), count - 1), np.append(np.zeros(count), 1.0)])
    (q, (v, a)), _, _ = driver.sample_response(-1, places, False, count, rates=False)
    times = driver.states()[0]
    slow = 1.0 / float(times[count] - times[0])
    shift, turn = _largest(bodies, bodies.differences(q, q[0]))
    speed, spin = _largest(bodies, v)
    push, twist = _largest(bodies, a)
    needed, needed_moment = _largest(bodies, a * (model.mass * model.free))
    load, load_moment = _applied(driver)
    rate = max(spin + speed / size, slow)
    second = max(twist + spin * spin + push / size, slow * slow)
    force = needed + load + (needed_moment + load_moment) / size
    elongation = max(shift + size * turn, LEAST_ELONGATION * size)
    stored = sum(_of_members(driver, group, {"N/m": elongation**2}) for group in range(len(driver.case.members)))
    return {
        "m": size,
        "m/s": size * rate,
        "m/s^2": size * second,
        "rad": 1.0,
        "rad/s": rate,
        "rad/s^2": second,
        "N": force,
        "N m": force * size,
        "elongation": elongation,
        # a rounding of elongations stores a square of it
        "J": ROUNDING_SHARE * (stored + force * size),
    }


def rounding_of(driver: DriverWithRun, j: int, sizes: Mapping[str, float]) -> float:
    """Up to what size response j is rounding, in its unit; 0 where nothing is known of that, as of expressions.

    sizes: of `motion_sizes`.
    """
    response = driver.scene.responses[j]
    kind = kind_of(response)
    if not kind.of_members:
        return ROUNDING_SHARE * sizes.get(kind.unit, 0.0)
    group = [each.name for each in driver.case.members].index(response.group or "")
    return ROUNDING_SHARE * _of_members(driver, group, {unit: sizes[by] for unit, by in MAKES_FORCE.items()})


def _of_members(driver: DriverWithRun, group: int, sizes: Mapping[str, float]) -> float:
    """The numbers of the laws of a group, by its place among all, each times the size that stands at its unit, and
    times the largest scale that the design gives members of the group."""
    block, laws = driver.scene.model.block, driver.case.members[group].laws
    own = block[block[:, GROUP] == group][:, [START, STOP]].tolist()
    scale = max((float(driver.member_state[SCALE, start:stop].max()) for start, stop in own), default=0.0)
    return scale * sum(abs(value) * sizes[unit] for law in laws for value, unit in law.in_units(tuple(sizes)))


def _applied(driver: DriverWithRun) -> tuple[float, float]:
    """The applied force (N), with weights, and the applied moment (N m): the largest sizes of all loads together."""
    bodies, model, load_case = driver.scene.kinematics, driver.scene.model, driver.scene.load_case
    force, moment = _largest(bodies, np.abs(model.force[..., 0]).max(axis=0, keepdims=True) * model.free)
    inertias = {body.name: float(np.abs(body.inertia).max()) for body in load_case.bodies}
    for load in load_case.loads:
        if load.body != GROUND:
            sizes = [_most(signal, model.times) for signal in signals_of(load)]
            force += sum(sizes[: len(load.force)])
            turns = sum(sizes[len(load.force) :])
            moment += turns * (inertias[load.body] if load.angular_acceleration is not None else 1.0)
    return force, moment


def _most(signal: Signal, times: FloatArray) -> float:
    """The largest size of a signal at the ends of segments (s), on both sides, and of a formula in their middles."""
    if isinstance(signal, TimeFormula):
        halves = np.union1d(times, 0.5 * (times[1:] + times[:-1]))
        return float(np.abs(at_ends(signal, halves)[..., 0]).max())
    start, slope = segment_values(signal, times).T
    return float(np.maximum(np.abs(start), np.abs(start + slope * np.diff(times))).max())


def _largest(bodies: Kinematics, changes: FloatArray) -> tuple[float, float]:
    """The largest shift and the largest turn among changes of all bodies (T, n)."""
    moves, turns = bodies.shifts_and_turns(changes)
    return float(distances(moves).max()), float(distances(turns).max())
