"""Loads and motions that are formulas of time, as arrays of a general scene, and the times at which they have kinks.

A kink or a jump of a formula is where a margin of it vanishes (`formula.smooth_modes`); there segments end, as at a row
of a table, and in each segment the formula is the smooth one of the sides on which its switches are in the middle.
"""

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np

from mdstopo.case.arrays import TimeFormula
from mdstopo.case.model import GROUND, Case, LoadCase
from mdstopo.case.text.errors import CaseError, Mistake
from mdstopo.compiler.formulas import FormulaCalls, address_of
from mdstopo.formula.time_formulas import MARGIN, VALUE
from mdstopo.general.responses.sampled_roots import roots_on_grid
from mdstopo.mechanics.kinematics.timed import ADDRESS, OFFSET, SCALE, TURNS, WIDTH
from mdstopo.scene.signal_segments import formulas_of, signals_of
from mdstopo.scene.springs_model import FloatArray, IndexArray

#: parts of the simulated time in which a kink is looked for
PARTS = 2048


class TimedPart(NamedTuple):
    """One component of a load that is a formula of time: its kind, as `load_follows`, its direction and point of
    attack."""

    signal: TimeFormula
    kind: int
    follows: int
    direction: tuple[float, ...]
    arm: tuple[float, ...]


class Timed(NamedTuple):
    """The fields of a `GeneralModel` for loads that are formulas of time."""

    timed_load: IndexArray
    timed_arm: FloatArray
    timed_par: FloatArray
    timed_mode: IndexArray


class _Called:
    """A formula's machine code, called from Python."""

    def __init__(self, formula: TimeFormula) -> None:
        self.row = row_of_formula(formula)
        self.switches = formula.program.switches
        self._calls = FormulaCalls(self.row[ADDRESS], self.row)

    def group(self, group: int, time: float, mode: int) -> list[float]:
        """The numbers of a group."""
        return self._calls.numbers(0.0, 0.0, time, 0.0, mode, group)

    def margins(self, time: float, switches: int) -> tuple[list[list[float]], int]:
        """Margins of the first so many switches with their rates, and their bits, on which later ones depend."""
        found, mode = [], 0
        for switch in range(switches):
            margin, rate, *_ = self.group(MARGIN + switch, time, mode)
            found.append([margin, rate])
            if margin >= 0.0:
                mode |= 1 << switch
        return found, mode

    def mode(self, time: float) -> int:
        """Bits of all switches."""
        return self.margins(time, self.switches)[1]

    def at(self, time: float) -> tuple[list[list[float]], float]:
        """Margins of all switches with their rates, and the value of the formula."""
        margins, mode = self.margins(time, self.switches)
        return margins, self.group(VALUE, time, mode)[0]


def row_of_formula(formula: TimeFormula) -> FloatArray:
    """(WIDTH,): the parameters, the machine code, factor and summand of a formula (`kinematics.timed`)."""
    row = np.zeros(WIDTH)
    values = [value for _, value in formula.parameters]
    assert len(values) <= ADDRESS
    row[: len(values)] = values
    row[ADDRESS], row[SCALE], row[OFFSET] = float(address_of(formula.program.groups)), formula.scale, formula.offset
    return row


def modes(formula: TimeFormula, times: FloatArray) -> IndexArray:
    """(n_seg,): bits of a formula's switches in segments with these ends (s)."""
    called = _Called(formula)
    return np.array([called.mode(time) for time in (0.5 * (times[:-1] + times[1:])).tolist()], dtype=np.int64)


def at_ends(formula: TimeFormula, times: FloatArray) -> FloatArray:
    """(n_seg, 2, 2): value and rate of a formula at both ends of segments, on their side."""
    called = _Called(formula)
    out = np.empty((len(times) - 1, 2, 2))
    for k, mode in enumerate(modes(formula, times).tolist()):
        for end in range(2):
            value, rate, *_ = called.group(VALUE, float(times[k + end]), mode)
            out[k, end] = called.row[SCALE] * value + called.row[OFFSET], called.row[SCALE] * rate
    return out


def kink_times(case: Case, load_case: LoadCase) -> list[float]:
    """Times at which formulas of a load case have kinks or jumps. CaseError where one has no value at some time."""
    found: list[float] = []
    grid = np.linspace(load_case.start, load_case.end, PARTS + 1)
    for formula in formulas_of(load_case):
        called = _Called(formula)
        margins, values = zip(*(called.at(time) for time in grid.tolist()), strict=True)
        found += _kinks(called, grid, np.array(margins))
        missing = ~np.isfinite(values)
        if missing.any():
            section = "loads" if _is_load(load_case, formula) else "motions"
            message = f"the expression {formula.text} has no value at t = {grid[missing.argmax()]:.6g} s"
            raise CaseError([mistake_of(case, load_case, section, message)], str(case.path or case.name))
    return found


def mistake_of(case: Case, load_case: LoadCase, section: str, message: str) -> Mistake:
    """A mistake of the loads or the motions of a load case, its own ones where it states such."""
    own = f"load_cases.{load_case.name}.{section}"
    return case.marks.mistake(own if own in case.marks else section, message)


def _is_load(load_case: LoadCase, formula: TimeFormula) -> bool:
    return any(signal is formula for load in load_case.loads for signal in signals_of(load))


def _kinks(called: _Called, grid: FloatArray, margins: FloatArray) -> Iterator[float]:
    """Where margins vanish between times of a grid (K,); margins (K, switches, 2): there, with their rates."""
    for switch in range(called.switches):

        def exact(times: FloatArray, switch: int = switch) -> FloatArray:
            return np.array([called.margins(time, switch + 1)[0][switch][0] for time in times.tolist()])

        yield from roots_on_grid(grid, margins[:, switch, 0], margins[:, switch, 1], exact)


def timed_loads(parts: Iterable[tuple[int, TimedPart]], times: FloatArray) -> Timed:
    """The arrays of loads that are formulas.

    parts: of each the body's place in the state. times (n_seg + 1,): ends of the segments (s).
    """
    whole = list(parts)
    arms = np.zeros((len(whole), 6))
    for row, (_, part) in zip(arms, whole, strict=True):
        row[: len(part.direction)], row[3 : 3 + len(part.arm)] = part.direction, part.arm
    sides: list[Any] = [modes(part.signal, times) for _, part in whole]
    return Timed(
        np.array([[body, part.kind, part.follows] for body, part in whole], dtype=np.int64).reshape(-1, TURNS + 1),
        arms,
        np.array([row_of_formula(part.signal) for _, part in whole]).reshape(-1, WIDTH),
        np.array(sides, dtype=np.int64).reshape(len(whole), len(times) - 1).T.copy(),
    )


def parts_of(load_case: LoadCase, of_load: Any, index: dict[str, int]) -> list[tuple[int, TimedPart]]:
    """The formulas of all loads with their bodies. of_load (load): those of one."""
    loads = [load for load in load_case.loads if load.body != GROUND]
    return [(index[load.body], part) for load in loads for part in of_load(load)]
