"""One compiled general scene, ready to run: its arrays, calls of the compiled entries, and what they find."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from mdstopo.case.memory import most_floats, room_factor
from mdstopo.case.methods.over_time import ReductionKind
from mdstopo.case.methods.sensitivities import SENSITIVITIES
from mdstopo.case.model import GROUND, Case, MemberGroup
from mdstopo.case.responses.response_kinds import kind_of
from mdstopo.evaluation import USUAL, Rows, Shape
from mdstopo.general.at_rest.joints_at_start import fitted_start
from mdstopo.general.at_rest.start import SettledStart
from mdstopo.general.driver.blame import named_member, why_it_ended
from mdstopo.general.driver.general_steps import GeneralSteps
from mdstopo.general.driver.ready import Ready
from mdstopo.general.driver.row_gradients import BLOCK, RowGradients
from mdstopo.general.model.general_model import (
    CODE,
    INERTER,
    VARIED_PLACE,
    GeneralModel,
    pack_general,
)
from mdstopo.general.over_time.competing_members import compete, members_peaks
from mdstopo.general.over_time.minima import minima
from mdstopo.general.over_time.pieces import Pieces
from mdstopo.general.over_time.quadrature_breakpoints import MOST_LOOKS, followed_integrals, quadrature_breakpoints
from mdstopo.general.over_time.switch_changes import moving_switches
from mdstopo.general.over_time.switch_pieces import switched_integral, switched_peaks
from mdstopo.general.over_time.zeros_of_norms import complete_at_zeros
from mdstopo.general.responses.extremes import (
    COLUMNS,
    FRACTION,
    LAST,
    SEEN,
    SIGN,
    STEP,
    TIME,
    VALUE,
    row_of,
)
from mdstopo.general.responses.general_responses import norms_in, switches_of
from mdstopo.general.responses.integral_reductions import value_of_integral
from mdstopo.general.responses.response_shapes import shape_of
from mdstopo.general.scene.compile_general import GeneralScene, compile_general
from mdstopo.general.scene.dimension import dimension_of
from mdstopo.general.scene.further_times import landed
from mdstopo.general.scene.variables import Placing
from mdstopo.general.steps.step_history import FACTORS, GRAZES, KEPT, NOTHING, POSES, TANGENTS, WINDOWS, history_room
from mdstopo.integrators.driver import CLOSENESS, MAX_STEPS, NEWTON_TOLERANCE
from mdstopo.integrators.scene_driver import DriverOptions, ResponseResult
from mdstopo.integrators.steps import (
    HALF_TURN,
    NEEDS_ROOM,
    OK,
    STEP_LIMIT,
    UNSETTLED,
    WORK,
    status_of,
)
from mdstopo.mechanics.laws.law_table import SPRING
from mdstopo.scene.settled import Settled
from mdstopo.scene.springs_model import FloatArray, IndexArray
from mdstopo.scene.vibration_modes import Modes
from mdstopo.sensitivity.scene_family import SceneFamily
from mdstopo.status import Status

if TYPE_CHECKING:
    from mdstopo.general.driver.entries import Entries
    from mdstopo.general.driver.general_pricing import GeneralCandidates, PricingStates

#: peaks kept of one response, unless told otherwise
ROWS = 6
#: where a spring's damping stands among the parameters of its law
DAMPING = 1
#: places of the arguments that may be others at each evaluation: of `_simulate_arguments` `tangent`, of
#: `_plain_arguments` `count` and `window`
TANGENT_AT = 4
COUNT_AT, WINDOW_AT = 6, 11
#: from so many numbers on (128 MB) the arrays for steps grow without what only gradients need, where none are wanted
LARGE_HISTORY = 2**24
#: for peaks of whole steps
NO_PIECES = np.empty((0, 4))


@dataclass(frozen=True)
class Differentiated:
    """gradients (n_obj, R, N) of the rows; message: what the user should know although it worked, or empty.

    across: as gradients, of `evaluation.Peak.across`, or None.
    """

    status: Status
    message: str
    gradients: FloatArray
    across: FloatArray | None = None


class GeneralDriver:
    """One general scene and one integrator, ready to run; `integrators.scene_driver.SceneDriver` says what it can
    do."""

    def __init__(self, case: Case, scene: GeneralScene, options: DriverOptions) -> None:
        self.case = case
        self.scene = scene
        self.method = options.method
        model = scene.model
        #: coordinates and velocities at the start: as stated, or as assembled
        self._start = model.q0, model.v0
        self._model = model
        self._placing = Placing(case, scene.load_case, model) if case.variables else None
        self._packed = self.ints, self.floats = self.pack(model)
        #: whether a response is integrated over time
        self._integrated = any(reduction.is_integral for reduction in scene.reductions)
        self.settings = np.array(
            [options.tolerance, NEWTON_TOLERANCE, options.step, CLOSENESS, float(self._integrated)]
        )
        self.work = np.zeros(WORK, dtype=np.int64)
        padded, n_design, count = model.member.shape[1], case.n_design, len(scene.responses)
        varied = 0 if self._placing is None else len(self._placing.initial)
        self._alpha = np.zeros(n_design)
        #: of the laws' variables; none before the first design
        self._values = np.zeros(0)
        self.member_state = np.zeros((3, padded + len(model.contact_pair) + 1))
        #: responses that are expressions, which may have no values
        self._expressions = [j for j, response in enumerate(scene.responses) if response.of]
        self.padded = np.zeros(padded + varied)
        self._padded_row = self.padded.reshape(1, -1)
        self.row_counts = np.zeros(count, dtype=np.int64)
        #: how the value of every response is formed: plain, absolute, a norm (`evaluation.Peak.shape`)
        self.shapes: tuple[Shape, ...] = tuple(
            shape_of(model, j, reduction) for j, reduction in enumerate(scene.reductions)
        )
        self.where = np.full(3, -1, dtype=np.int64)
        #: steps of the last run
        self.count = 0
        n = len(model.mass)
        #: arrays for the results of `evaluate_one`, and of `_integral_with_gradient`
        self._one = (
            np.zeros(1, dtype=np.int64), np.zeros((1, 1), dtype=np.int64), np.zeros((1, 2)),
            np.zeros((1, len(model.q0))), np.zeros((2, 1, n)), np.zeros((1, self._multipliers)),
            np.zeros((1, 1, SEEN)),
        )  # fmt: skip
        #: for states that nobody asks for
        self._no_states = np.zeros((0, len(model.q0))), np.zeros((2, 0, n)), np.zeros((0, self._multipliers))
        self._integral_gradient = np.zeros(n_design + varied)
        #: gradients of the rows that were found, and arrays for so many rows at once
        self.row_gradients = RowGradients(self)
        self._no_slopes = np.zeros((0, 0))
        self._arrays: dict[str, list[FloatArray]] = {}
        self._make_rows(ROWS)
        self.start_vjp = np.zeros(n if case.solver.settle else 0)
        self.events = 0
        #: what jumps of integrands do to the gradients of their integrals (`switch_pieces`)
        self.jumps: dict[int, list[tuple[float, FloatArray]]] = {}
        #: where the steps of the last evaluation had to end
        self.quadrature_breakpoints: list[float] = []
        self._inertial = bool(np.any(model.block[:, CODE] == INERTER))
        self._entry: Entries | None = None
        self._message = ""
        self._allowed = MAX_STEPS
        self._make_first_room()
        if options.fits:
            self._fit()
        #: at rest, where the case asks for it
        self.start = SettledStart(self) if case.solver.settle else None

    @property
    def alpha(self) -> FloatArray:
        """(N,) alpha of the design that was last taken."""
        return self._alpha

    @property
    def values(self) -> FloatArray:
        """(P,) values of variables in the design that was last taken."""
        return self._values

    @property
    def _design(self) -> FloatArray:
        """(N + P,): the design that was last taken; a copy."""
        return np.concatenate([self._alpha, self._values])

    @property
    def entry(self) -> "Entries":
        """The method's compiled entries, imported when first used."""
        if self._entry is None:
            from mdstopo.general.driver.entries import entries_of

            self._entry = entries_of(self.method.kind)
        return self._entry

    def pack(self, model: GeneralModel) -> tuple[IndexArray, FloatArray]:
        """The arrays of a scene of this driver's bodies, as entries take them."""
        if self._placing is not None:
            model = self._placing.with_twins(model, self.scene.kinematics)
        return pack_general(model, self.scene.kinematics)

    @property
    def _is_planar(self) -> bool:
        """Whether vectors have one direction across them, which rows of norms can tell (`evaluation.Peak.across`)."""
        return self.scene.kinematics.rotations == 1

    @property
    def _keeps_poses(self) -> bool:
        """Whether K of a stage is kept as poses and sums over members: of undamped members between bodies in space,
        where that is two thirds as many numbers and less work. Contacts and damping have parts of their own in K."""
        model = self.scene.model
        rated = (model.block[:, CODE] != SPRING) | (model.law[:, DAMPING] != 0.0)
        varied = model.varied[:, VARIED_PLACE] == DAMPING
        bushed = model.bushing[:, -self.scene.kinematics.freedoms :] != 0.0
        damped = np.any(rated) or np.any(varied) or np.any(bushed) or len(model.contact_pair) > 0
        return not (self._is_planar or damped)

    def allow(self, steps: int) -> None:
        """Limit the number of steps of a run; one that needs more ends with STEP_LIMIT."""
        self._allowed = self.limits[0] = steps

    @property
    def _kept_for_gradients(self) -> int:
        """What is kept of a stage beside its state where gradients may be wanted (`step_history`)."""
        if self.method.collocates:
            return WINDOWS
        # the reverse sweep uses a stage's factors again where it is explicit and the mass is diagonal
        if not self.method.kind.explicit or self._inertial:
            return TANGENTS
        return POSES if self._keeps_poses else FACTORS

    def _make_room(self, steps: int, stages: int, events: int, kept: int) -> None:
        self.limits = np.array([self._allowed, steps, stages, events, self._inertial, kept], dtype=np.int64)
        floats, ints = history_room(self.scene.model, self.limits)
        self.room = np.zeros(floats)
        self.room_ints = np.zeros(ints, dtype=np.int64)
        self.ready = Ready()  # prepared calls hold the arrays of before

    def _make_first_room(self) -> None:
        """Room for a short motion, with all that gradients need."""
        self._make_room(self.method.steps, self.method.stages, 64, self._kept_for_gradients)

    def _grow(self, tangent: bool) -> bool:
        """Make twice the room, or as much as memory has; False where that is hardly more.

        tangent: whether gradients are wanted. Where they are not, what they need takes no more room: it is most of it.
        """
        kept = int(self.limits[KEPT])
        if self.method.kind.explicit and not tangent and kept != NOTHING and len(self.room) > LARGE_HISTORY:
            kept, factor = NOTHING, 2.0  # which takes less than before
        else:
            factor = room_factor(len(self.room))
        if factor == 1.0:
            return False
        steps, stages, events = (int(factor * int(size)) for size in self.limits[1:4])
        self._make_room(steps, stages, events, kept)
        return True

    def _full(self, count: int, time: float) -> str:
        """That memory has no room for more steps, and what helps."""
        return (
            f"at t = {time:.6g} s; {count} steps fill the {8e-9 * most_floats():.2g} GB that one run may take of this "
            "machine's memory: a looser tolerance, a shorter time.end, or a machine with more memory"
        )

    def _make_rows(self, most: int) -> None:
        """Arrays for at most so many peaks of each response; that of `Peak.across` comes when it is first asked for."""
        count, length = len(self.scene.responses), len(self._integral_gradient)
        self.rows = np.zeros((count, most, COLUMNS))
        self._rows_of = list(self.rows)
        self.gradients = np.zeros((count, most, length))
        self._gradients_of = list(self.gradients)
        self.across: FloatArray | None = None

    def _fit(self) -> None:
        """Refuse joints that do not fit at the start, or move the start where the case asks for it (CaseError)."""
        if not len(self.scene.model.joint):
            return
        q, v = fitted_start(self)
        self.moved = float(np.abs(self.scene.kinematics.difference(q, self.scene.model.q0)).max())
        if self.case.solver.assemble:
            self._start = q, v
            self._place()

    def evaluate(self, alpha: FloatArray, gradient: bool, rows: Rows = USUAL) -> ResponseResult:
        """Simulate alpha (N,) and evaluate all responses; `self.work` holds the counts of this call."""
        code, _, time = self.run(alpha, gradient)
        return self._evaluated(code, time, gradient, rows)

    def evaluate_simulated(self) -> ResponseResult:
        """Evaluate all responses of the motion that `simulate` has computed (`SceneDriver`)."""
        return self._evaluated(OK, self.room.item(self.count), False, USUAL)

    def _evaluated(self, code: int, time: float, gradient: bool, rows: Rows) -> ResponseResult:
        """The responses of the last run, of `count` steps.

        code, time: how it ended, and the time that it has reached; where steps have to end elsewhere for an integral,
        the same design is simulated again. gradient, rows: as of `evaluate`.
        """
        if self.rows.shape[1] != (rows.most or ROWS):
            self._make_rows(rows.most or ROWS)
        window = CLOSENESS if rows.window is None else rows.window
        across = self._across() if rows.cones and gradient and self._is_planar else None
        self.quadrature_breakpoints = []
        followed = followed_integrals(self, self.count) if self._integrated and code == OK else {}
        for _ in range(MOST_LOOKS):
            more = quadrature_breakpoints(self, self.count, followed) if code == OK else []
            if not more:
                break
            self.quadrature_breakpoints = self.quadrature_breakpoints + more
            code, _, time = self.run(self._design, gradient, self.quadrature_breakpoints)
        self.jumps = {}
        status, message = status_of(code), self.rotation_jump(self.count) if code == OK else ""
        if message:
            status = Status.ROTATION_JUMP
        elif code == OK:
            self._find_rows(self.count, gradient, window, across)
            status, message = self._without_value(gradient)
        grazing, meeting = self._grazing(), self.where.item(1)
        return ResponseResult(
            status, time, self.rows, self.row_counts, self.gradients, meeting, grazing, across, message=message
        )

    def _find_rows(self, count: int, gradient: bool, window: float, across: FloatArray | None) -> None:
        """The rows of all responses of a run of so many steps, and on demand their gradients.

        window: of competing peaks. across: as `gradients`, of `evaluation.Peak.across`, where it is asked for.
        """
        plain = gradient and self._plain_rows and across is None
        if plain and self._find_rows_with_gradients(count, window):
            return
        if not plain:
            for j, reduction in enumerate(self.scene.reductions):
                self._reduce_response(j, reduction, count, gradient, window)
        if gradient:
            self.row_gradients(count, across)

    def _without_value(self, gradient: bool) -> tuple[Status, str]:
        """Whether responses have values, and those that are expressions gradients where wanted; which has none, and
        when."""
        for j, response in enumerate(self.scene.responses):
            # what is no number is the limit that other rows are compared with, so it stands first; not in expressions
            if not response.of and (not self.row_counts[j] or math.isfinite(self.rows.item(j, 0, VALUE))):
                continue
            rows = self.rows[j, : self.row_counts[j]]
            none = rows[~np.isfinite(rows[:, VALUE])]
            if len(none):
                what = f"expression {response.formula}" if response.of else f"response {response.kind}"
                when = f" at t = {none[0, TIME]:.6g} s" if np.isfinite(none[0, TIME]) else ""
                return Status.NON_FINITE, f"the {what} has no value{when}"
        for j in self._expressions if gradient else ():
            if not np.all(np.isfinite(self.gradients[j, : self.row_counts[j]])):
                return Status.NO_GRADIENT, f"the expression {self.scene.responses[j].formula} has an infinite slope"
        return Status.OK, ""

    @cached_property
    def _rotations(self) -> dict[tuple[str, str], IndexArray]:
        """Numbers of observer and body, by their names, of rotations that are responses before the end."""
        bodies, found = self.scene.bodies, {}
        for response, reduction in zip(self.scene.responses, self.scene.reductions, strict=True):
            for each in response.parts:
                if kind_of(each).jumps and not reduction.at_end:
                    pair = each.relative_to or GROUND, each.body or GROUND
                    found[pair] = np.array([bodies.index(name) for name in pair])
        return found

    def rotation_jump(self, count: int) -> str:
        """A sentence on the rotation response that has turned by half a turn, where its vector jumps, and when; empty
        where none has."""
        if not self._rotations:
            return ""
        t, q, _ = self.states()
        pairs = np.array(list(self._rotations.values()))
        found = dimension_of(self.case).half_turn(pairs, self.scene.model.home, q[: count + 1])
        if found is None:
            return ""
        state, number = found
        observer, body = list(self._rotations)[number]
        seen = "" if observer == GROUND else f", seen from {observer}"
        return (
            f"rotation of {body}{seen}, at t = {t[state]:.6g} s; its value at the end (`over_time: final`), "
            "angular_velocity and tilt go on"
        )

    def _across(self) -> FloatArray:
        """(n_resp, R, N): of `evaluation.Peak.across`, zeros."""
        if self.across is None:
            self.across = np.zeros_like(self.gradients)
        self.across[:] = 0.0
        return self.across

    def _grazing(self) -> int:
        """A member (padded) that grazes (`events`), so that the motion or a row found has no derivative; or -1."""
        grazing = self.where.item(2)
        if grazing >= 0 or self.events == 0:
            return grazing
        steps, events = int(self.limits[1]), int(self.limits[3])
        event = self.room_ints[4 * (steps + 1) :].reshape(events, 6)[: self.events]
        for state, member, *_ in event[event[:, GRAZES] != 0].tolist():
            for rows, n_rows in zip(self.rows, self.row_counts, strict=True):
                if np.any(rows[:n_rows, STEP] + rows[:n_rows, FRACTION] == state):
                    return int(member)
        return -1

    def _reduce_response(self, j: int, reduction: ReductionKind, count: int, gradient: bool, window: float) -> None:
        """Rows of response j, reduced over time; of an integral the gradient, too."""
        rows = self.rows[j]
        if reduction.is_integral:
            t = self.states()[0]
            total = self._integral_with_gradient(j, reduction.power, count, gradient, self.gradients[j, 0])
            value, slope = value_of_integral(reduction, total, float(t[count] - t[0]))
            rows[0] = row_of(np.nan, value, 0, 0.0, slope, 1.0, -1.0)
            if gradient:
                self.gradients[j, 0] *= slope
            self.row_counts[j] = 1
            if moving_switches(self, j):
                pieces = Pieces(self, j, t[: count + 1].copy())
                self.jumps[j] = switched_integral(self, j, pieces, reduction.is_squared, slope)
            return

        competing = compete(self.scene.model.response[j, 0], reduction)
        switched = switches_of(self.scene.model, j) > 0 and not reduction.at_end
        if not competing and not switched and reduction.is_largest:
            n_rows = self._peaks_of_steps(j, reduction.is_magnitude, count, window)
        elif not competing and reduction.at_end:
            value, rate, who = self.evaluate_one(j, count, np.array([count - 1.0, 1.0])).tolist()
            rows[0] = row_of(self.states()[0].item(count), value, count - 1, 1.0, rate, 1.0, who)
            n_rows = 1
        else:
            t = self.states()[0][: count + 1].copy()
            if switched:
                candidates = switched_peaks(self, j, Pieces(self, j, t), reduction.signs, window)
            elif competing:
                candidates = members_peaks(self, j, t, reduction.at_end, window, len(rows))
            else:
                candidates = list(minima(self, j, t))
            n_rows = self.entry.rank_rows(np.array(candidates), window, float(t[-1] - t[0]), rows)
        if not reduction.at_end:
            complete_at_zeros(self, j, count, rows[:n_rows])
        self.row_counts[j] = n_rows
        if reduction.is_magnitude:
            rows[:n_rows, VALUE] *= rows[:n_rows, SIGN]

    @cached_property
    def _plain_rows(self) -> bool:
        """Whether one compiled call (`rows_with_gradients`) finds the rows of an evaluation with their gradients.

        There is one response, not of competing members, of which the largest value, the largest magnitude or the end is
        meant; peaks are those of the response itself, without switches; and the motion starts as stated.
        """
        if len(self.scene.reductions) != 1 or self.start is not None:
            return False
        (reduction,), model = self.scene.reductions, self.scene.model
        plain = reduction.at_end or (reduction.is_largest and switches_of(model, 0) == 0 and not norms_in(model, 0))
        plain = plain and not compete(model.response[0, 0], reduction)
        return plain and self.rows.shape[1] * len(self.padded) <= BLOCK

    def _find_rows_with_gradients(self, count: int, window: float) -> bool:
        """Rows of the only response, with their gradients; False where these are still to be found."""
        (reduction,) = self.scene.reductions
        n_rows, differentiated = self.ready.often(
            "rows_with_gradients", self.entry.rows_with_gradients, (self.floats, self.rows),
            ((COUNT_AT, count), (WINDOW_AT, window)),
            lambda: self._plain_arguments(count, window),
        )  # fmt: skip
        self.row_counts[0] = n_rows
        if reduction.is_magnitude:
            self.rows[0, :n_rows, VALUE] *= self.rows[0, :n_rows, SIGN]
        return bool(differentiated)

    def _plain_arguments(self, count: int, window: float) -> tuple[Any, ...]:
        """All arguments of `rows_with_gradients`; count and window stand at `COUNT_AT` and `WINDOW_AT`."""
        (reduction,) = self.scene.reductions
        return (
            *self.steps_arguments(count), 0, reduction.is_magnitude, reduction.at_end, self.steps_are_fine, window,
            self.room, self.room_ints, self.member_state, self._padded_row, self._rows_of[0], self._gradients_of[0],
            self.work,
        )  # fmt: skip

    def _peaks_of_steps(self, j: int, both: bool, count: int, window: float) -> int:
        """The highest peaks of response j, and where `both` are wanted of -g, into its rows; how many they are."""
        found: int = self.ready(
            f"peaks_of_steps {j}", self.entry.peaks_of_steps, *self._history_arguments(count), j, both,
            self.steps_are_fine, window, self._rows_of[j], self.work,
        )  # fmt: skip
        return found

    def arrays_once(self, name: str, make: Callable[[], list[FloatArray]]) -> list[FloatArray]:
        """Arrays for an entry that `ready` prepares, made at the first use under this name."""
        if name not in self._arrays:
            self._arrays[name] = make()
        return self._arrays[name]

    @property
    def keeps_tangents(self) -> bool:
        """Whether steps have their tangents without being asked for them."""
        return self.method.collocates or not self.method.kind.adaptive

    @property
    def steps_are_fine(self) -> bool:
        """Whether no step is as long as a vibration (`peak_search.sample_steps`)."""
        return self.method.kind.explicit or not self.method.kind.adaptive

    def peaks_of_pieces(
        self,
        j: int,
        count: int,
        t: FloatArray,
        seen: FloatArray,
        sign: float,
        window: float,
        pieces: FloatArray = NO_PIECES,
        who: int = -1,
        plain: IndexArray | None = None,
    ) -> FloatArray:
        """The peaks (K, COLUMNS) of response j in sampled pieces of steps (`peak_search.peaks_of_pieces`).

        j: the response.
        count: how many steps the run has.
        t (P + 1,): ends of the pieces (s).
        seen (P, SAMPLES, 3): their samples.
        sign: 1 for peaks of g, -1 for those of -g.
        window: how far below the highest sample a peak may be, relative to it.
        pieces (P, 4): what they are; no rows: the steps of the run.
        who: of the steps the member whose force is meant; -1: at each place the one with the largest.
        plain (P,): 1 where the samples inside a piece are left out; None: nowhere.
        """
        plain = np.zeros(len(seen), dtype=np.int64) if plain is None else plain
        rows = np.empty(((LAST + 2) * len(t), COLUMNS))
        found = self.entry.peaks_of_pieces(
            *self._history_arguments(count), j, who, pieces, t, seen, plain, sign, window, rows, self.work,
        )  # fmt: skip
        return rows[:found].copy()

    def sample_response(
        self,
        j: int,
        places: FloatArray,
        exact: bool,
        count: int,
        steps: GeneralSteps | None = None,
        who: int = -1,
        rates: bool = True,
    ) -> tuple[tuple[FloatArray, FloatArray], FloatArray, FloatArray]:
        """States and a response anywhere on the motion.

        j: the response; -1: states alone.
        places (K, 2): steps and fractions of them.
        exact: whether states inside steps are the integrator's own, not those of the quintic through both ends.
        count: how many steps the run has.
        steps: kept steps to evaluate instead of those of the last run.
        who: the member whose force is meant; -1: at each place the one with the largest.
        rates: whether rates are wanted; without, they may be meaningless.

        Returns q (K, n_q) with v, a (2, K, n), multipliers (K, n_row + n_driven), and (K, 3) value, rate, member.
        """
        whose = np.full((len(places), int(j >= 0)), who, dtype=np.int64)
        js = np.array([j] if j >= 0 else [], dtype=np.int64)
        states, lam, seen = self.sample_responses(js, places, whose, exact, count, steps, rates)
        return states, lam, seen[:, 0] if j >= 0 else np.full((len(places), SEEN), np.nan)

    def sample_responses(
        self,
        js: IndexArray,
        places: FloatArray,
        who: IndexArray,
        exact: bool,
        count: int,
        steps: GeneralSteps | None = None,
        rates: bool = True,
    ) -> tuple[tuple[FloatArray, FloatArray], FloatArray, FloatArray]:
        """States and responses anywhere on the motion; without rates one balance at each place serves all.

        js (R,): the responses; none: states alone.
        places (K, 2): steps and fractions of them.
        who (K, R): the members whose forces are meant; -1: the one with the largest there.
        exact, count, steps, rates: as of `sample_response`.

        Returns q (K, n_q) with v, a (2, K, n), multipliers (K, n_row + n_driven), and (K, R, 3) values in the units of
        the responses, rates (per s) and members.
        """
        model = self.scene.model
        packed, limits, room, room_ints, member_state = (
            ((self.ints, self.floats), self.limits, self.room, self.room_ints, self.member_state)
            if steps is None
            else steps.kept
        )
        q, out = np.zeros((len(places), len(model.q0))), np.zeros((2, len(places), len(model.mass)))
        lam = np.zeros((len(places), self._multipliers))
        seen = np.zeros((*who.shape, SEEN))
        self.entry.sample_responses(
            self.entry.TAG, *packed, self.method.tables, limits, count, room, room_ints, member_state, exact, rates, js,
            who, places, q, out, lam, seen, self.work,
        )  # fmt: skip
        return (q, out), lam, seen

    def values_at(
        self, js: IndexArray, places: FloatArray, count: int, exact: bool = False, who: IndexArray | None = None
    ) -> FloatArray:
        """(K, R): values of responses js (R,), each in its unit, at places (K, 2), steps and fractions of them.

        count, exact: as of `sample_response`. who (K, R): the members whose forces are meant; None: at each place the
        one with the largest.
        """
        whose = np.full((len(places), len(js)), -1) if who is None else who
        seen = np.zeros((*whose.shape, SEEN))
        self.entry.sample_responses(
            *self._history_arguments(count), exact, False, js, whose, places, *self._no_states, seen, self.work
        )
        values: FloatArray = seen[:, :, 0]
        return values

    @property
    def _multipliers(self) -> int:
        """How many multipliers `sample_responses` gives: of the solved rows and of the driven coordinates."""
        return int(self.scene.model.size[0]) + len(self.scene.model.driven)

    def evaluate_one(self, j: int, count: int, place: FloatArray, who: int = -1) -> FloatArray:
        """(3,) value, rate, member of response j at one place (2,), exactly; who: as of `sample_response`. The array is
        the driver's own: the next call overwrites it."""
        js, whose, places, q, out, lam, seen = self._one
        js[0], whose[0], places[0] = j, who, place
        self.ready(
            "sample_responses", self.entry.sample_responses, *self._history_arguments(count), True, True, js, whose,
            places, q, out, lam, seen, self.work,
        )  # fmt: skip
        found: FloatArray = seen[0, 0]
        return found

    def steps_arguments(self, count: int) -> tuple[Any, ...]:
        """The first arguments of every entry that differentiates."""
        return self.entry.TAG, self.ints, self.floats, self.method.tables, self._alpha, self.limits, count

    def _integral_with_gradient(self, j: int, integral: int, count: int, gradient: bool, out: FloatArray) -> float:
        """The integral of response j (2: of its square), and on demand its gradient into out (N + P,)."""
        arguments = self._integral_arguments(j, integral, count, gradient)
        total: float = self.ready("integral_with_gradient", self.entry.integral_with_gradient, *arguments)
        if gradient:
            out[:] = self._integral_gradient
            if self.start is not None:
                if j in self.start.since:
                    self.start_vjp += self.start.since.integral_cotangent(j, integral, count)
                self.start.vjp(self.start_vjp, out)
        return total

    def _integral_arguments(self, j: int, integral: int, count: int, gradient: bool) -> tuple[Any, ...]:
        """All arguments of `integral_with_gradient`."""
        return (
            *self.steps_arguments(count), j, integral, gradient, self.room, self.room_ints, self.member_state,
            self.padded, self._integral_gradient, self.start_vjp, self.work,
        )  # fmt: skip

    def start_from(self, q: FloatArray, response_par: FloatArray | None = None) -> None:
        """Take other positions q (n_q,) at the start, and other numbers of responses; None: those of the scene."""
        numbers = self.scene.model.response_par if response_par is None else response_par
        self._model = self._model._replace(response_par=numbers)
        self._packed = self.ints, self.floats = self.pack(self._model._replace(q0=q))

    def start_slopes(self) -> FloatArray:
        """(M_padded + P, n): derivatives of the start's positions by alpha^mu and values; no rows where it is as
        stated."""
        return self._no_slopes if self.start is None else self.start.slopes()

    def settle(self, design: FloatArray) -> bool:
        """Take a design (`take`) and move the start to its equilibrium where the case asks for it; False where there is
        none nearby."""
        self.take(design)
        return self.start is None or self.start.move()

    def compile_steps(self) -> None:
        """Compile what makes steps, without making any."""
        self.entry.simulate.compile(*self._simulate_arguments(True))

    def compile_responses(self) -> None:
        """Compile what evaluates responses and gradients from steps, without any steps.

        A process that does so beside one that compiles the steps takes half of the work from it.
        """
        entry, reductions = self.entry, self.scene.reductions
        if self._plain_rows:
            entry.rows_with_gradients.compile(*self._plain_arguments(0, 0.0))
            return
        if not all(reduction.is_integral for reduction in reductions):
            self.row_gradients.compile()
        if any(reduction.is_largest for reduction in reductions):
            entry.peaks_of_steps.compile(*self._history_arguments(0), 0, True, True, 0.0, self._rows_of[0], self.work)
        if any(reduction.is_integral for reduction in reductions):
            entry.integral_with_gradient.compile(*self._integral_arguments(0, 1, 0, True))

    def compile_method(self, method: str) -> None:
        """Compile what a method of differentiation calls beside that, without any steps."""
        from mdstopo.general.driver import methods

        methods.compile_method(self, method)

    def _history_arguments(self, count: int) -> tuple[Any, ...]:
        """The arguments with which every entry begins that reads the history of steps."""
        return (
            self.entry.TAG, self.ints, self.floats, self.method.tables, self.limits, count, self.room, self.room_ints,
            self.member_state,
        )  # fmt: skip

    def _simulate_arguments(self, tangent: bool) -> tuple[Any, ...]:
        """The arguments of the entry that makes steps; `tangent` stands at `TANGENT_AT`."""
        return (
            self.ints, self.floats, self.method.tables, self._alpha, tangent, self.settings, self.limits, self.room,
            self.room_ints, self.member_state, self.work, self.where,
        )  # fmt: skip

    def run(
        self, alpha: FloatArray, tangent: bool, quadrature_breakpoints: Sequence[float] = ()
    ) -> tuple[int, int, float]:
        """Simulate a design (as of `take`) into the driver's own arrays. Returns code, number of steps, time
        reached.

        quadrature_breakpoints: times at which steps are to end, beside those of the model.
        """
        if not self.settle(alpha) and self.start is not None:
            self.room[0], self._message = self.scene.model.times[0], self.start.message
            return UNSETTLED, 0, float(self.room[0])
        self.ints, self.floats = (
            self.pack(landed(self.with_start(), quadrature_breakpoints)) if quadrature_breakpoints else self._packed
        )
        if tangent and self.limits[KEPT] == NOTHING:
            self._make_first_room()
        while True:
            self.work.fill(0)
            code, count, self.events, time = self.ready.often(
                "simulate", self.entry.simulate, (self.floats,), ((TANGENT_AT, tangent),),
                lambda: self._simulate_arguments(tangent),
            )  # fmt: skip
            if code != NEEDS_ROOM:
                code, count, time = self._up_to_half_a_turn(code, count, time)
                self.count = count
                self._message = why_it_ended(self, code, time)
                return code, count, time
            if not self._grow(tangent):
                self._message = self._full(count, time)
                return STEP_LIMIT, count, time

    def _up_to_half_a_turn(self, code: int, count: int, time: float) -> tuple[int, int, float]:
        """How a run ended, or that a bushing turned too far before: code, number of steps, time reached."""
        if not self.case.bushings:
            return code, count, time
        t, q, _ = self.states()
        model = self.scene.model
        found = dimension_of(self.case).half_turn(model.pair[model.bushing_pair], model.home, q[: count + 1])
        if found is None:
            return code, count, time
        state, self.where[0] = found
        return HALF_TURN, max(state - 1, 0), float(t[state])

    def met(self, count: int) -> int:
        """A member (padded) whose ends meet under force within the steps of the last run, or -1."""
        return int(self.where[1])

    def rate_at_start(self) -> float:
        """Fastest vibration at the start, rad/s, with the design of the last run."""
        return float(self.start_modes(self._design).frequencies.max(initial=0.0))

    def start_modes(self, alpha: FloatArray) -> Modes:
        """Small motion about the start."""
        from mdstopo.general.at_rest.vibration import start_modes

        return start_modes(self, alpha)

    def settled(self, alpha: FloatArray) -> Settled | None:
        """How far the start moves to be at rest with a design; None where the case does not settle, or cannot."""
        return self.start.settled if self.start is not None and self.settle(alpha) else None

    def differentiate(self, method: str, alpha: FloatArray, result: ResponseResult, cones: bool) -> Differentiated:
        """Gradients of what `evaluate` found, by a method that is no part of it; cones: tell `across`, too."""
        from mdstopo.general.driver.methods import differentiate

        tell = cones and SENSITIVITIES[method].tells_norms and self._is_planar
        across = np.zeros_like(result.gradients) if tell else None
        gradients, message = differentiate(self, method, alpha, result, across)
        return Differentiated(Status.OK, message, gradients, across)

    def histories(self, alpha: FloatArray, j: int) -> tuple[Status, FloatArray, FloatArray]:
        """Times (T,) of the steps and the derivative (T, N) of response j at them, by `direct`."""
        from mdstopo.general.driver.methods import histories

        return histories(self, alpha, j)

    def response_history(self, alpha: FloatArray, times: FloatArray) -> FloatArray:
        """(n_resp, T): every response of a design at times (T,), which its motion reaches."""
        _, count, _ = self.run(alpha, False)
        places = self.places_at(times, count)
        js = np.arange(len(self.scene.responses))
        who = np.full((len(places), len(js)), -1)
        values = self.sample_responses(js, places, who, True, count, rates=False)[2][:, :, 0]
        return np.ascontiguousarray(values.T)

    def places_at(self, times: FloatArray, count: int) -> FloatArray:
        """(T, 2): in which of the last run's steps, `count`, times (T,) are, and at what fraction of it."""
        t = self.states()[0][: count + 1]
        step = np.clip(np.searchsorted(t, times, side="right") - 1, 0, count - 1)
        return np.stack([step.astype(np.float64), (times - t[step]) / (t[step + 1] - t[step])], axis=1)

    @property
    def model_of_run(self) -> GeneralModel:
        """The model of the last evaluation, with the times at which its steps had to end."""
        more = self.quadrature_breakpoints
        return landed(self.with_start(), more) if more else self._model

    def pricing_states(self, factor: FloatArray) -> "PricingStates":
        """The states from which prices follow, of the rows of the last evaluation times factor (n_resp, R)."""
        from mdstopo.general.driver.general_pricing import pricing_states_of

        return pricing_states_of(self, factor)

    @property
    def times(self) -> FloatArray:
        """The times that the case gives: ends of segments, without those that steps land on for other reasons."""
        return self._model.times

    def explain(
        self, alpha: FloatArray, status: Status, time: float, q: FloatArray, v: FloatArray
    ) -> tuple[Status, str]:
        """The status of the last run, and who is to blame for it, in words."""
        return status, self._message

    def take(self, design: FloatArray) -> None:
        """Take a design: alpha (N,), and behind it the values of variables (P,), or none for the initial ones."""
        if self._placing is None:
            self._alpha[:] = design
        else:
            n = len(self._alpha)
            self._alpha[:] = design[:n]
            values = design[n:] if len(design) > n else self._placing.initial
            if not np.array_equal(values, self._values):
                self._values = values.copy()
                self._place()

    def _place(self) -> None:
        """The model at the present values of variables, packed."""
        q0, v0 = self._start
        model = self.scene.model._replace(q0=q0, v0=v0)
        self._model = model if self._placing is None or not len(self._values) else self._placing.at(model, self._values)
        self._packed = self.ints, self.floats = self.pack(self._model)

    def with_start(self) -> GeneralModel:
        """The model with the start state to which it was assembled or has settled."""
        q0, v0 = self.packed_start()
        return self._model._replace(q0=q0, v0=v0)

    def packed_start(self) -> tuple[FloatArray, FloatArray]:
        """Coordinates (n_q,) and velocities (n,) at the start, as kernels have them: copies."""
        model, floats = self.scene.model, self._packed[1]
        at_v = len(model.mass) + len(model.q0)
        return floats[len(model.mass) : at_v].copy(), floats[at_v : at_v + len(model.v0)].copy()

    def states(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Times, coordinates and velocities of all steps, as views of the driver's arrays, with unused entries behind
        them."""
        steps, model, room = int(self.limits[1]) + 1, self.scene.model, self.room
        at_v = steps + steps * len(model.q0)
        end = at_v + steps * len(model.v0)
        return room[:steps], room[steps:at_v].reshape(steps, -1), room[at_v:end].reshape(steps, -1)

    def index_of_steps(self) -> IndexArray:
        """(room for steps + 1, 4): what `StepHistory.index` has of every step, as a view of the driver's array, with
        unused entries behind them."""
        steps = int(self.limits[1]) + 1
        return self.room_ints[: 4 * steps].reshape(steps, 4)

    def member(self, padded: int) -> str:
        """A member (or contact) in words, from its place in the padded arrays."""
        return named_member(self, padded)

    def displacements(self, q: FloatArray) -> FloatArray:
        """(T, n_body, D): by how much bodies have moved and turned (m, rad) at q (T, n_q) since its first row."""
        bodies = self.scene.kinematics
        return bodies.differences(q, q[0]).reshape(len(q), -1, bodies.freedoms)

    def simulate(self, alpha: FloatArray) -> tuple[Status, GeneralSteps]:
        """Simulate alpha (N,); the steps come back in arrays of their own."""
        code, count, _ = self.run(alpha, False)
        return status_of(code), GeneralSteps(self, count)


def _scenes(case: Case) -> Mapping[str, GeneralScene]:
    if case.follows is not None:
        from mdstopo.general.scene.numbers_of_scene import refuse_other_places  # few cases have such

        refuse_other_places(case, lambda each, load_case: compile_general(each, load_case).model)
    return {load_case.name: compile_general(case, load_case) for load_case in case.load_cases}


def _candidates(
    scenes: Mapping[str, GeneralScene],
    places: Sequence[int],
    group: MemberGroup,
    homes: tuple[FloatArray, FloatArray],
    count: int | None,
) -> "GeneralCandidates":
    """The candidates of a priced group and its mirror images; the scenes tell nothing that their cases do not."""
    from mdstopo.general.driver.general_pricing import GeneralCandidates

    del scenes
    return GeneralCandidates(places, group, homes, count)


GENERAL = SceneFamily(_scenes, GeneralDriver, _candidates)
