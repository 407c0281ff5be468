"""From Python to the compiled entries that price candidates (`springs_candidate_prices`): their arguments and
results."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mdstopo.case.model import GROUND, MemberGroup, SpringLaw
from mdstopo.case.scene.candidates import lengths_between
from mdstopo.compiler.threads import allowed
from mdstopo.integrators.steps import FIRST, WORK, carve
from mdstopo.mechanics.kinematics.planar_poses import POSE
from mdstopo.scene.compile_scene import NEAR_HOME
from mdstopo.scene.springs_model import (
    DAMPING,
    EXCESS,
    KIND,
    L0,
    MEMBER,
    PAIR,
    PRELOAD,
    PX,
    PY,
    QX,
    QY,
    STIFFNESS,
    VECTOR,
    WIDTH,
    FloatArray,
    IndexArray,
)
from mdstopo.sensitivity import springs_candidate_prices as kernels
from mdstopo.sensitivity.candidate_pass import CandidatePass
from mdstopo.sensitivity.springs_candidate_prices import F0, FREE, NO_ROOM, C, K

if TYPE_CHECKING:
    from mdstopo.sensitivity.springs_driver import SpringsDriver

#: members that are priced at once
AT_ONCE = 1 << 16


class SpringPricingStates(NamedTuple):
    """The states from which the price of any member follows, of a weighted sum of rows.

    pose (S, n_pair, POSE) and change (S, n_pair, 3): relative poses and their virtual changes; point (E, n_pair, POSE)
    and weight (E,): relative poses, and the weights of the stored energy in them.
    """

    pose: FloatArray
    change: FloatArray
    point: FloatArray
    weight: FloatArray

    @classmethod
    def of_all(cls, parts: "Sequence[SpringPricingStates]") -> "SpringPricingStates":
        """Those of several motions of the same bodies together."""
        return cls(*(np.concatenate(each) for each in zip(*parts, strict=True)))

    def of_pair(self, pair: int) -> "tuple[FloatArray, FloatArray, FloatArray]":
        """Poses (S + E, 1, POSE), changes (S, 1, 3), weights (E,) of one pair, without those that change no price."""
        moved = self.change[:, pair].any(axis=1)
        seen = self.weight != 0.0
        poses = np.concatenate([self.pose[moved, pair], self.point[seen, pair]])[:, None]
        changes = np.ascontiguousarray(self.change[moved, pair][:, None])
        return np.ascontiguousarray(poses), changes, self.weight[seen]


def pricing_states_of(driver: "SpringsDriver", factor: FloatArray) -> SpringPricingStates:
    """The states from which prices follow, of the rows of a driver's last evaluation times factor (n_obj, R)."""
    n, n_pair, damped, turning = driver.shape
    limits = [int(each) for each in driver.limits]
    index = carve.py_func(driver.room, driver.room_ints, n, n_pair, limits[1], limits[2], damped, turning)[2]  # type: ignore[attr-defined]
    stages = int(index[driver.count, FIRST])
    more = 64
    while True:
        pose, change = np.zeros((stages + more, n_pair, POSE)), np.zeros((stages + more, n_pair, 3))
        point, weight = np.zeros((more, n_pair, POSE)), np.zeros(more)
        poses, points = kernels.row_poses(
            driver.entry.TAG, driver.packed.ints, driver.packed.floats, driver.method.tables, damped, driver.settings,
            driver.limits, driver.count, driver.reductions, driver.rows, driver.row_counts, factor, driver.room,
            driver.room_ints, driver.strength, stages, pose, change, point, weight, np.zeros(WORK, dtype=np.int64),
        )  # fmt: skip
        if poses != NO_ROOM:
            return SpringPricingStates(pose[:poses], change[:poses], point[:points], weight[:points])
        more *= 4


class SpringCandidates(CandidatePass[SpringPricingStates]):
    """The candidates of a group of springs between free bodies, in the plane.

    group: as the scene has it; block: its row of `Model.block`; homes, count: as of `CandidatePass`.
    """

    def __init__(
        self,
        group: MemberGroup,
        block: IndexArray,
        homes: tuple[FloatArray, FloatArray],
        count: int | None = None,
    ) -> None:
        # as `scene.origin.ends_of` has it
        super().__init__(group, homes, group.body_to == GROUND and not block[WIDTH], count)
        (law,) = group.laws
        assert isinstance(law, SpringLaw)
        self._law, self._kind, self.pair = law, int(block[KIND]), int(block[PAIR])
        self._first, self._second = (group.from_local, group.to_local)[self.order]
        self._far = float(np.sqrt((self._second**2).sum(axis=1).max()))

    def common(self, states: SpringPricingStates, worth: float) -> FloatArray:
        """See `CandidatePass.common`; with the law."""
        law, common = self._law, super().common(states, worth)
        common[[K, C, F0]] = law.stiffness, law.damping, law.preload
        common[FREE] = -1.0 if law.free_length is None else law.free_length
        return common

    def fill_tiles(
        self, states: SpringPricingStates, common: FloatArray, which: IndexArray, out: FloatArray, prices: FloatArray
    ) -> None:
        """See `CandidatePass.fill_tiles`."""
        rows, columns = self.chosen
        ends = (self._first[rows], self._second[columns], self.homes[0][rows], self.homes[1][columns])
        first, second, first_home, second_home = (np.ascontiguousarray(each.T) for each in ends)
        pose, change, weight = states.of_pair(self.pair)
        kernels.price_candidates(
            first, second, first_home, second_home, *self.smoothness(states), common, self._kind, pose, change, weight,
            *self.by_tile, which, allowed(), out, prices,
        )  # fmt: skip

    def prices_between(self, states: SpringPricingStates, a: IndexArray, b: IndexArray) -> FloatArray:
        """The derivatives (K,) by alpha of members from first points to second ones."""
        law, own = self._law, states.of_pair(self.pair)
        found, lengths = np.empty(len(a)), lengths_between(self.homes[0][a], self.homes[1][b])
        for start in range(0, len(a), AT_ONCE):
            part = slice(start, start + AT_ONCE)
            count, length = len(a[part]), lengths[part]
            member, out = np.zeros((MEMBER, -(-count // VECTOR) * VECTOR)), np.empty(-(-count // VECTOR) * VECTOR)
            here = member[:, :count]
            here[[PX, PY]], here[[QX, QY]] = self._first[a[part]].T, self._second[b[part]].T
            here[L0] = length if law.free_length is None else law.free_length
            here[EXCESS] = (length - here[L0]) * (length + here[L0])
            here[[STIFFNESS, DAMPING, PRELOAD]] = np.array([law.stiffness, law.damping, law.preload])[:, None]
            member[:STIFFNESS, count:] = member[:STIFFNESS, count - 1 : count]  # no place has a length of its own
            far = NEAR_HOME * float(length.max())
            near = np.array([[far**2, min(far / max(self._far, 1e-300), 1.0) ** 2]])
            kernels.price_members(member, self._kind, near, *own, out)
            found[part] = out[:count]
        return found
