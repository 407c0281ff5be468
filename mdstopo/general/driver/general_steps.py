"""The steps of one simulation of a general scene in arrays of their own, and the motion between them."""

from typing import TYPE_CHECKING

import numpy as np

from mdstopo.general.model.general_model import JOINT_FIRST
from mdstopo.general.scene.turning_drives import global_moments
from mdstopo.scene.springs_model import FloatArray

if TYPE_CHECKING:
    from mdstopo.general.driver.general_driver import GeneralDriver


class GeneralSteps:
    """The steps of one simulation, and the motion between them (`integrators.scene_driver.Steps`)."""

    def __init__(self, driver: "GeneralDriver", count: int) -> None:
        self._driver = driver
        # the model too: a later evaluation may land on other times (`GeneralDriver.run`)
        packed = driver.ints, driver.floats
        self.kept = packed, driver.limits, driver.room.copy(), driver.room_ints.copy(), driver.member_state.copy()
        self.count = count
        t, q, v = driver.states()
        self.t: FloatArray = t[: count + 1].copy()
        self.q: FloatArray = q[: count + 1].copy()
        self.v: FloatArray = v[: count + 1].copy()

    def balanced(self, times: FloatArray) -> tuple[tuple[FloatArray, FloatArray, FloatArray], FloatArray]:
        """States and accelerations at times (T,): q (T, n_q), v, a (T, n) and lam (T, n_rows) of joints and motions;
        right-continuous."""
        if self.count == 0:
            raise ValueError("no step was completed")
        step = np.clip(np.searchsorted(self.t, times, side="right") - 1, 0, self.count - 1)
        fraction = (times - self.t[step]) / (self.t[step + 1] - self.t[step])
        fraction[times == self.t[step + 1]] = 1.0
        places = np.stack([step.astype(np.float64), fraction], axis=1)
        (q, out), solved, _ = self._driver.sample_response(-1, places, True, self.count, self)
        return (q, out[0], out[1]), self._all_rows(q, solved)

    def at(self, times: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Coordinates q (T, n_q), velocities v and accelerations a (T, n) at times (T,) within what was simulated."""
        return self.balanced(np.asarray(times, dtype=np.float64))[0]

    def _all_rows(self, q: FloatArray, solved: FloatArray) -> FloatArray:
        """The multipliers of all rows, joints then motions; where rows repeat others, those of least norm."""
        model = self._driver.scene.model
        n_row = int(model.size[0])
        places = [(j, r) for j in range(len(model.joint)) for r in range(int(model.joint[j, 4]))]
        lam = np.zeros((len(q), len(places)))
        for i, (j, r) in enumerate(places):
            if model.row[j, r] >= 0:
                lam[:, i] = solved[:, model.row[j, r]]
        if n_row < len(places):
            each = self._driver.scene.kinematics.freedoms
            slopes_of = self._driver.scene.kinematics.of_python("slopes_of")
            phi, jac = np.zeros(model.row.shape), np.zeros((*model.row.shape, 2 * each))
            for k in range(len(q)):
                slopes_of(model.joint, model.joint_par, model.home, q[k].copy(), phi, jac)
                dense = np.zeros((len(places), len(model.mass)))
                for i, (j, r) in enumerate(places):
                    for c in range(2 * each):
                        dense[i, each * int(model.joint[j, JOINT_FIRST + c // each]) + c % each] += jac[j, r, c]
                dense[:, model.free == 0] = 0.0
                lam[k] = np.linalg.lstsq(dense.T, dense.T @ lam[k], rcond=1e-10)[0]
        return np.concatenate([lam, global_moments(model, q, solved[:, n_row:])], axis=1)

    def reactions(self, q: FloatArray, lam: FloatArray) -> dict[str, FloatArray]:
        """Joint name -> force and moment (T, D) on its first body, at states q (T, n_q) with lam (T, n_rows)."""
        model = self._driver.scene.model
        row = np.full(model.row.shape, -1, dtype=np.int64)
        i = 0
        for j in range(len(model.joint)):
            for r in range(int(model.joint[j, 4])):
                row[j, r] = i
                i += 1
        full = np.zeros((len(q), len(model.q0)))
        full[:, : q.shape[1]] = q
        out = np.zeros((len(q), len(model.joint), self._driver.scene.kinematics.freedoms))
        of_all = self._driver.scene.kinematics.of_python("reactions")
        of_all(model.joint, model.joint_par, model.home, row, full, np.ascontiguousarray(lam), out)
        return {joint.name: out[:, j].copy() for j, joint in enumerate(self._driver.case.joints)}
