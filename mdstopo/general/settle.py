"""The static equilibrium near the stated configuration, where a case begins with `settle`.

    F(q, v = 0, t0, alpha, p) - Phi_q^T lam = 0,   Phi(q) = 0

is found by pseudo-dynamics: implicit steps of M q' = F on the joints, whose length grows as what is left of the force
falls, until they are Newton's. They run downhill where there is an energy, so a stable equilibrium is found, and the
nearest in that sense. It depends on the design, alpha and the values p of laws' variables, by K dq + Phi_q^T dlam = dF,
Phi_q dq = 0: `inverse` is that linear map.
Every search begins at the stated configuration, whatever was found before.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mdstopo.scene.model import FloatArray

if TYPE_CHECKING:
    from mdstopo.general.driver import GeneralDriver

#: pseudo-steps at most, and the farthest that one goes, relative to the scene
MOST, FAR = 400, 0.1
#: the farthest that an equilibrium is looked for: by how many sizes of the scene a body may move, and how far turn, rad
SIZES, TURN = 2.0, 2.0 * np.pi
#: how near steps must have come for Newton's to take over, and when these have arrived, relative to the scene
NEAR, ARRIVED = 1e-6, 1e-13
#: stiffness, relative to the largest, below which a direction counts as free
FREE = 1e-9


@dataclass(frozen=True)
class Settled:
    """An equilibrium.

    q (n,); inverse (n, n): dq = inverse dF. moved: how far the centre of a body has gone at most, m, and whose it is;
    turned: the same of angles, rad.
    """

    q: FloatArray
    inverse: FloatArray
    moved: float
    moved_body: str
    turned: float
    turned_body: str

    def __str__(self) -> str:
        return (
            f"the start has settled by {self.moved:.4g} m at most (body {self.moved_body}), "
            f"turned by {self.turned:.4g} rad (body {self.turned_body})"
        )


def settle(driver: "GeneralDriver", alpha: FloatArray, q0: FloatArray, size: float) -> Settled | str:
    """The equilibrium of alpha (N,) from q0 (n,), with the laws as the driver has packed them; or why there is none.

    size: of the scene, m.
    """
    scene = _AtRest(driver, alpha, size)
    q = q0.copy()
    scene.at(q)
    rate = scene.rate()
    left = scene.left()
    pace = 1.0 / rate if rate > 0.0 else size / max(left, 1e-300)
    for _ in range(MOST):
        step = scene.step(1.0 / pace)
        far = scene.extent(step)
        if far > FAR * size:
            pace *= max(0.25, 0.5 * FAR * size / far)
            continue
        q = q + step
        scene.at(q)
        now = scene.left()
        pace *= min(max(left / now, 0.3), 10.0) if now > 0.0 else 10.0
        left = now
        rate = scene.rate()
        if scene.lost(q - q0):
            return _nowhere(driver, q - q0, scene.arms)
        if far <= NEAR * size and pace * rate > 1.0:
            break
    far = np.inf
    for _ in range(20):
        inverse = scene.inverse()
        step = scene.onto() + inverse @ scene.force
        before, far = far, scene.extent(step)
        if not far < 1e-3 * size:
            break
        q = q + step
        scene.at(q)
        if far <= ARRIVED * size or far >= 0.5 * before:
            break
    inverse = scene.inverse()
    if not far <= 1e-9 * size or scene.pushed():
        return _nowhere(driver, q - q0, scene.arms)
    turning = scene.turns_freely()
    if turning >= 0:
        return f"body {driver.scene.bodies[turning]} is free to turn, so that its equilibrium is not determined"
    shift = np.abs(q - q0).reshape(-1, 3)
    distance = np.hypot(shift[:, 0], shift[:, 1])
    names = driver.scene.bodies
    far_body, turned_body = int(distance.argmax()), int(shift[:, 2].argmax())
    return Settled(
        q, inverse, float(distance[far_body]), names[far_body], float(shift[turned_body, 2]), names[turned_body]
    )


def _nowhere(driver: "GeneralDriver", shift: FloatArray, arms: FloatArray) -> str:
    body = driver.scene.bodies[int(np.abs(shift * arms).reshape(-1, 3).max(axis=1).argmax())]
    return f"body {body} finds no static equilibrium near its stated place"


class _AtRest:
    """Forces and stiffness at one configuration, in coordinates scaled by the roots of masses: u = M^(1/2) q."""

    def __init__(self, driver: "GeneralDriver", alpha: FloatArray, size: float) -> None:
        model = driver.scene.model
        n, n_row = len(model.mass), int(model.size[0])
        self._driver, self._alpha, self._size = driver, alpha, size
        self.free = np.flatnonzero(model.free)
        self.arms = np.tile([1.0, 1.0, size], n // 3)
        self._root = np.sqrt(model.mass[self.free])
        self._lam = np.zeros(n_row)
        self.force, self._dense = np.zeros(n), np.zeros((n, n))
        self._rows, self._phi = np.zeros((n_row, n)), np.zeros(n_row)

    def at(self, q: FloatArray) -> None:
        """Look at q (n,), whose driven part is put in place."""
        from mdstopo.general.settle_entry import statics

        d = self._driver
        statics(d.ints, d.floats, self._alpha, d.strength, q, self._lam, self.force, self._dense, self._rows, self._phi)
        root = self._root
        self.stiffness = self._dense[np.ix_(self.free, self.free)] / root[:, None] / root
        self.pull = self.force[self.free] / root
        self.jac = self._rows[:, self.free] / root

    def rate(self) -> float:
        """Of the fastest motion, 1/s^2."""
        return float(np.linalg.norm(self.stiffness, 2)) if len(self.free) else 0.0

    def left(self) -> float:
        """What no joint takes of the force, and by how much joints misfit, as one number (sqrt(kg) m/s^2)."""
        if not len(self._lam):
            return float(np.linalg.norm(self.pull))
        rest = self.pull - self.jac.T @ np.linalg.lstsq(self.jac.T, self.pull, rcond=None)[0]
        return float(np.hypot(np.linalg.norm(rest), np.linalg.norm(self._phi) * np.linalg.norm(self.pull) / self._size))

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

    def turns_freely(self) -> int:
        """A body that turns in a direction that nothing holds, or -1."""
        modes = np.abs(self._null() / self._root[:, None]) * self.arms[self.free][:, None]
        angle = self.free % 3 == 2
        if not modes.size or modes[angle].max(initial=0.0) <= 1e-6 * modes.max():
            return -1
        return int(self.free[angle][int(modes[angle].max(axis=1).argmax())]) // 3

    def extent(self, step: FloatArray) -> float:
        """How far a step (n,) goes: the largest shift of a centre, or angle times the scene's size, m."""
        return float(np.abs(step * self.arms).max(initial=0.0))

    def lost(self, shift: FloatArray) -> bool:
        """Whether a shift (n,) from the stated place is too large for an equilibrium near it."""
        far = np.abs(shift).reshape(-1, 3).max(axis=0, initial=0.0)
        return bool(max(far[0], far[1]) > SIZES * self._size or far[2] > TURN)

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
        wide = np.zeros(len(self.force))
        wide[self.free] = u / self._root
        return wide
