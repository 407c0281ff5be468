"""The static equilibrium near the stated configuration, where a case begins with `settle`.

    F(q, v = 0, t0, alpha, p) - Phi_q^T lam = 0,   Phi(q) = 0

is found by pseudo-dynamics: implicit steps of M q' = F on the joints, whose length grows as long as forces change as
their stiffness says, until they are Newton's. They run downhill where there is an energy, so a stable equilibrium is
found, and the nearest in that sense. Forces have kinks (a plateau, a gap), at which a whole step may go too far and the
next one as far back, for ever: each ends at the latest where no force along it is left. Of an energy whose forces are
continuous this finds a minimum (J.-S. Pang and L. Qi 1995, "A globally convergent Newton method for convex SC1
minimization problems"). It depends on the design, alpha and the values p of laws' variables, by
K dq + Phi_q^T dlam = dF, Phi_q dq = 0: `inverse` is that linear map.
Every search begins at the stated configuration, whatever was found before. What moves freely is moved back
(`free_motions`), and the search goes on from there.
"""

from typing import Any

import numpy as np

from mdstopo.general.at_rest.free_motions import FreeMotions, free_motions
from mdstopo.general.driver_interface import DriverWithStart
from mdstopo.scene.settled import Settled
from mdstopo.scene.springs_model import FloatArray

#: pseudo-steps at most, and the farthest that one goes, relative to the scene
MOST_STEPS, LONGEST_STEP = 400, 0.1
#: the farthest that an equilibrium is looked for: by how many sizes of the scene a body may move, and how far turn, rad
SIZES, TURN = 2.0, 2.0 * np.pi
#: steps grow by this factor where the force along them at their end is off from what was foreseen by at most this share
#: of that at their start
GROWTH, AGREES = 4.0, 0.25
#: how large a force that points back at the end of a step may be, relative to that at its start; and how often at most
#: a better end is looked for
BACK, TRIALS = 0.1, 30
#: how near steps must have come for Newton's to take over, and when these have arrived, relative to the scene
NEWTON_FROM, ARRIVED = 1e-6, 1e-13
#: stiffness, relative to the largest, below which a direction counts as free
FREE = 1e-9
#: how often what moves freely is moved back at most, and how far from its place or heading it is then at most, relative
#: to the scene
RETURNS, KEPT = 80, 1e-12


def settle(driver: DriverWithStart, alpha: FloatArray, q0: FloatArray, size: float) -> Settled | str:
    """The equilibrium of alpha (N,) from q0 (n_q,), with the laws as the driver has packed them; or why there is none.

    size: of the scene, m.
    """
    bodies, names = driver.scene.kinematics, driver.scene.bodies
    scene = _AtRest(driver, alpha, size)
    q, back, limit = q0, np.zeros(len(scene.force)), np.inf
    for _ in range(RETURNS):
        q, found = _equilibrium(scene, q, q0, size)
        change = bodies.difference(q, q0)
        if not found or scene.pushed():
            return _nowhere(driver, change, scene.arms)
        free = scene.free_motions(q, q0, change)
        if isinstance(free, int):
            return f"body {names[free]} is free to turn, so that its equilibrium is not determined"
        back = free.back()
        far = scene.extent(back)
        # what has been pushed away again stays: at the edge of where a slack strap leaves it free
        if far <= KEPT * size or far > limit:
            return _settled(driver, q, change, free.kept(scene.inverse()))
        step = min(far, LONGEST_STEP * size)
        q = bodies.retract(q, step / far * back)
        limit = far - 0.5 * step
    body = names[_farthest(driver, back, scene.arms)]
    return f"body {body} is free to move, and finds no static equilibrium with its stated place or heading"


def _settled(driver: DriverWithStart, q: FloatArray, change: FloatArray, inverse: FloatArray) -> Settled:
    """The equilibrium q (n_q,), with how far the bodies have gone from the stated place, a change (n,)."""
    shift, turn = driver.scene.kinematics.shifts_and_turns(change)
    distance, angle = np.linalg.norm(shift, axis=1), np.linalg.norm(turn, axis=1)
    names = driver.scene.bodies
    far, turned = int(distance.argmax()), int(angle.argmax())
    return Settled(q, inverse, float(distance[far]), names[far], float(angle[turned]), names[turned])


def _equilibrium(scene: "_AtRest", q: FloatArray, stated: FloatArray, size: float) -> tuple[FloatArray, bool]:
    """Where a search from q (n_q,) ends, and whether that is an equilibrium near the stated configuration."""
    q, near = _downhill(scene, q, stated, size)
    return _newton(scene, q, size) if near else (q, False)


def _downhill(scene: "_AtRest", q: FloatArray, stated: FloatArray, size: float) -> tuple[FloatArray, bool]:
    """Go from q (n_q,) by implicit steps as far as Newton's can take over; where that is, and whether it is near the
    stated configuration."""
    q = scene.land(q.copy())
    rate, left = scene.rate(), scene.left()
    pace = 1.0 / rate if rate > 0.0 else size / max(float(np.linalg.norm(left)), 1e-300)
    for _ in range(MOST_STEPS):
        step = scene.step(1.0 / pace)
        far, own = scene.extent(step), scene.scaled(step)
        ahead = float(own @ left)
        if far > LONGEST_STEP * size or (ahead < 0.0 and far > ARRIVED * size):
            pace *= min(max(0.25, 0.5 * LONGEST_STEP * size / far), 0.5)
            continue
        q, left, share, off = _stepped(scene, q, step, ahead, float(own @ own) / pace)
        if off <= AGREES * ahead:
            pace *= GROWTH
        elif off > ahead:
            pace *= 0.5
        if scene.lost(scene.bodies.difference(q, stated)):
            return q, False
        if share * far <= NEWTON_FROM * size and pace * scene.rate() > 1.0:
            break
    return q, True


def _newton(scene: "_AtRest", q: FloatArray, size: float) -> tuple[FloatArray, bool]:
    """Newton's steps from q (n_q,), at which the scene has been looked at: where they end, and whether that is an
    equilibrium."""
    far = np.inf
    for _ in range(20):
        step = scene.onto() + scene.inverse() @ scene.force
        before, far = far, scene.extent(step)
        if not far < 1e-3 * size:
            break
        q = scene.bodies.retract(q, step)
        scene.at(q)
        if far <= ARRIVED * size or far >= 0.5 * before:
            break
    return q, bool(far <= 1e-9 * size)


def _stepped(
    scene: "_AtRest", q: FloatArray, step: FloatArray, ahead: float, foreseen: float
) -> tuple[FloatArray, FloatArray, float, float]:
    """Go along a step (n,) from q (n_q,), as far as the force along it does not point back: ahead at its start.

    Where it points back at the start, the step is one of rounding, and is taken as it is.

    Returns where it ends, what is left of the force there, the share of the step taken, and by how much the force along
    it at the end of all of it differs from what was foreseen.
    """
    own = scene.scaled(step)
    low, high, share, off = 0.0, 1.0, 1.0, 0.0
    forward, backward = ahead, 0.0
    for look in range(TRIALS):
        there = scene.land(scene.bodies.retract(q, share * step))
        left = scene.left()
        along = float(own @ left)
        if look == 0:
            off = abs(along - foreseen)
        if ahead <= 0.0 or (along >= -BACK * ahead and (look == 0 or along <= BACK * ahead)):
            break
        # Illinois' rule: an end that stays counts half
        if along > 0.0:
            low, forward, backward = share, along, 0.5 * backward
        else:
            high, forward, backward = share, 0.5 * forward if look else forward, along
        share = low + (high - low) * min(max(forward / (forward - backward), 0.1), 0.9)
    return there, left, share, off


def _nowhere(driver: DriverWithStart, shift: FloatArray, arms: FloatArray) -> str:
    """Why there is no equilibrium: the body that has moved most by a shift (n,), with angles times arms (n,)."""
    body = driver.scene.bodies[_farthest(driver, shift, arms)]
    return f"body {body} finds no static equilibrium near its stated place"


def _farthest(driver: DriverWithStart, shift: FloatArray, arms: FloatArray) -> int:
    """The body that a shift (n,), with angles times arms (n,), moves most."""
    return int(np.abs(shift * arms).reshape(-1, driver.scene.kinematics.freedoms).max(axis=1).argmax())


class _AtRest:
    """Forces and stiffness at one configuration, in coordinates scaled by the roots of masses: u = M^(1/2) q."""

    def __init__(self, driver: DriverWithStart, alpha: FloatArray, size: float) -> None:
        model = driver.scene.model
        n, n_row = len(model.mass), int(model.size[0])
        self._driver, self._alpha, self._size = driver, alpha, size
        self.free = np.flatnonzero(model.free)
        self.bodies = driver.scene.kinematics
        self.arms = np.ones(n)
        self.bodies.shifts_and_turns(self.arms)[1][:] = size
        self._root = np.sqrt(model.mass[self.free])
        self._lam = np.zeros(n_row)
        self.force, self._dense = np.zeros(n), np.zeros((n, n))
        self._rows, self._phi = np.zeros((n_row, n)), np.zeros(n_row)

    def at(self, q: FloatArray) -> None:
        """Look at q (n_q,), whose driven part is put in place."""
        from mdstopo.general.statics.settle_entry import statics

        d = self._driver
        statics(
            d.ints, d.floats, self._alpha, d.member_state, q, self._lam, self.force, self._dense, self._rows, self._phi
        )
        root = self._root
        self.stiffness = self._dense[np.ix_(self.free, self.free)] / root[:, None] / root
        self.pull = self.force[self.free] / root
        self.jac = self._rows[:, self.free] / root

    def rate(self) -> float:
        """Largest stiffness by mass: square of the angular frequency of the fastest motion (1/s^2)."""
        return float(np.linalg.norm(self.stiffness, 2)) if len(self.free) else 0.0

    def land(self, q: FloatArray) -> FloatArray:
        """Look at the nearest place on the joints to q (n_q,), which is returned."""
        self.at(q)
        for _ in range(3):
            if np.abs(self._phi).max(initial=0.0) <= ARRIVED * self._size:
                break
            q = self.bodies.retract(q, self.onto())
            self.at(q)
        return q

    def left(self) -> FloatArray:
        """What no joint takes of the force (sqrt(kg) m/s^2), in scaled coordinates; multipliers are set to what they
        take."""
        if not len(self._lam):
            return self.pull
        self._lam[:] = np.linalg.lstsq(self.jac.T, self.pull, rcond=None)[0]
        left: FloatArray = self.pull - self.jac.T @ self._lam
        return left

    def scaled(self, step: FloatArray) -> FloatArray:
        """The free part of a step (n,) in scaled coordinates."""
        own: FloatArray = step[self.free] * self._root
        return own

    def step(self, drag: float) -> FloatArray:
        """(n,): one implicit step with drag M (1/s^2); the joints' multipliers are those of its end."""
        m, r = len(self.free), len(self._lam)
        whole = np.zeros((m + r, m + r))
        whole[:m, :m] = self.stiffness + drag * np.eye(m)
        whole[:m, m:], whole[m:, :m] = self.jac.T, self.jac
        both = np.linalg.lstsq(whole, np.concatenate([self.pull, -self._phi]), rcond=1e-15)[0]
        self._lam[:] = both[m:]
        return self._wide(both[:m])

    def onto(self) -> FloatArray:
        """(n,): back onto the joints, by the shortest way."""
        if not len(self._phi):
            return np.zeros(len(self.force))
        return self._wide(np.linalg.lstsq(self.jac, -self._phi, rcond=None)[0])

    def inverse(self) -> FloatArray:
        """(n, n): dq = inverse dF at fixed joints; directions that nothing holds stay."""
        if len(self._lam):
            self._lam[:] = np.linalg.lstsq(self.jac.T, self.pull, rcond=None)[0]
        basis = self._basis()
        out = np.zeros((len(self.force), len(self.force)))
        reduced = basis.T @ self.stiffness @ basis
        root = self._root
        inner = basis @ np.linalg.pinv(reduced, rcond=FREE) @ basis.T / root[:, None] / root
        out[np.ix_(self.free, self.free)] = inner
        return out

    def pushed(self) -> bool:
        """Whether a force acts where nothing holds against it."""
        modes = self._null()
        scale = self.rate() * self._size * float(self._root.max(initial=0.0))
        return bool(modes.size) and float(np.abs(modes.T @ self.pull).max()) > FREE * scale

    def free_motions(self, q: FloatArray, stated: FloatArray, change: FloatArray) -> FreeMotions | int:
        """What moves freely at q (n_q,), a change (n,) from the stated place; or a body that turns so where it has no
        heading."""
        null = self._null()
        modes, root = np.zeros((len(self.force), null.shape[1])), np.ones(len(self.force))
        modes[self.free], root[self.free] = null, self._root
        scene = self._driver.scene
        vertical = np.asarray(scene.load_case.gravity, dtype=np.float64)
        headings = self.bodies.headings(scene.model.home, vertical, q, stated)
        return free_motions(self.bodies, modes, root, change, headings)

    def extent(self, step: FloatArray) -> float:
        """How far a step (n,) goes: the largest shift of a centre, or angle times the scene's size, m."""
        return float(np.abs(step * self.arms).max(initial=0.0))

    def lost(self, shift: FloatArray) -> bool:
        """Whether a shift (n,) from the stated place is too large for an equilibrium near it."""
        far, turned = (np.abs(part).max(initial=0.0) for part in self.bodies.shifts_and_turns(shift))
        return bool(far > SIZES * self._size or turned > TURN)

    def _basis(self) -> FloatArray:
        """Directions that the joints allow (columns), of length 1 by mass."""
        if not len(self._lam):
            return np.eye(len(self.free))
        _, sizes, all_rows = np.linalg.svd(self.jac)
        rank = int(np.sum(sizes > FREE * sizes.max(initial=0.0)))
        basis: FloatArray = all_rows[rank:].T
        return basis

    def _null(self) -> FloatArray:
        """Directions (columns) that neither joints nor stiffness hold."""
        basis = self._basis()
        _, sizes, all_rows = np.linalg.svd(basis.T @ self.stiffness @ basis)
        null: FloatArray = basis @ all_rows[sizes <= FREE * sizes.max(initial=0.0)].T
        return null

    def _wide(self, u: Any) -> FloatArray:
        """A step of all coordinates (n,), from that of the free ones in scaled coordinates; zero for the others."""
        wide = np.zeros(len(self.force))
        wide[self.free] = u / self._root
        return wide
