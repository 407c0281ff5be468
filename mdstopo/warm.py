"""First use on a machine: the kernels are compiled side by side, in two processes.

Compiled kernels are kept on disk (`compiler`), and their argument types are the same for every case. So while this
process compiles an integrator and the optimiser, another one compiles what evaluates responses, on a case of its own: a
body on a spring. Afterwards everything is read from the disk. If the other process fails, nothing is lost but time:
what is missing is compiled here when it is called.
"""

import contextlib
import subprocess
from collections.abc import Sequence
from pathlib import Path

from mdstopo.case.methods.sensitivities import SENSITIVITIES
from mdstopo.case.model import Case
from mdstopo.case.reader import read_case
from mdstopo.children import command
from mdstopo.compiler.store import are_kept, cache_folder, is_kept
from mdstopo.scene.family import beyond_springs
from mdstopo.scene.other_kernels import include_kernels

#: what the other process runs: it stands above the engine, which begins it
PROGRAM = "mdstopo.compile_responses"

_CASE = """
format: 1
time: {{end: 0.1}}
bodies: {{mass: {{mass: 1, inertia: 1, position: [0, 1]}}}}
members:
  spring: {{from: {{body: ground, at: [0, 0]}}, to: {{body: mass, at: [0, 1]}}, law: {{type: spring, stiffness: 1}}}}
objectives: {{G: {{response: energy}}}}
solver: {{integrator: {integrator}}}
"""


def _marker(integrator: str) -> Path:
    return cache_folder() / f"{integrator}.compiled"


def is_compiled(integrator: str) -> bool:
    """Whether an integrator and what evaluates responses have been compiled for this source on this machine."""
    return is_kept(_marker(integrator).name)


def mark_compiled(integrator: str) -> None:
    """Remember that they are on the disk. A disk that cannot be written to is no reason to stop."""
    with contextlib.suppress(OSError):
        _marker(integrator).parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        _marker(integrator).touch()


def needs_general(case: Case, methods: Sequence[str] = ()) -> bool:
    """Whether the case, or one of these methods of differentiation, needs the kernels of general scenes."""
    return bool(beyond_springs(case)) or not all(SENSITIVITIES[method].comes_with_values for method in methods)


def compiling(case: Case, methods: Sequence[str] = ()) -> str:
    """What is said before the kernels for such a case, and these methods, are compiled for the first time."""
    how_long = "about a minute" if needs_general(case, methods) else "up to half a minute"
    return f"compiling the kernels, once for this version: {how_long}"


def compilation_due(case: Case, methods: Sequence[str] = ()) -> bool:
    """Whether kernels of this version have never been compiled here for such a case and these methods."""
    include_kernels(case)
    due = needs_general(case, methods) and not are_kept("mdstopo.general.")
    return due or not (beyond_springs(case) or are_kept("mdstopo.integrators."))


class BackgroundCompiler:
    """A process in the background that compiles what evaluates responses, if that has never been compiled here.

    share: modules whose `compile_in_background` it calls before that.
    """

    def __init__(self, integrator: str, share: Sequence[str] = ()) -> None:
        self.integrator = integrator
        self._child: subprocess.Popen[bytes] | None = None
        self.due = not is_compiled(integrator)
        if self.due:
            with contextlib.suppress(OSError):
                self._child = subprocess.Popen(
                    command(PROGRAM, integrator, *share),
                    stdin=subprocess.PIPE,  # its end is how the other process knows of ours
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                )

    def wait(self) -> None:
        """Wait for its end; stop it where this process is interrupted meanwhile."""
        child, self._child = self._child, None
        compiled = False
        if child is not None:
            try:
                compiled = child.wait() == 0
            except BaseException:
                child.kill()
                child.wait()
                raise
            finally:
                _let_go(child)
        if self.due:
            self.due = False
            if compiled:
                mark_compiled(self.integrator)

    def __del__(self) -> None:
        """Nobody has asked for what the other process compiles: an evaluator that was never used."""
        child = getattr(self, "_child", None)
        if child is not None:
            child.kill()
            child.wait()
            _let_go(child)


def _let_go(child: "subprocess.Popen[bytes]") -> None:
    """Close our end of its input."""
    assert child.stdin is not None
    with contextlib.suppress(OSError):
        child.stdin.close()


def tiny(integrator: str) -> Case:
    """A body on a spring: the smallest case that needs all kernels of an integrator."""
    return read_case(_CASE.format(integrator=integrator))
