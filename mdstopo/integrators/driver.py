"""From Python to the compiled entries of an integrator: buffers, room, results.

A `Driver` belongs to one scene and one method. It keeps every buffer between calls, so that an evaluation allocates
little, and gives the steps more room when the kernel asks for it.
"""

from collections.abc import Callable
from importlib import import_module
from types import ModuleType
from typing import Any

import numpy as np

from mdstopo.case.memory import room_factor
from mdstopo.compiler.fields import aligned
from mdstopo.evaluation import USUAL, Rows, Shape
from mdstopo.integrators.integrands import MOST_HALVINGS, PATIENCE, VAIN, quadrature_breakpoints
from mdstopo.integrators.scene_driver import DriverOptions, ResponseResult
from mdstopo.integrators.steps import NEEDS_ROOM, OK, STEP_LIMIT, WORK, Q, V, carve, room_for, status_of
from mdstopo.mechanics.active_members import ROOMY
from mdstopo.scene.compile_scene import Scene
from mdstopo.scene.packing import Packed, pack
from mdstopo.scene.signal_segments import cut_segments
from mdstopo.scene.springs_model import FloatArray, IndexArray
from mdstopo.status import Status

#: how near to the highest a peak competes, and how many are kept
CLOSENESS = 0.15
ROWS = 4


class Driver:
    """One scene of springs between free bodies and one integrator, with all arrays, ready to run."""

    def __init__(
        self,
        scene: Scene,
        options: DriverOptions,
        load_responses: Callable[[], ModuleType],
        reductions: IndexArray,
        integrated: bool = False,
    ) -> None:
        """Make room, and pack the scene; nothing is compiled or imported yet.

        scene: the compiled load case.
        options: the method, its tolerance or step, and the array that designs are put in.
        load_responses: imports the compiled entries that evaluate responses from the steps (`energy_responses`).
        reductions (n_obj,): codes of `sensitivity.reductions`, one an objective.
        integrated: whether a response is integrated over time.
        """
        method, tolerance, step = options.method, options.tolerance, options.step
        self.scene = scene
        self.method = method
        self._entry: Any = None
        self._load_responses = load_responses
        self._responses: Any = None
        self._background = options.background
        self.packed = self._plain = pack(scene.model)
        n, n_pair = len(scene.model.inv_mass), len(scene.model.pair)
        #: coordinates, pairs, whether anything depends on velocity, whether loads turn: what room is made for
        self.shape = n, n_pair, scene.damped, len(scene.model.load_body) > 0
        fixed = step > 0.0 or not method.kind.adaptive
        newton = NEWTON_TOLERANCE if fixed else min(max(tolerance, NEWTON_TOLERANCE), LOOSE_NEWTON)
        self.settings = np.array([tolerance, newton, step, CLOSENESS])
        self.reductions = reductions
        self._integrated = integrated and not fixed
        self.work = np.zeros(WORK, dtype=np.int64)
        padded = scene.model.member.shape[1]
        count = len(reductions)
        self._alpha = options.design  # one array for all designs: a read-only one would be another type
        #: how the values come from what they are formed of (`evaluation.Peak`)
        self.shapes: tuple[Shape, ...] = tuple("plain" for _ in reductions)
        self.strength = aligned((ROOMY, padded))
        self.row_counts = np.zeros(count, dtype=np.int64)
        #: steps of the last run
        self.count = 0
        self.meeting = np.full(3, -1, dtype=np.int64)
        self._width = padded
        self._make_rows(ROWS)
        self._make_room(method.steps, method.stages)

    @property
    def entry(self) -> Any:
        """The method's compiled entries, imported when first used."""
        if self._entry is None:
            self._entry = import_module(self.method.kind.springs)
            if self._background is not None and self._background.due:
                self._entry.simulate.compile(*self._simulate_arguments(False))
        return self._entry

    @property
    def response_entries(self) -> Any:
        """The entries that evaluate responses; where they have never been compiled, another process is doing it."""
        if self._background is not None:
            self._background.wait()
            self._background = None
        return self._loaded_responses()

    def _loaded_responses(self) -> Any:
        """The same without waiting; after the method's own entries, which enter its functions in
        `steps_interface`."""
        if self._responses is None and self.entry is not None:
            self._responses = self._load_responses()
        return self._responses

    def compile_responses(self) -> None:
        """Compile what evaluates responses, without running it."""
        self._loaded_responses().evaluate_responses.compile(*self._response_arguments(0, True))
        room = self.limits, self.room, self.room_ints, self.strength
        self._loaded_responses().dense.compile(*self._dense_arguments(0, *room))

    def _make_rows(self, most: int) -> None:
        """Arrays for so many peaks of each objective."""
        count = len(self.reductions)
        self.padded = np.zeros((most, self._width))
        self.rows = np.zeros((count, most, 4))
        self.gradients = np.zeros((count, most, len(self._alpha)))
        self._evaluate: dict[bool, Callable[..., Any]] = {}

    def _make_room(self, steps: int, stages: int) -> None:
        n, n_pair, damped, turning = self.shape
        floats, ints = room_for(n, n_pair, steps, stages, damped, turning)
        self.limits = np.array([MAX_STEPS, steps, stages], dtype=np.int64)
        self.room = np.zeros(floats)
        self.room_ints = np.zeros(ints, dtype=np.int64)
        # prepared calls with this room: `simulate` by whether tangents are wanted, `evaluate_responses` by whether
        # gradients are
        self._simulate: dict[bool, Callable[..., Any]] = {}
        self._evaluate = {}

    def evaluate(self, alpha: FloatArray, gradient: bool, rows: Rows = USUAL) -> ResponseResult:
        """Simulate alpha (N,) and evaluate all objectives; `self.work` holds the counts of this call.

        Energies are no norms: `rows.cones` asks for nothing.
        """
        code, self.count, time = self.run(alpha, gradient)
        return self._evaluated(code, time, gradient, rows)

    def evaluate_simulated(self) -> ResponseResult:
        """Evaluate all objectives of the motion that `simulate` has computed (`SceneDriver`)."""
        return self._evaluated(OK, self.room.item(self.count), False, USUAL)

    def _evaluated(self, code: int, time: float, gradient: bool, rows: Rows) -> ResponseResult:
        """The objectives of the run of `count` steps that has ended with a code at a time."""
        self.settings[3] = CLOSENESS if rows.window is None else rows.window
        if self.rows.shape[1] != (rows.most or ROWS):
            self._make_rows(rows.most or ROWS)
        if code == OK:
            self._evaluate_responses(self.count, gradient)
        meeting, unresolved = self.meeting.item(0), self.meeting.item(2)
        return ResponseResult(
            status_of(code), time, self.rows, self.row_counts, self.gradients, meeting, unresolved=unresolved
        )

    def met(self, count: int) -> int:
        """A member (padded) whose ends meet under force within the steps of the last run, or -1."""
        self._evaluate_responses(count, False)
        return int(self.meeting[0])

    def _evaluate_responses(self, count: int, gradient: bool) -> None:
        if gradient not in self._evaluate:
            self._evaluate[gradient] = self.response_entries.evaluate_responses.prepare(
                *self._response_arguments(count, gradient)
            )
        self._evaluate[gradient]((_COUNT, count))

    def run(self, alpha: FloatArray, tangent: bool) -> tuple[int, int, float]:
        """Simulate alpha (N,) into the driver's own room: code, number of steps, time reached."""
        if alpha is not self._alpha:
            self._alpha[:] = alpha
        self._take(self._plain)
        found = self._run(tangent)
        return self._resolve(tangent, found) if self._integrated and found[0] == OK else found

    def _resolve(self, tangent: bool, found: tuple[int, int, float]) -> tuple[int, int, float]:
        """The run that was `found`, or one whose steps are short enough for the integral of the energy, too."""
        more, first, left = quadrature_breakpoints(self, found[1])
        times, total, plain = list[float](), first, found
        for lap in range(MOST_HALVINGS):
            if not more or found[0] != OK:
                break
            times += more
            self._take(pack(cut_segments(self.scene.model, times)))
            before, found = left, self._run(tangent)
            more, total, left = quadrature_breakpoints(self, found[1])
            if lap >= PATIENCE and left > VAIN * before:
                total = first
                break
        if found is plain or abs(total - first) > float(self.settings[0]) * abs(total):
            return found
        self._take(self._plain)  # longer steps were good enough: numbers stay what they were
        return self._run(tangent)

    def _take(self, packed: Packed) -> None:
        """Have the kernels compute a model, packed; calls that were prepared for another one are dropped."""
        if packed is not self.packed:
            self.packed = packed
            self._simulate, self._evaluate = {}, {}

    def _run(self, tangent: bool) -> tuple[int, int, float]:
        while True:
            self.work.fill(0)
            if tangent not in self._simulate:
                self._simulate[tangent] = self.entry.simulate.prepare(*self._simulate_arguments(tangent))
            code, count, time = self._simulate[tangent]()
            if code != NEEDS_ROOM:
                return code, count, time
            factor = room_factor(len(self.room))
            if factor == 1.0:
                return STEP_LIMIT, count if time > self.scene.model.times[0] else 0, time
            self._make_room(*(int(factor * int(size)) for size in self.limits[1:3]))

    def rate_at_start(self) -> float:
        """Fastest vibration at the start, rad/s, with the strengths of the last run."""
        from mdstopo.integrators.springs_generalized_alpha_entry import rate_at_start

        return float(rate_at_start(self.packed.ints, self.packed.floats, self.strength, self.scene.damped))

    def _simulate_arguments(self, tangent: bool) -> tuple[Any, ...]:
        return (
            self.packed.ints, self.packed.floats, self.method.tables, self._alpha, self.scene.damped, tangent,
            self.settings, self.limits, self.room, self.room_ints, self.strength, self.work,
        )  # fmt: skip

    def _response_arguments(self, count: int, gradient: bool) -> tuple[Any, ...]:
        return (
            self.entry.TAG, self.packed.ints, self.packed.floats, self.method.tables, self._alpha, self.scene.damped,
            self.settings, self.limits, count, self.reductions, gradient, self.room, self.room_ints, self.strength,
            self.padded, self.rows, self.row_counts, self.gradients, self.meeting, self.work,
        )  # fmt: skip

    def simulate(self, alpha: FloatArray) -> tuple[Status, "DenseSteps"]:
        """Simulate alpha (N,); the steps come back in arrays of their own."""
        code, self.count, _ = self.run(alpha, False)
        return status_of(code), DenseSteps(self, self.count)

    def _dense_arguments(
        self,
        count: int,
        limits: IndexArray,
        room: FloatArray,
        room_ints: IndexArray,
        strength: FloatArray,
        times: FloatArray | None = None,
        packed: Packed | None = None,
    ) -> tuple[Any, ...]:
        """Arguments of the compiled entry `dense`, with fresh arrays for what it writes.

        count: steps that were taken.
        limits (3,): steps allowed, room for steps, room for stages.
        room, room_ints: the steps (`steps.carve`).
        strength (3 or more, M_padded): as the run left them.
        times (T,): times that are asked for (s); none by default.
        packed: the model that was computed; by default the driver's present one.
        """
        asked = np.zeros(0) if times is None else times
        ints, floats = self.packed if packed is None else packed
        return (
            self.entry.TAG, ints, floats, self.method.tables, self.scene.damped, limits,
            count, room, room_ints, strength, asked, np.zeros((3, len(asked), self.shape[0])),
            np.zeros(WORK, dtype=np.int64),
        )  # fmt: skip


#: place of the number that changes from call to call, in `_look_arguments`
_COUNT = 8


class DenseSteps:
    """The steps of one simulation, and the motion between them."""

    def __init__(self, driver: Driver, count: int) -> None:
        self._driver = driver
        self._room, self._ints = driver.room.copy(), driver.room_ints.copy()
        self._limits, self._strength, self._packed = driver.limits, driver.strength[:3].copy(), driver.packed
        self.count = count
        n, n_pair, damped, turning = driver.shape
        arrays = carve.py_func(  # type: ignore[attr-defined]
            self._room, self._ints, n, n_pair, int(self._limits[1]), int(self._limits[2]), damped, turning
        )
        self.t: FloatArray = arrays[0][: count + 1]
        self.state: FloatArray = arrays[1][: count + 1]
        self.index: IndexArray = arrays[2][: count + 1]

    @property
    def q(self) -> FloatArray:
        """(count + 1, n) coordinates at the ends of the steps."""
        return self.state[:, Q]

    @property
    def v(self) -> FloatArray:
        """(count + 1, n) velocities at the ends of the steps."""
        return self.state[:, V]

    def balanced(self, times: FloatArray) -> tuple[tuple[FloatArray, FloatArray, FloatArray], FloatArray]:
        """Coordinates, velocities and accelerations as of `at`, and no multipliers: nothing is constrained."""
        q, v, a = self.at(times)
        return (q, v, a), np.zeros((len(times), 0))

    def reactions(self, q: FloatArray, lam: FloatArray) -> dict[str, FloatArray]:
        """Forces and moments in joints: none, there are no joints."""
        return {}

    def at(self, times: FloatArray) -> FloatArray:
        """q, v, a (3, T, n) at times (T,) within what was simulated."""
        if self.count == 0:
            raise ValueError("no step was completed")
        arguments = self._driver._dense_arguments(
            self.count, self._limits, self._room, self._ints, self._strength, np.array(times, dtype=np.float64),
            self._packed,
        )  # fmt: skip
        self._driver.response_entries.dense(*arguments)
        out: FloatArray = arguments[-2]
        return out


#: steps an integration may take before it is given up
MAX_STEPS = 1_000_000
#: Newton corrections relative to the motion at which a fixed implicit step counts as solved: the next would be
#: rounding. Adaptive ones need no better than their tolerance; the tangents are then off by no more than that.
NEWTON_TOLERANCE = 1e-10
LOOSE_NEWTON = 1e-4
