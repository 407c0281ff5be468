"""What the parts of a driver of a general scene ask of it (`driver.general_driver.GeneralDriver`)."""

from typing import Any, Protocol

from mdstopo.case.model import Case
from mdstopo.general.scene.compile_general import GeneralScene
from mdstopo.integrators.scene_driver import Method
from mdstopo.scene.springs_model import FloatArray, IndexArray


class DriverWithRun(Protocol):
    """A driver that has made a run: its scene, the arrays that its entries take, and its responses over the run.

    entry: the compiled entries. ints, floats: the packed scene. settings, work: as of `scene_driver.SceneDriver`.
    limits, room, room_ints: the history of steps (`carve_history`). member_state, padded: of the members. times: those
    that the case gives; quadrature_breakpoints: further ones at which steps had to end. steps_are_fine: whether no step
    is as long as a vibration.
    """

    @property
    def case(self) -> Case: ...
    @property
    def scene(self) -> GeneralScene: ...
    @property
    def method(self) -> Method: ...
    @property
    def entry(self) -> Any: ...
    @property
    def ints(self) -> IndexArray: ...
    @property
    def floats(self) -> FloatArray: ...
    @property
    def settings(self) -> FloatArray: ...
    @property
    def limits(self) -> IndexArray: ...
    @property
    def room(self) -> FloatArray: ...
    @property
    def room_ints(self) -> IndexArray: ...
    @property
    def member_state(self) -> FloatArray: ...
    @property
    def padded(self) -> FloatArray: ...
    @property
    def work(self) -> IndexArray: ...
    @property
    def times(self) -> FloatArray: ...
    @property
    def quadrature_breakpoints(self) -> list[float]: ...
    @property
    def steps_are_fine(self) -> bool: ...

    def states(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Times, coordinates and velocities of all steps, with unused entries behind them."""

    def index_of_steps(self) -> IndexArray:
        """(room for steps + 1, 4): what `StepHistory.index` has of every step, with unused entries behind them."""

    def evaluate_one(self, j: int, count: int, place: FloatArray, who: int = -1) -> FloatArray:
        """(3,) value, rate, member of response j at one place (2,), exactly, of a run of so many steps; overwritten by
        the next call. who: the member whose force is meant."""

    def sample_response(
        self, j: int, places: FloatArray, exact: bool, count: int, *, who: int = -1, rates: bool = True
    ) -> tuple[tuple[FloatArray, FloatArray], FloatArray, FloatArray]:
        """States, multipliers and response j at places (K, 2) of a run of so many steps.

        j, count: the response, and the number of steps. places (K, 2): steps and fractions of them. exact: whether
        states inside steps are the integrator's own. who: the member whose force is meant. rates: whether rates are
        wanted.
        """

    def values_at(
        self, js: IndexArray, places: FloatArray, count: int, exact: bool = False, who: IndexArray | None = None
    ) -> FloatArray:
        """(K, R): values of responses js (R,) at places (K, 2), as of `sample_response`; who (K, R): the members whose
        forces are meant, by default at each place the one with the largest."""

    def peaks_of_pieces(
        self,
        j: int,
        count: int,
        t: FloatArray,
        seen: FloatArray,
        sign: float,
        window: float,
        pieces: FloatArray = ...,
        who: int = -1,
        plain: IndexArray | None = None,
    ) -> FloatArray:
        """The peaks (K, COLUMNS) of a response in sampled pieces of steps.

        j, count, t, seen, sign, window, pieces, who, plain: as of `GeneralDriver.peaks_of_pieces`.
        """


class DriverWithStart(DriverWithRun, Protocol):
    """A driver whose motion can be started from other coordinates than the case's.

    alpha (N,), values (P,): the design that was last taken.
    """

    @property
    def alpha(self) -> FloatArray: ...
    @property
    def values(self) -> FloatArray: ...

    def take(self, design: FloatArray) -> None:
        """Take a design (N + P,)."""

    def settle(self, design: FloatArray) -> bool:
        """Take a design, and start at its equilibrium where the case asks for it; False where there is none."""

    def packed_start(self) -> tuple[FloatArray, FloatArray]:
        """Coordinates (n_q,) and velocities (n,) at the start: copies."""

    def start_from(self, q: FloatArray, response_par: FloatArray | None = None) -> None:
        """Start at q (n_q,), and take other numbers of responses."""
