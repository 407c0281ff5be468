"""Where the motion of a general scene starts: as stated, or at rest where the case asks for `settle`.

A start at rest depends on the design: on alpha, and on the values p of laws' variables. With A = K^-1, joints included
(`scene.settled.Settled.inverse`), and the forces' own derivatives at rest, as they are in every balance (`parameters`),

    dq0/d(alpha_i^mu) = -A B_i^T f_i,     dq0/dp = -A sum s B^T f_p.

So the cotangent that the reverse sweep leaves is pulled through the equilibrium, A^T, once for all of them, and the
direct method begins with these columns. What depends on rates has no part in it: f_p of a damping is 0 at rest. A law
takes part if it acts at the start, so no time at which one begins or ends to act moves the equilibrium until it crosses
the start, where the equilibrium jumps.
"""

import numpy as np

from mdstopo.case.text.errors import CaseError
from mdstopo.general.at_rest.joints_at_start import FITS
from mdstopo.general.at_rest.since_settled import SinceSettled
from mdstopo.general.driver_interface import DriverWithStart
from mdstopo.general.model.general_model import COUNT, DESIGN, START
from mdstopo.general.scene.extent import size_of, speed_of
from mdstopo.mechanics.joints.joint_table import describe
from mdstopo.scene.settled import Settled
from mdstopo.scene.springs_model import FloatArray, IndexArray


class SettledStart:
    """The equilibrium at which the motion of one driver starts; `settled` is that of the last design."""

    def __init__(self, driver: DriverWithStart) -> None:
        self._driver = driver
        self._stated: FloatArray = driver.packed_start()[0]
        self._design: bytes | None = None
        self.settled: Settled | None = None
        self.message = ""
        #: what counts from there
        self.since = SinceSettled(driver)
        self._refuse()

    def move(self) -> bool:
        """Put the driver's start where it is at rest with its present design; False where there is no place nearby."""
        driver = self._driver
        design = driver.alpha.tobytes() + driver.values.tobytes()
        if self._design == design:
            return True
        from mdstopo.general.at_rest.settle import settle

        self._design = None
        driver.start_from(self._stated)
        found = settle(driver, driver.alpha.copy(), self._stated, size_of(driver.case))
        if isinstance(found, str):
            self.message = found
            return False
        self.settled = found
        driver.start_from(found.q, self.since.numbers_at(found.q) if self.since else None)
        self._design = design
        return True

    def slopes(self) -> FloatArray:
        """(M_padded + P, n): derivatives of the start's positions by each alpha^mu, then by each value."""
        assert self.settled is not None
        forces = self._unit_forces()
        if len(self._driver.values):
            forces = np.concatenate([forces, self._value_forces()])
        slopes: FloatArray = np.ascontiguousarray(forces @ self.settled.inverse.T)
        return slopes

    def vjp(self, start: FloatArray, out: FloatArray) -> None:
        """Add the derivative of the start's positions, with cotangents start (n,), by the design to out (N + P,)."""
        assert self.settled is not None
        driver = self._driver
        model, alpha = driver.scene.model, driver.alpha
        pulled = self.settled.inverse.T @ start
        padded = self._unit_forces() @ pulled
        for block, mu in zip(model.block.tolist(), model.power.tolist(), strict=True):
            first, count, at = block[DESIGN], block[COUNT], block[START]
            if first >= 0:
                out[first : first + count] += mu * alpha[first : first + count] ** (mu - 1.0) * padded[at : at + count]
        if len(driver.values):
            out[len(alpha) :] += self._value_forces() @ pulled

    def _unit_forces(self) -> FloatArray:
        """(M_padded, n): what each design member's alpha^mu adds to the forces at rest."""
        from mdstopo.general.statics.settle_entry import unit_forces

        out = np.zeros((self._driver.scene.model.member.shape[1], len(self._driver.scene.model.mass)))
        ints, floats, alpha, member_state, q = self._at_rest()
        unit_forces(ints, floats, alpha, member_state, q, out)
        return out

    def _value_forces(self) -> FloatArray:
        """(P, n): what each value of a law's variable adds to the forces at rest."""
        from mdstopo.general.statics.settle_entry import value_forces

        out = np.zeros((len(self._driver.values), len(self._driver.scene.model.mass)))
        ints, floats, alpha, member_state, q = self._at_rest()
        value_forces(ints, floats, alpha, member_state, q, out)
        return out

    def _at_rest(self) -> tuple[IndexArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """The packed scene, alpha (N,), room for the members' strengths, and the equilibrium (n,)."""
        assert self.settled is not None
        driver = self._driver
        return driver.ints, driver.floats, driver.alpha, np.zeros_like(driver.member_state), self.settled.q.copy()

    def _refuse(self) -> None:
        """Refuse a case whose initial design has nowhere to settle, or whose start velocities do not fit there."""
        driver, problem = self._driver, ""
        case, scene = driver.case, driver.scene
        driver.take(case.start)
        if not self.move():
            problem = self.message
        elif len(scene.model.joint):
            from mdstopo.general.statics.start_entry import assemble

            phi, rates = np.zeros((2, *scene.model.row.shape))
            q, v = driver.packed_start()
            assemble(driver.ints, driver.floats, q, v, False, phi, rates)
            torn = np.abs(rates).max(axis=1)
            span = scene.load_case.end - scene.load_case.start
            if torn.max() > FITS * max(speed_of(case, v, scene.kinematics), size_of(case) / span):
                joint = case.joints[int(torn.argmax())]
                problem = f"where the scene settles, the start velocities tear {describe(joint)} apart"
        if problem:
            text = f"{problem} (load case {scene.load_case.name}, initial design)"
            raise CaseError([case.marks.mistake("solver.settle", text)], str(case.path or case.name))
