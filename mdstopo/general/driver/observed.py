"""What a general scene does at given times: responses there, and their derivatives, by `direct`.

Steps are made to end at these times, so that every value is one of a state that the integrator has computed, and its
derivative is that of the discrete motion, through events and all.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mdstopo.general.driver.general_driver import GeneralDriver
from mdstopo.general.model.general_model import GeneralModel
from mdstopo.general.scene.further_times import landed
from mdstopo.integrators.steps import OK, status_of
from mdstopo.scene.signal_segments import TIMES_APART
from mdstopo.scene.springs_model import FloatArray, IndexArray
from mdstopo.status import Status

#: arrays of a scene that a number may change so that `follow` differentiates by it
BALANCE = frozenset({"mass", "force", "load_force", "load_arm", "v0", "schur_constant"})
#: times closer than this, relative to the whole, are one
TOGETHER = 2.0 * TIMES_APART


@dataclass(frozen=True)
class Observed:
    """Responses at given times, of one motion.

    status, message: how the motion ended, in how many steps (count). inside: those of the times that steps had to end
    at. states (K,): the states at the times. values (R, K), rates (R, K) per s. who (R, K): members whose forces are
    meant.
    """

    status: Status
    message: str
    count: int
    inside: list[float]
    states: IndexArray
    values: FloatArray
    rates: FloatArray
    who: FloatArray


def observe(driver: GeneralDriver, design: FloatArray, times: FloatArray, rates: bool) -> Observed:
    """All responses of a driver with a design (N + P,) at rising times (K,) of its load case.

    rates: whether rates are wanted; else they may mean nothing.
    """
    window = driver.scene.load_case
    inside = times[(times > window.start) & (times < window.end)].tolist()
    code, count, _ = driver.run(design, True, inside)
    shape = len(driver.scene.responses), len(times)
    if code != OK:
        status, message = driver.explain(design, status_of(code), 0.0, np.zeros(0), np.zeros(0))
        return Observed(status, message, 0, inside, np.zeros(0, dtype=np.int64), *np.full((3, *shape), np.nan))
    t = driver.states()[0][: count + 1]
    behind = np.clip(np.searchsorted(t, times), 1, count)
    states = np.where(times - t[behind - 1] < t[behind] - times, behind - 1, behind)
    assert np.all(np.abs(t[states] - times) <= TOGETHER * (t[-1] - t[0])), "steps do not end where they have to"
    places = np.stack([np.maximum(states - 1.0, 0.0), (states > 0).astype(np.float64)], axis=1)
    js, who = np.arange(shape[0]), np.full(shape[::-1], -1)
    seen = driver.sample_responses(js, places, who, True, count, rates=rates)[2]
    by_kind = np.ascontiguousarray(seen.T)
    return Observed(Status.OK, "", count, inside, states, *by_kind)


def slopes(
    driver: GeneralDriver, seen: Observed, numbers: Sequence[tuple[GeneralModel, GeneralModel, float]]
) -> FloatArray:
    """(R, K, P + B): derivatives of what was observed last, by the laws' values and by B numbers of the scene.

    numbers: of each the scene with a larger and a smaller one, and by how much these differ; they may differ from the
    driver's in the arrays `BALANCE` alone.
    """
    times = landed(driver.with_start(), seen.inside).times.tolist()
    packed = [[driver.pack(landed(each, times))[1] for each in pair] for *pair, _ in numbers]
    shifted = np.array(packed) if packed else np.zeros((0, 2, 0))
    apart = np.array([each for *_, each in numbers])
    padded = np.zeros(len(driver.padded) + len(numbers))
    length = len(driver.alpha) + len(driver.values) + len(numbers)
    out = np.zeros((*seen.values.shape, length))
    driver.entry.follow(
        *driver.steps_arguments(seen.count), np.arange(len(out)), seen.states, seen.who, shifted, apart, False,
        driver.room, driver.room_ints, driver.member_state, padded, out, driver.start_slopes(), driver.work,
    )  # fmt: skip
    if driver.start is not None:
        _add_since_settled(driver, seen, out[..., : length - len(numbers)])
    return out[..., len(driver.alpha) :]


def _add_since_settled(driver: GeneralDriver, seen: Observed, out: FloatArray) -> None:
    """What displacements that count from where the scene has settled have of that place's derivatives.

    out (R, K, N + P): added to.
    """
    assert driver.start is not None
    q = driver.states()[1]
    for j in range(len(out)):
        if j in driver.start.since:
            for own, state in zip(out[j], seen.states, strict=True):
                driver.start.vjp(driver.start.since.cotangent(j, q[state]), own)
