"""Where kernels are not known to be cached, another process compiles them first: `compile_apart`.

Why it is not this one, `starts.getting_ready` tells. The other process is this module run as a program.
"""

import contextlib
import gc
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from mdstopo.case.model import Case
from mdstopo.children import command, end_with_parent
from mdstopo.compiler.store import cache_folder, is_kept
from mdstopo.evaluators import evaluator_of
from mdstopo.optimizer.wide import MANY
from mdstopo.optimizer.wide_numbers import WIDE
from mdstopo.scene.family import beyond_springs
from mdstopo.scene.other_kernels import include_kernels
from mdstopo.session.pricing import price
from mdstopo.starts.evaluator_interface import even, problem_of
from mdstopo.starts.getting_ready import FEW, get_ready, meet
from mdstopo.warm import compiling, tiny

#: candidates that are priced to have the kernels compiled
FEW_CANDIDATES = 1000


def compile_apart(case: Case, notify: Callable[[str], None]) -> None:
    """Have another process compile what the case needs, unless that is known to be cached."""
    marker = _marker(case)
    if is_kept(marker.name):
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
        command("mdstopo.session.compiling_apart"),
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


def compile_share() -> None:
    """Compile what few variables need: the share of the process beside this one (`warm`) where there are many."""
    meet(tiny("auto"), FEW)


def _marker(case: Case) -> Path:
    """An empty file that says that the kernels for such cases are cached."""
    include_kernels(case)
    family = "general" if beyond_springs(case) else "springs"
    family += "-priced" if case.priced_groups else ""
    family += "".join(f"-{many}" for many in (MANY, WIDE) if case.space.size >= many)
    return cache_folder() / f"ready-{family}-{case.solver.integrator}-{case.solver.sensitivity}"


def _main() -> None:
    gc.disable()  # what the compiler makes lives on: looking through it again and again takes a tenth of the time
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides, and ends this process with itself
    case: Case = pickle.load(sys.stdin.buffer)
    end_with_parent(sys.stdin.buffer)
    many = case.space.size >= MANY
    engine = evaluator_of(case, share=["mdstopo.session.compiling_apart"] if many else [])
    if many:
        meet(case, MANY)
    problem = problem_of(engine, even(case))
    _, begin, _ = get_ready(case, engine, problem, None)
    engine.evaluate(case.space.expand(begin), gradient=True)
    if case.priced_groups:
        price(case, engine, begin, FEW_CANDIDATES)
    with contextlib.suppress(OSError):  # a full disk
        _marker(case).touch()
    gc.freeze()  # it would be looked through at the end as well


if __name__ == "__main__":
    _main()
