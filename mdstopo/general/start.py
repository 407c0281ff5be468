"""Where the motion of a general scene starts: as stated, or at rest where the case asks for `settle`.

A start at rest depends on the design. So its cotangent, which the reverse sweep leaves, is pulled through the
equilibrium (`settle.Settled.inverse`), and the direct method begins with its derivatives.
"""

from typing import TYPE_CHECKING

import numpy as np

from mdstopo.case.errors import CaseError
from mdstopo.case.model import Case
from mdstopo.general.model import COUNT, DESIGN, START, pack_general
from mdstopo.mechanics.joints.table import describe
from mdstopo.scene.model import FloatArray

if TYPE_CHECKING:
    from mdstopo.general.driver import GeneralDriver
    from mdstopo.general.settle import Settled

#: misfit of a joint at the start, relative to the scene's size or speeds, up to which it fits
FITS = 1e-8


class SettledStart:
    """The start of one driver at rest; `settled` is that of the last design."""

    def __init__(self, driver: "GeneralDriver") -> None:
        n = len(driver.scene.model.mass)
        self._driver = driver
        self._stated: FloatArray = driver.floats[n : 3 * n].copy()
        self._design: bytes | None = None
        self.settled: Settled | None = None
        self.message = ""
        self._refuse()

    def move(self, alpha: FloatArray) -> bool:
        """Put the driver's start where it is at rest with alpha (N,); False where there is no such place nearby."""
        if self._design == alpha.tobytes():
            return True
        from mdstopo.general.settle import settle

        driver, n = self._driver, len(self._stated) // 2
        self._design = None
        ints, floats = pack_general(driver.scene.model)
        floats[n : 3 * n] = self._stated
        driver.start_from(ints, floats)
        found = settle(driver, alpha.copy(), self._stated[:n], size_of(driver.case))
        if isinstance(found, str):
            self.message = found
            return False
        self.settled = found
        floats[n : 2 * n] = found.q
        self._design = alpha.tobytes()
        return True

    def slopes(self, alpha: FloatArray) -> FloatArray:
        """(M_padded, n): derivatives of the start's positions by each alpha^mu."""
        assert self.settled is not None
        slopes: FloatArray = np.ascontiguousarray(self._unit_forces(alpha) @ self.settled.inverse.T)
        return slopes

    def pull(self, alpha: FloatArray, start: FloatArray, out: FloatArray) -> None:
        """out (N,) += what the start's positions, with cotangents start (n,), have of the derivative by alpha (N,)."""
        assert self.settled is not None
        model = self._driver.scene.model
        padded = self._unit_forces(alpha) @ (self.settled.inverse.T @ start)
        for block, mu in zip(model.block.tolist(), model.power.tolist(), strict=True):
            first, count, at = block[DESIGN], block[COUNT], block[START]
            if first >= 0:
                out[first : first + count] += mu * alpha[first : first + count] ** (mu - 1.0) * padded[at : at + count]

    def _unit_forces(self, alpha: FloatArray) -> FloatArray:
        """(M_padded, n): what each design member's alpha^mu adds to the forces at rest."""
        from mdstopo.general.settle_entry import unit_forces

        assert self.settled is not None
        driver = self._driver
        out = np.zeros((driver.scene.model.member.shape[1], len(driver.scene.model.mass)))
        unit_forces(driver.ints, driver.floats, alpha, np.zeros_like(driver.strength), self.settled.q.copy(), out)
        return out

    def _refuse(self) -> None:
        """Refuse a case whose initial design has nowhere to settle, or whose start velocities do not fit there."""
        driver, problem = self._driver, ""
        case, scene = driver.case, driver.scene
        if not self.move(np.array(case.initial)):
            problem = self.message
        elif len(scene.model.joint):
            from mdstopo.general.start_entry import assemble

            n, count = len(self._stated) // 2, len(scene.model.joint)
            rates = np.zeros((count, 3))
            q, v = driver.floats[n : 2 * n].copy(), driver.floats[2 * n : 3 * n].copy()
            assemble(driver.ints, driver.floats, q, v, False, np.zeros((count, 3)), rates)
            torn = np.abs(rates).max(axis=1)
            span = scene.load_case.end - scene.load_case.start
            if torn.max() > FITS * max(speed_of(case, v), size_of(case) / span):
                joint = case.joints[int(torn.argmax())]
                problem = f"where the scene settles, the start velocities tear {describe(joint)} apart"
        if problem:
            text = f"{problem} (load case {scene.load_case.name}, initial design)"
            raise CaseError([case.marks.mistake("solver.settle", text)], str(case.path or case.name))


def size_of(case: Case) -> float:
    """The largest distance between bodies and points, m."""
    points = [np.array([body.position for body in case.bodies])]
    points += [grid.world for grid in case.points.values()]
    points += [np.concatenate([group.from_world, group.to_world]) for group in case.members]
    cloud = np.concatenate(points)
    for joint in case.joints:
        for name, at in zip(joint.bodies, (joint.at_first, joint.at_second), strict=True):
            centre = np.zeros(2) if name == "ground" else np.array(case.body(name).position)
            cloud = np.concatenate([cloud, [centre + np.array(at)]])
    low, high = cloud.min(axis=0), cloud.max(axis=0)
    size = float(np.hypot(*(high - low)))
    return size if size > 0.0 else 1.0


def speed_of(case: Case, v: FloatArray) -> float:
    """The largest speed of a body's centre or of a point a scene's size away from it, m/s."""
    bodies = v.reshape(-1, 3)
    return float((np.hypot(bodies[:, 0], bodies[:, 1]) + size_of(case) * np.abs(bodies[:, 2])).max())
