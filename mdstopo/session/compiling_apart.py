"""Where kernels are not known to be cached, other processes compile them first: `compile_apart`.

Why it is not this one, `starts.getting_ready` tells. Another process is this module run as a program: alone it compiles
all that the case needs; with the word `back` the optimiser and what evaluates responses and gradients from steps. For
scenes with joints and other laws both run side by side, and what the one has compiled the other finds on the disk.
Where nothing is optimised, one process beside this one has a share of its own, `responses` or `steps`:
`compiling_in_background`.
"""

import contextlib
import gc
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from mdstopo.case.model import Case
from mdstopo.children import command, end_with_parent
from mdstopo.compiler.store import cache_folder, is_kept
from mdstopo.evaluators import evaluator_of
from mdstopo.optimizer.wide import MANY_VARIABLES
from mdstopo.optimizer.wide_numbers import VERY_MANY_VARIABLES
from mdstopo.plan.pricing import price
from mdstopo.scene.family import beyond_springs
from mdstopo.scene.other_kernels import include_kernels
from mdstopo.scene.refusals import refusals
from mdstopo.starts.evaluator_interface import equal_weights, problem_of
from mdstopo.starts.getting_ready import FEW_VARIABLES, get_ready, load_optimizer, motions
from mdstopo.warm import compilation_due, compiling, needs_general, tiny

#: the words that have a process compile what evaluates steps, with the optimiser and without it, and what makes steps
BACK, RESPONSES, STEPS = "back", "responses", "steps"
#: candidates that are priced to have the kernels compiled
FEW_CANDIDATES = 1000


def compile_apart(case: Case, notify: Callable[[str], None]) -> None:
    """Compile what the case needs in another process, unless it is known to be cached; nothing of one that the engine
    refuses."""
    marker = _marker(case)
    if is_kept(marker.name) or refusals(case):
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
    # What they complain of, this process will find as well, and say better.
    with contextlib.suppress(OSError):  # no process can be started, or it has ended
        _compile_in_children(pickle.dumps(case), [[], [BACK]] if beyond_springs(case) else [[]])


def _compile_in_children(message: bytes, each: list[list[str]]) -> None:
    """Have processes compile, one with each of the words; they end with this one, however that ends, as their input is
    then closed."""
    children: list[subprocess.Popen[bytes]] = []
    try:
        for words in each:
            children.append(_begin(words))
            _tell(children[-1], message)
        for child in children:
            child.wait()
    finally:
        for child in children:
            _end(child)


@contextlib.contextmanager
def compiling_in_background(case: Case, share: str, methods: Sequence[str] = ()) -> Iterator[None]:
    """Meanwhile another process compiles a share of what the kernels of general scenes are needed for, where none of
    these are there yet: with RESPONSES what evaluates steps, and behind that what these methods of differentiation
    call, which springs between free bodies need as well; with STEPS what makes steps, where `auto` has to.

    What this process does meanwhile finds on the disk what the other one has compiled.
    """
    child = None
    with contextlib.suppress(OSError):  # no process can be started, or it has ended
        if needs_general(case, methods) and compilation_due(case, methods):
            child = _begin([share, *methods])
            _tell(child, pickle.dumps(case))
    try:
        yield
    finally:
        if child is not None:
            _end(child)


def _begin(words: list[str]) -> subprocess.Popen[bytes]:
    """A process that compiles, once it is told the case."""
    return subprocess.Popen(
        command("mdstopo.session.compiling_apart", *words),
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def _tell(child: subprocess.Popen[bytes], message: bytes) -> None:
    """Send a process the case."""
    assert child.stdin is not None
    child.stdin.write(message)
    child.stdin.flush()


def _end(child: subprocess.Popen[bytes]) -> None:
    """End a process, and close our end of its input."""
    assert child.stdin is not None
    child.kill()
    child.wait()
    with contextlib.suppress(OSError):
        child.stdin.close()


def compile_in_background() -> None:
    """Compile the optimiser for few variables: the share of the second process (`mdstopo.warm`) where a case has
    many."""
    load_optimizer(tiny("auto"), FEW_VARIABLES)


def _marker(case: Case) -> Path:
    """An empty file that says that the kernels for such cases are cached."""
    include_kernels(case)
    family = "general" if beyond_springs(case) else "springs"
    family += "-priced" if case.priced_groups else ""
    family += "".join(f"-{many}" for many in (MANY_VARIABLES, VERY_MANY_VARIABLES) if case.space.size >= many)
    return cache_folder() / f"ready-{family}-{case.solver.integrator}-{case.solver.sensitivity}"


def _main() -> None:
    gc.disable()  # what the compiler makes lives on: looking through it again and again takes a tenth of the time
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides, and ends this process with itself
    case: Case = pickle.load(sys.stdin.buffer)
    end_with_parent(sys.stdin.buffer)
    if RESPONSES in sys.argv[1:]:
        engine = evaluator_of(case, in_background=False)
        if beyond_springs(case):
            engine.compile_responses()
        for method in sys.argv[2:]:
            engine.compile_method(method)
    elif STEPS in sys.argv[1:]:
        engine = evaluator_of(case, in_background=False)
        if engine.may_simulate_to_choose:
            engine.compile_steps()
    elif BACK in sys.argv[1:]:
        _compile_back(case)
    else:
        _compile_all(case)
    gc.freeze()  # it would be looked through at the end as well


def _compile_back(case: Case) -> None:
    """Compile the optimiser, and what evaluates responses and gradients from steps.

    In this order: meanwhile the other process gets on with forces and joints, which the latter calls as well and then
    finds on the disk.
    """
    engine = evaluator_of(case, in_background=False)
    load_optimizer(case, FEW_VARIABLES)
    if getattr(problem_of(engine, equal_weights(case)), "competes", False):
        load_optimizer(case, FEW_VARIABLES, competes=True)
    engine.compile_responses()


def _compile_all(case: Case) -> None:
    """Compile what the case needs, and note that it is there."""
    many = case.space.size >= MANY_VARIABLES
    engine = evaluator_of(case, share=["mdstopo.session.compiling_apart"] if many else [])
    if many:
        load_optimizer(case, MANY_VARIABLES)
    if beyond_springs(case):
        engine.compile_steps()
        motions(case, engine, case.start)  # what the other process compiles last comes last here
    problem = problem_of(engine, equal_weights(case))
    _, begin, _ = get_ready(case, engine, problem, None)
    engine.evaluate(case.space.expand(begin), gradient=True)
    if case.priced_groups:
        price(case, problem_of(engine, equal_weights(case)), begin, FEW_CANDIDATES)
    with contextlib.suppress(OSError):  # a full disk
        _marker(case).touch()


if __name__ == "__main__":
    _main()
