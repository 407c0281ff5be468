"""From Python to `row_sweep`: the gradients of all rows that a driver has found, in one call."""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mdstopo.general.responses.extremes import COLUMNS, FRACTION, SIGN, STEP, parts
from mdstopo.scene.springs_model import FloatArray, IndexArray

if TYPE_CHECKING:
    from mdstopo.general.driver.general_driver import GeneralDriver

#: rows times members of one reverse sweep at most, for the memory they take
BLOCK = 2**23
#: the arrays of a call are kept for the next one if it has at most so many rows
KEPT = 32


class Block(NamedTuple):
    """Rows of one reverse sweep: what `row_sweep.rows_vjp` takes, by its names."""

    which: IndexArray
    rows: FloatArray
    padded: FloatArray
    out: FloatArray
    starts: FloatArray


class WantedRow(NamedTuple):
    """A row of which a derivative is wanted, or one part of its derivative.

    response, row: numbers of what it belongs to. is_across: 1 where the component across a norm's vector is meant, else
    0. share: of the derivative of that. at (COLUMNS,): the row that is differentiated (`extremes`).
    """

    response: int
    row: int
    is_across: int
    share: float
    at: FloatArray


def wanted_rows(driver: "GeneralDriver", across: bool) -> list[WantedRow]:
    """All that the derivatives of the rows that a driver has found are put together from, the latest first; without
    integrals, but for what jumps in them. across: what is across of norms, too."""
    wanted = [
        WantedRow(j, r, is_across, share, part)
        for j, reduction in enumerate(driver.scene.reductions)
        if not reduction.is_integral
        for r in range(driver.row_counts.item(j))
        for share, part in parts(driver.rows[j, r])
        for is_across in range(2 if across and driver.shapes[j] == "norm" else 1)
    ]
    wanted += [WantedRow(j, 0, 0, factor, row) for j, rows in driver.jumps.items() for factor, row in rows]
    if len(wanted) > 1:
        wanted.sort(key=lambda row: (-row.at.item(STEP), -row.at.item(FRACTION)))
    return wanted


def sign_of(driver: "GeneralDriver", j: int, r: int) -> float:
    """The sign of the derivative of response j in that of row r: -1 where a magnitude is that of a negative value."""
    return driver.rows.item(j, r, SIGN) if driver.scene.reductions[j].is_magnitude else 1.0


class RowGradients:
    """The gradients of the rows of one driver, by reverse sweeps through its last motion of many rows at once."""

    def __init__(self, driver: "GeneralDriver") -> None:
        self._driver = driver
        self._blocks: dict[int, Block] = {}

    def __call__(self, count: int, across: FloatArray | None) -> None:
        """Fill the driver's `gradients`, for a motion of so many steps; what is across of norms, too, where there is an
        array for it."""
        driver = self._driver
        wanted = wanted_rows(driver, across is not None)
        begun: set[tuple[int, int]] = set()  # the rows that have a part of their derivative
        most = max(1, BLOCK // max(1, len(driver.padded)))
        for first in range(0, len(wanted), most):
            part = wanted[first : first + most]
            block = self.block(len(part))
            for m, (j, _, is_across, _, row) in enumerate(part):
                block.which[m] = j, is_across
                block.rows[m] = row
            driver.ready(f"pull_rows {len(part)}", driver.entry.rows_vjp, *self._arguments(count, block))
            for (j, r, is_across, share, row), own, start in zip(part, block.out, block.starts, strict=True):
                if driver.start is not None:
                    if j in driver.start.since:
                        start += driver.start.since.row_cotangent(j, row, bool(is_across), count)
                    driver.start.vjp(start, own)
                if is_across and across is not None:
                    across[j, r] += share * own
                elif (j, r) in begun or driver.scene.reductions[j].is_integral:
                    driver.gradients[j, r] += sign_of(driver, j, r) * share * own
                else:
                    np.multiply(own, sign_of(driver, j, r) * share, out=driver.gradients[j, r])
                    begun.add((j, r))
        for j, reduction in enumerate(driver.scene.reductions):
            if not reduction.is_integral:
                for r in range(driver.row_counts.item(j)):
                    if (j, r) not in begun:  # it has no parts
                        driver.gradients[j, r] = 0.0

    def compile(self) -> None:
        """Compile what computes the gradients, without computing any."""
        self._driver.entry.rows_vjp.compile(*self._arguments(0, self.block(1)))

    def _arguments(self, count: int, block: Block) -> tuple[Any, ...]:
        """What the compiled sweep takes."""
        driver = self._driver
        return (
            *driver.steps_arguments(count), block.which, block.rows, driver.room, driver.room_ints,
            driver.member_state, block.padded, block.out, block.starts, driver.work,
        )  # fmt: skip

    def block(self, count: int) -> Block:
        """Arrays for so many rows at once; those of few rows are kept."""
        if count in self._blocks:
            return self._blocks[count]
        driver = self._driver
        block = Block(
            np.zeros((count, 2), dtype=np.int64),
            np.zeros((count, COLUMNS)),
            np.zeros((count, len(driver.padded))),
            np.zeros((count, driver.gradients.shape[2])),
            np.zeros((count, len(driver.start_vjp))),
        )
        if count <= KEPT:
            self._blocks[count] = block
        return block
