"""Getting ready: the kernels compiled, loaded, and loaded in one order.

Machine code that a process has just compiled can differ in the last bits from the same kernels loaded from the cache
(functions inside it exist in several copies, and which one is linked depends on who came first). A run that is resumed,
or spread over workers, must not depend on that. So nothing that counts is computed by freshly compiled code: where the
kernels are not known to be cached, another process compiles them first, and every process then loads them alike.
"""

import contextlib
import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import Case
from mdstopo.children import command, end_with_parent
from mdstopo.optimizer.problem import LinearRows, Problem, Sample
from mdstopo.optimizer.wide import MANY
from mdstopo.optimizer.wide_numbers import WIDE
from mdstopo.scene.family import beyond_springs
from mdstopo.session.engine import Engine, compiling
from mdstopo.session.starts import first_design, make_optimizer
from mdstopo.store.contents import Motion

Floats = NDArray[np.float64]

_FEW = 3  # variables of the smallest problem
_SMALL = 100_000  # members up to which an evaluation costs nothing beside loading its kernels


def compile_apart(case: Case, notify: Callable[[str], None]) -> None:
    """Have another process compile what the case needs, unless that is known to be cached."""
    marker = _marker(case)
    if marker.exists():
        return
    try:
        marker.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        writable = os.access(marker.parent, os.W_OK)
    except OSError:
        writable = False
    notify(compiling(case))
    if not writable:
        notify(f"{marker.parent} cannot be written: kernels are compiled anew in every run, which is slow")
        return
    # What it complains of, this process will find as well, and say better.
    with contextlib.suppress(OSError):  # no process can be started, or it has ended
        _compile_in_child(pickle.dumps(case))


def _compile_in_child(message: bytes) -> None:
    """Have a process of its own compile; it ends with this one, however that ends, as its input is then closed."""
    child = subprocess.Popen(
        command("mdstopo.session.ready"),
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    assert child.stdin is not None
    try:
        child.stdin.write(message)
        child.stdin.flush()
        child.wait()
    finally:
        child.kill()
        child.wait()
        with contextlib.suppress(OSError):
            child.stdin.close()


def get_ready(
    case: Case, engine: Engine, problem: Problem, initial: Floats | None
) -> tuple[Floats, Floats, dict[str, Motion]]:
    """Load every kernel, always in this order, so that iterations are timed for themselves and repeat to the bit.

    Returns the stated first x (n,), the nearest one that keeps bounds and volume rows, and its motion in each load
    case. Raises CaseError where no design keeps the rows.
    """
    for size in [_FEW, *(many for many in (MANY, WIDE) if len(problem.initial) >= many)]:
        _meet(case, size, size >= WIDE and bool(getattr(problem, "competes", False)))
    stated, begin = first_design(case, problem, initial)
    before = motions(case, engine, case.space.expand(begin))
    if case.n_members <= _SMALL:
        problem.evaluate(begin)
    return stated, begin, before


def _meet(case: Case, size: int, competes: bool = False) -> None:
    """Load the kernels that the optimiser calls where there are so many variables, and where their rows compete."""
    optimizer = make_optimizer(case, _Toy(size, competes))
    state = optimizer.start()
    if state.running:
        optimizer.step(state)


def compile_share() -> None:
    """Compile what few variables need: the share of the process beside this one (`warm`) where there are many."""
    from mdstopo.warm import tiny

    _meet(tiny("auto"), _FEW)


def motions(case: Case, engine: Engine, design: Floats) -> dict[str, Motion]:
    """The motion of a design in each load case."""
    return {each.name: engine.trajectory(design, each.name) for each in case.load_cases}


class _Toy:
    """A problem of two rows, both of which decide, or of many variables the higher: enough to meet every kernel."""

    def __init__(self, size: int, competes: bool) -> None:
        self.competes = competes
        self.initial = np.full(size, 0.5)
        self.lower = np.full(size, 0.001)
        self.upper = np.ones(size)
        self.linear = LinearRows(np.ones((1, size)), np.array([0.5 * size]), np.array([True]))
        rising = np.linspace(1.0, 3.0, size)
        self._slopes = np.array([rising, rising[::-1] if size < MANY else 0.9 * rising])

    def evaluate(self, x: Floats, gradient: bool = True) -> Sample:
        """The rows and their slopes."""
        values = np.sum(self._slopes / x, axis=1)
        order = np.argsort(-values, kind="stable")
        slopes = (-self._slopes / x**2)[order]
        return Sample(float(values.max()), values[order], slopes, np.zeros(0), np.zeros((0, len(x))))


def _marker(case: Case) -> Path:
    """An empty file that says that the kernels for such cases are cached."""
    from mdstopo.compiler.store import cache_folder

    family = "general" if beyond_springs(case) else "springs"
    family += "".join(f"-{many}" for many in (MANY, WIDE) if case.space.size >= many)
    return cache_folder() / f"ready-{family}-{case.solver.integrator}-{case.solver.sensitivity}"


def _main() -> None:
    import gc
    import signal

    from mdstopo.evaluators import evaluator_of
    from mdstopo.session.combining import even, problem_of

    gc.disable()  # what the compiler makes lives on: looking through it again and again takes a tenth of the time
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides, and ends this process with itself
    case: Case = pickle.load(sys.stdin.buffer)
    end_with_parent(sys.stdin.buffer)
    many = case.space.size >= MANY
    engine = evaluator_of(case, share=["mdstopo.session.ready"] if many else [])
    if many:
        _meet(case, MANY)
    problem = problem_of(engine, even(case))
    _, begin, _ = get_ready(case, engine, problem, None)
    engine.evaluate(case.space.expand(begin), gradient=True)
    with contextlib.suppress(OSError):  # a full disk
        _marker(case).touch()
    gc.freeze()  # it would be looked through at the end as well


if __name__ == "__main__":
    _main()
