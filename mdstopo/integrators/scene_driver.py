"""What the engine knows of whatever computes a scene: one interface, whichever kernels the scene needs.

A `SceneDriver` simulates and differentiates one load case. `SceneFamily` (`sensitivity.scene_family`) makes it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from mdstopo.case.methods.integrators import IntegratorKind
from mdstopo.case.model import LoadCase, ReducedResponse
from mdstopo.evaluation import USUAL, Rows, Shape
from mdstopo.scene.settled import Settled
from mdstopo.scene.springs_model import FloatArray, IndexArray
from mdstopo.scene.vibration_modes import Modes
from mdstopo.status import Status


@dataclass(frozen=True)
class Method:
    """An integrator as the engine sees it.

    kind: its record. tables: its constant arrays. steps, stages: room to begin with. collocates: whether its stages are
    the nodes of Gauss's rules.
    """

    kind: IntegratorKind
    tables: FloatArray
    steps: int
    stages: int
    collocates: bool = False

    @property
    def name(self) -> str:
        """The name of the integrator, as the case file has it."""
        return self.kind.name


class Compiling(Protocol):
    """Another process that may be compiling what evaluates responses (`warm.BackgroundCompiler`).

    due: whether that has never been compiled here; wait: until the process has ended.
    """

    due: bool

    def wait(self) -> None: ...


class ResponseResult(NamedTuple):
    """What one call of `SceneDriver.evaluate` found; arrays are views that the next call overwrites.

    rows (n_obj, R, 4 or more): time, value, step, fraction, and what else the family keeps of a row.
    row_counts (n_obj,): how many rows of each response hold. gradients (n_obj, R, N): of these.
    meeting: padded index of a member whose ends meet, or -1. grazing: of one that leaves no derivative, or -1.
    unresolved: of a member whose stored energy has no digits, or -1.
    across: as gradients, of `evaluation.Peak.across`, where it was asked for; rows of responses without one are zero.
    message: who is to blame where a response cannot be evaluated although the motion is right.
    """

    status: Status
    time: float
    rows: FloatArray
    row_counts: IndexArray
    gradients: FloatArray
    meeting: int
    grazing: int = -1
    across: FloatArray | None = None
    unresolved: int = -1
    message: str = ""


class Scene(Protocol):
    """One load case as arrays; bodies: names in the order of the state; skipped: what was left out, and why.

    n: freedoms of the bodies that move. degrees_of_freedom: those of them that are free, less the independent rows
    of joints. redundant: joints with rows that others imply.
    """

    @property
    def load_case(self) -> LoadCase: ...
    @property
    def model(self) -> Any: ...
    @property
    def bodies(self) -> tuple[str, ...]: ...
    @property
    def skipped(self) -> tuple[str, ...]: ...
    @property
    def n(self) -> int: ...
    @property
    def degrees_of_freedom(self) -> int: ...
    @property
    def redundant(self) -> tuple[str, ...]: ...


class Steps(Protocol):
    """The steps of one simulation in arrays of their own: t (count + 1,); q (count + 1, n_q) and v (count + 1, n)."""

    count: int
    t: FloatArray

    @property
    def q(self) -> FloatArray: ...
    @property
    def v(self) -> FloatArray: ...

    def balanced(self, times: FloatArray) -> tuple[tuple[FloatArray, FloatArray, FloatArray], FloatArray]:
        """States and accelerations at times (T,): q (T, n_q), v, a (T, n) and lam (T, n_rows) of joints and motions;
        right-continuous."""

    def reactions(self, q: FloatArray, lam: FloatArray) -> dict[str, FloatArray]:
        """Joint name -> force and moment (T, D) on its first body at the joint, global axes.

        q (T, n_q), lam (T, n_rows): states.
        """


class SceneDriver(Protocol):
    """One scene, one method, ready to run: the arrays and compiled entries of a load case.

    Designs are alpha (N,), and behind it the values (P,) of the case's variables. Members are told by their place in
    the padded arrays of the scene. settings: tolerance of the motion, of Newton's iteration, fixed step (s), window of
    competing peaks. rows: of the last `ResponseResult`. shapes: how the value of each response is formed
    (`evaluation.Peak`). work (WORK,): counts of the last call. room: where the steps are kept.
    """

    @property
    def scene(self) -> Scene: ...
    @property
    def settings(self) -> FloatArray: ...
    @property
    def rows(self) -> FloatArray: ...
    @property
    def shapes(self) -> tuple[Shape, ...]: ...
    @property
    def work(self) -> IndexArray: ...
    @property
    def room(self) -> FloatArray: ...

    def compile_responses(self) -> None:
        """Have the machine code that evaluates responses on the disk, without any steps."""

    def evaluate(self, alpha: FloatArray, gradient: bool, rows: Rows = USUAL) -> ResponseResult:
        """Simulate a design and evaluate all responses, and on demand their gradients by the discrete adjoint."""

    def simulate(self, alpha: FloatArray) -> tuple[Status, Steps]:
        """Simulate a design; the steps come back in arrays of their own."""

    def evaluate_simulated(self) -> ResponseResult:
        """Evaluate all responses of the motion that `simulate` has computed, without gradients. It has to be the last
        that was computed, and not to have failed."""

    def displacements(self, q: FloatArray) -> FloatArray:
        """(T, n_body, D): by how much bodies have moved and turned (m, rad) at q (T, n_q) since its first row."""

    def response_history(self, alpha: FloatArray, times: FloatArray) -> FloatArray:
        """(n_resp, T): every response of a design at times (T,), which its motion reaches."""

    def met(self, count: int) -> int:
        """A member whose ends meet under force within the steps of the last run, or -1."""

    def member(self, padded: int) -> str:
        """A member in words, from its place in the padded arrays."""

    def explain(
        self, alpha: FloatArray, status: Status, time: float, q: FloatArray, v: FloatArray
    ) -> tuple[Status, str]:
        """The status of a run that ended at `time` at q (n_q,) and v (n,), and who is to blame, in words."""

    def rate_at_start(self) -> float:
        """Fastest vibration at the start, rad/s, with the design of the last run."""

    def start_modes(self, alpha: FloatArray) -> Modes:
        """Small motion about the start."""

    def pricing_states(self, factor: FloatArray) -> Any:
        """The states from which prices of members follow, built or not, of the rows of the last evaluation, each times
        its factor (n_obj, R); with gradients. Their `of_all` puts those of several scenes together;
        `CandidatePass` takes them."""

    def settled(self, alpha: FloatArray) -> Settled | None:
        """How far the start moves to be at rest with a design; None where the case does not settle, or cannot."""


@dataclass(frozen=True)
class DriverOptions:
    """What a driver is made for, beside its scene.

    method: the integrator. tolerance: relative error that objectives and gradients may have. step: fixed step (s); 0:
    adaptive steps; negative: see `springs_generalized_alpha.longest_step`. responses: reduced ones, those of objectives
    first. design (N + P,): the array that every design is put in, shared with whoever gives designs. background:
    another process that may be compiling what evaluates responses. fits: whether joints are to fit at the start, which
    a kernel finds out.
    """

    method: Method
    tolerance: float
    step: float
    responses: Sequence[ReducedResponse]
    design: FloatArray
    background: Compiling | None = None
    fits: bool = True
