"""The design that is being evaluated: one array that everything reads, checked and weighed in one pass."""

from collections.abc import Callable
from typing import Any

import numpy as np

from mdstopo.case.arrays import FloatArray
from mdstopo.case.model import Case, VolumeRow
from mdstopo.compiler.jit import vector_entry
from mdstopo.scene.moving_volumes import moving_volumes


class Design:
    """The numbers of the design that is being evaluated; the arrays stay, and the next design overwrites them.

    Drivers compute in `values`, and put designs of their own there (trajectories, the default step): so every
    evaluation begins with `take`.

    values (N + P,): alpha, then the values of the case's variables. rows (n_con, N + P): coefficients of the volume
    rows, zeros in those of other constraints. excess (n_con,): rows values - bounds. Where members cost a length that
    varies, a row is the derivative of their sum at the design instead. moving: whether there is such a row.
    """

    def __init__(self, case: Case) -> None:
        self._case = case
        n, length, count = case.n_design, case.space.length, len(case.constraints)
        self.values = np.zeros(length)
        self.rows = np.zeros((count, length))
        for i, row in enumerate(case.constraints):
            if isinstance(row, VolumeRow):
                self.rows[i, :n] = row.coefficients
                self.rows[i, n:] = row.prices if len(row.prices) else 0.0
        self.bounds = np.array([row.bound for row in case.constraints], dtype=np.float64)
        self.excess = np.zeros(count)
        self._volumes = moving_volumes(case)
        self.moving = bool(self._volumes)
        self._weigh: Callable[[], Any] | None = None

    def take(self, alpha: FloatArray) -> FloatArray:
        """`values`, after the numbers of a design have become the present ones; ValueError where it is none
        (`checked`)."""
        values = self.values
        given = np.asarray(alpha)
        values[:] = given if given.shape == values.shape else checked(self._case, given)
        if self._weigh is None:
            arguments = values, self._case.n_design, self.rows, self.bounds, self.excess
            self._weigh = weigh.prepare(*arguments)  # type: ignore[attr-defined]
        if self._weigh():
            checked(self._case, values)
        for i, volume in self._volumes.items():
            spent, self.rows[i] = volume.at(values)
            self.excess[i] = spent - self.bounds[i]
        return values


def checked(case: Case, alpha: FloatArray) -> FloatArray:
    """alpha as (N,) float64, with the values of variables (P,) behind it; ValueError where it is no design.

    That is where it is not finite, alpha is negative, or it has another length. Values that are left out are the
    initial ones.
    """
    design = case.whole(np.ascontiguousarray(alpha, dtype=np.float64))
    n = case.n_design
    if design.shape != (case.space.length,):
        raise ValueError(f"alpha must have shape ({n},), one value a design member, not {design.shape}")
    for name, part in case.space.parts.items():
        if not np.all(np.isfinite(design[part])):
            raise ValueError(f"values of variables must be finite; those of {name} are {design[part]}")
    wrong = np.flatnonzero(~((design[:n] >= 0.0) & (design[:n] < np.inf)))
    if len(wrong):
        raise ValueError(f"alpha must be finite and at least 0; alpha[{wrong[0]}] is {design[wrong[0]]}")
    return design


@vector_entry
def weigh(design, n, rows, bounds, excess):
    """excess (n_con,) = rows design - bounds; returns how many of the n first are negative or any not finite."""
    wrong = 0
    for i in range(n):
        wrong += not ((design[i] >= 0.0) & (design[i] < np.inf))
    for i in range(n, design.shape[0]):
        wrong += not (abs(design[i]) < np.inf)
    for j in range(rows.shape[0]):
        row = rows[j]
        total = 0.0
        for i in range(design.shape[0]):
            total += row[i] * design[i]
        excess[j] = total - bounds[j]
    return wrong
