"""Which settings of each program are timed on which scene."""

from collections.abc import Iterator, Sequence

from benchmarks.peers.race import Entry
from benchmarks.peers.table import OURS

#: fixed steps of the closed loops, whose peers but CasADi have nothing else: parts of their 0.3 s
STEPS = tuple(0.3 / count for count in (*range(3, 17), 18))
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11)


def two_bodies(at_end: bool) -> Iterator[Entry]:
    """The paper's scene; at_end: whether the peak is known to be at the end, so that none looks for it inside."""
    yield from ours(("gauss", "runge_kutta"))
    for steps in (2, 3, 4, 6, 8, 10) if at_end else (4, 8, 12, 16):
        yield Entry("jax", {"steps": steps, "refine": not at_end})
    for tolerance in (1e-6, 1e-8, 1e-10):
        yield Entry("diffrax", {"tolerance": tolerance, "refine": not at_end})
        yield Entry("casadi", {"tolerance": tolerance})
    for tolerance in (1e-5, 1e-7, 1e-9, 1e-11):
        yield Entry("scipy", {"tolerance": tolerance, "refine": not at_end})


def any_case(hinges: bool) -> Iterator[Entry]:
    """A case of the user's; the number of steps that it takes is not known."""
    yield from ours(("runge_kutta",) if hinges else ("gauss", "runge_kutta"))
    for steps in (4, 8, 16, 32):
        yield Entry("jax", {"steps": steps, "rolled": hinges})
    for tolerance in (1e-6, 1e-8, 1e-10):
        for peer in ("casadi", "diffrax", "scipy"):
            yield Entry(peer, {"tolerance": tolerance})


def ring() -> Iterator[Entry]:
    """The closed loop, with gradients."""
    yield from ours_on_a_loop()
    for tolerance in (1e-6, 1e-8):
        yield Entry("casadi", {"tolerance": tolerance, "method": "cvodes"})
        yield Entry("casadi", {"tolerance": tolerance, "method": "idas"})
    for tolerance in (1e-6, 1e-8):
        yield Entry("casadi", {"tolerance": tolerance, "method": "cvodes", "compiled": True})
    for steps in (6, 8, 12):
        yield Entry("jax", {"steps": steps, "rolled": True})


def forward(hinges: bool) -> Iterator[Entry]:
    """Without gradients."""
    for integrator in ("runge_kutta",) if hinges else ("gauss", "runge_kutta"):
        for tolerance in (5e-1, 3e-1, 1e-1, 3e-2, 1e-2, *TOLERANCES[:6]):
            yield Entry(OURS, {"integrator": integrator, "tolerance": tolerance}, gradient=False)
    for step in STEPS if hinges else ():
        yield Entry(OURS, {"integrator": "runge_kutta", "step": step}, gradient=False)
    for steps in (20, 100, 400):
        yield Entry("exudyn", {"steps": steps}, gradient=False)
    for steps in () if hinges else (5, 10, 20):
        yield Entry("exudyn", {"steps": steps, "solver": "RK44"}, gradient=False)
    for step in (1e-2, 2e-3, 5e-4):
        yield Entry("mujoco", {"step": step}, gradient=False)
    yield Entry("mujoco", {"step": 2e-3, "integrator": "implicitfast"}, gradient=False)


def two_bodies_in_space() -> Iterator[Entry]:
    """Two bodies in space; `auto` takes the best integrator that there is."""
    yield from ours(("auto",), TOLERANCES[3:])
    for steps in (2, 3, 4, 6, 8, 12, 16):
        yield Entry("jax", {"steps": steps})
    for tolerance in (1e-6, 1e-8, 1e-10):
        yield Entry("casadi", {"tolerance": tolerance})


def ring_in_space() -> Iterator[Entry]:
    """The closed loop in space, with gradients."""
    yield from ours_on_a_loop()
    for tolerance in (1e-6, 1e-8):
        yield Entry("casadi", {"tolerance": tolerance})
    for steps in (6, 8, 12, 16):
        yield Entry("casadi", {"steps": steps, "compiled": True})
    for steps in (6, 8, 12, 16):
        yield Entry("jax", {"steps": steps, "rolled": True})


def forward_in_space(joints: bool) -> Iterator[Entry]:
    """Without gradients."""
    for tolerance in (5e-1, 3e-1, 1e-1, 3e-2, 1e-2, *TOLERANCES[:7]):
        yield Entry(OURS, {"integrator": "runge_kutta", "tolerance": tolerance}, gradient=False)
    for step in STEPS if joints else ():
        yield Entry(OURS, {"integrator": "runge_kutta", "step": step}, gradient=False)
    for steps in (20, 100, 400):
        yield Entry("exudyn", {"steps": steps}, gradient=False)
    for steps in () if joints else (5, 10, 20):
        yield Entry("exudyn", {"steps": steps, "solver": "RK44"}, gradient=False)
    for step in (1e-2, 2e-3, 5e-4):
        yield Entry("mujoco", {"step": step}, gradient=False)
    yield Entry("mujoco", {"step": 2e-3, "integrator": "implicitfast"}, gradient=False)


def seat() -> Iterator[Entry]:
    """The seated occupant; JAX's dampers set in the more smoothly the longer its steps are."""
    for tolerance in (3e-2, 1e-2, 1e-3, 1e-5, 1e-7):
        yield Entry(OURS, {"tolerance": tolerance})
    for steps, smooth in ((125, 0.0), (125, 3e-3), (250, 3e-3), (500, 1e-3), (1000, 1e-3), (2000, 5e-4)):
        yield Entry("jax", {"steps": steps, "smooth": smooth})


def million() -> Iterator[Entry]:
    """Members by the million, on all cores."""
    yield from ours(("gauss",), (1e-3, 1e-4, 1e-5, 1e-6, 1e-7))
    for steps in (2, 3, 4):
        yield Entry("jax", {"steps": steps, "refine": False})


def ours(integrators: Sequence[str], tolerances: Sequence[float] = TOLERANCES) -> Iterator[Entry]:
    """Ours, with each integrator at each tolerance."""
    for integrator in integrators:
        for tolerance in tolerances:
            yield Entry(OURS, {"integrator": integrator, "tolerance": tolerance})


def ours_on_a_loop() -> Iterator[Entry]:
    """Ours on a closed loop: with error control, and with fixed steps."""
    yield from ours(("runge_kutta",), (1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10))
    for step in STEPS:
        yield Entry(OURS, {"integrator": "runge_kutta", "step": step})
