"""Displacements that count from where a scene has settled: `since: settled`.

Such a response is g = e . (u(q) - u(q0)), with u the displacement of its point along the observer's axes, q0 the start
at rest, and e an axis, or the direction of u(q) - u(q0) where its norm is meant. Kernels know u(q0) as
numbers of the response (`GeneralModel.response_par`), and differentiate with these held. What they leave out is
-e . du/dq (q0), a cotangent of the start's positions, which `start.SettledStart` pulls through the equilibrium.
"""

import numpy as np

from mdstopo.general.driver_interface import DriverWithRun
from mdstopo.general.model.general_model import COMPONENT
from mdstopo.general.responses.extremes import FRACTION, STEP
from mdstopo.mechanics.kinematics.components import NORM, Z
from mdstopo.scene.springs_model import FloatArray


class SinceSettled:
    """The displacements among a driver's responses that count from the settled start, and where they count from at
    present."""

    def __init__(self, driver: DriverWithRun) -> None:
        self._driver = driver
        self._slopes: dict[int, FloatArray] = {
            j: np.zeros(0) for j, each in enumerate(driver.scene.responses) if each.since == "settled"
        }

    def __contains__(self, j: int) -> bool:
        return j in self._slopes

    def __bool__(self) -> bool:
        return bool(self._slopes)

    def numbers_at(self, q: FloatArray) -> FloatArray:
        """The numbers of all responses of a scene that has settled at q (n_q,), where so far they count from home."""
        numbers = self._driver.scene.model.response_par.copy()
        for j in self._slopes:
            u, self._slopes[j] = self._components(j, q)
            numbers[j, len(u) : 2 * len(u)] = u
        return numbers

    def row_cotangent(self, j: int, row: FloatArray, across: bool, count: int) -> FloatArray:
        """(n,) the derivative of a row of `extremes` by the place from which response j counts.

        across: of a norm the component perpendicular to its vector is meant. count: how many steps the motion has.
        """
        place = np.array([[row[STEP], row[FRACTION]]])
        (q, _), _, _ = self._driver.sample_response(j, place, True, count, rates=False)
        return self.cotangent(j, q[0], across)

    def cotangent(self, j: int, q: FloatArray, across: bool = False) -> FloatArray:
        """The derivative of response j by the settled start, at coordinates q (n_q,)."""
        u, _ = self._components(j, q)
        component = int(self._driver.scene.model.response[j, COMPONENT])
        if component == NORM:
            size = float(np.linalg.norm(u))
            e = u / size if size > 0.0 else np.zeros_like(u)
        else:
            e = np.eye(len(u))[2 if component == Z else component]
        if across:
            e = np.array([-e[1], e[0]])
        pulled: FloatArray = -(e @ self._slopes[j])
        return pulled

    def integral_cotangent(self, j: int, integral: int, count: int) -> FloatArray:
        """(n,) the derivative of the integral of response j (2: of its square) over so many steps by the place from
        which it counts."""
        from mdstopo.general.statics.since_settled_entry import integral_by_place

        d = self._driver
        out = np.zeros(len(self._slopes[j]))
        integral_by_place(
            d.entry.TAG, d.ints, d.floats, d.method.tables, d.limits, count, j, integral, d.room, d.room_ints,
            d.member_state, np.zeros_like(d.padded), out, d.work,
        )  # fmt: skip
        pulled: FloatArray = out @ self._slopes[j]
        return pulled

    def _components(self, j: int, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The displacement that response j measures, along the observer's axes, and its slopes by q."""
        from mdstopo.general.statics.since_settled_entry import components

        d = self._driver
        bodies = d.scene.kinematics
        size = bodies.freedoms - bodies.rotations
        u, slopes = np.zeros(size), np.zeros((size, len(d.scene.model.mass)))
        components(d.ints, d.floats, j, q, u, slopes)
        return u, slopes
