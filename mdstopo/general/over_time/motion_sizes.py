"""Up to what size responses are rounding, by what the bodies of a scene do.

What joints hold at zero is a difference of large numbers that cancel. Its own size is then rounding, and tells nothing;
how far, how fast and with what forces bodies move tells how large rounding may be.
"""

from collections.abc import Mapping

import numpy as np

from mdstopo.case.responses.response_kinds import kind_of
from mdstopo.general.driver_interface import DriverWithRun
from mdstopo.general.dynamics.members import SCALE
from mdstopo.general.model.general_model import GROUP, START, STOP
from mdstopo.general.scene.extent import size_of
from mdstopo.mechanics.kinematics.kinematics_interface import Kinematics
from mdstopo.scene.bodies import distances
from mdstopo.scene.springs_model import FloatArray

#: below this share of what it may be a response is rounding
NOUGHT = 1e-12
#: by the unit of a number of a law: the unit of the size by which it makes a force
MAKES_FORCE = {"N/m": "stretch", "N s/m": "m/s", "kg": "m/s^2"}


def motion_sizes(driver: DriverWithRun, count: int) -> dict[str, float]:
    """The size of what bodies do in a run of `count` steps, by the unit of responses; `stretch`: how far points move.

    Velocities and accelerations are those of points within the scene's size of a body, but no less than this size in
    the whole time: of a scene at rest these are rounding themselves. Forces are those that bodies need which nothing
    drives, and those that load them.
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
    load, load_moment = _largest(bodies, np.abs(model.force[..., 0]).max(axis=0, keepdims=True) * model.free)
    rate = max(spin + speed / size, slow)
    second = max(twist + spin * spin + push / size, slow * slow)
    force = needed + load + (needed_moment + load_moment) / size
    sizes = {
        "m": size,
        "m/s": size * rate,
        "m/s^2": size * second,
        "rad": 1.0,
        "rad/s": rate,
        "rad/s^2": second,
        "N": force,
        "N m": force * size,
        "stretch": shift + size * turn,
    }
    # what a rounding of stretches stores is a square of it
    groups = range(len(driver.case.members))
    stored = sum(_of_members(driver, group, {"N/m": sizes["stretch"] ** 2}) for group in groups)
    sizes["J"] = NOUGHT * (stored + force * size)
    return sizes


def rounding_of(driver: DriverWithRun, j: int, sizes: Mapping[str, float]) -> float:
    """Up to what size response j is rounding, in its unit; 0 where nothing is known of that, as of expressions.

    sizes: of `motion_sizes`.
    """
    response = driver.scene.responses[j]
    kind = kind_of(response)
    if not kind.of_members:
        return NOUGHT * sizes.get(kind.unit, 0.0)
    group = [each.name for each in driver.case.members].index(response.group or "")
    return NOUGHT * _of_members(driver, group, {unit: sizes[by] for unit, by in MAKES_FORCE.items()})


def _of_members(driver: DriverWithRun, group: int, sizes: Mapping[str, float]) -> float:
    """The numbers of the laws of a group, by its place among all, each times the size that stands at its unit, and
    times the largest scale that the design gives members of the group."""
    block, laws = driver.scene.model.block, driver.case.members[group].laws
    own = block[block[:, GROUP] == group][:, [START, STOP]].tolist()
    scale = max((float(driver.member_state[SCALE, start:stop].max()) for start, stop in own), default=0.0)
    return scale * sum(abs(value) * sizes[unit] for law in laws for value, unit in law.in_units(tuple(sizes)))


def _largest(bodies: Kinematics, changes: FloatArray) -> tuple[float, float]:
    """The largest shift and the largest turn among changes of all bodies (T, n)."""
    moves, turns = bodies.shifts_and_turns(changes)
    return float(distances(moves).max()), float(distances(turns).max())
