"""Quantities over time in one."""

from __future__ import annotations

import re

import numpy as np

from mdstopo.case.arrays import FloatArray, Signal, Table, TimeFormula, VectorSignal
from mdstopo.case.keys.time_formula import why_unusable


class UnaddedSignalsError(Exception):
    """Signals that cannot be added: what they are, and what is allowed."""


def combined(matrix: FloatArray, signals: VectorSignal) -> VectorSignal:
    """The products of a matrix (m, n) with n signals: constants where all are, else tables of common times.

    Formulas where some are formulas. Raises UnaddedSignalsError where a formula and a table would have to be added, or
    formulas that come to one which is too large.
    """
    if any(isinstance(signal, TimeFormula) for signal in signals):
        return tuple(_summed(row, signals) for row in matrix.tolist())
    tables = [signal for signal in signals if isinstance(signal, Table)]
    if not tables:
        return tuple((matrix @ np.array(signals)).tolist())
    times = common_times(tables)
    values = np.stack([_sampled(signal, times) for signal in signals], axis=1) @ matrix.T
    return tuple(Table(times, values[:, i : i + 1]) for i in range(len(matrix)))


def _summed(factors: list[float], signals: VectorSignal) -> Signal:
    """The sum of some signals, of which one is a formula, times factors."""
    terms = [(factor, signal) for factor, signal in zip(factors, signals, strict=True) if factor != 0.0]
    if not any(isinstance(signal, TimeFormula) for _, signal in terms):
        return combined(np.array([factors]), tuple(0.0 if isinstance(s, TimeFormula) else s for s in signals))[0]
    if len(terms) == 1 and isinstance(terms[0][1], TimeFormula):
        return terms[0][1].times(terms[0][0])
    texts, parameters = [], dict[str, float]()
    for factor, signal in terms:
        if isinstance(signal, Table):
            raise UnaddedSignalsError("a formula and a table: state all as formulas, or none")
        if isinstance(signal, TimeFormula):
            text = _renamed(signal, parameters)
            texts.append(f"{factor * signal.scale!r}*({text}) + {factor * signal.offset!r}")
        else:
            texts.append(repr(factor * signal))
    formula = TimeFormula(" + ".join(f"({text})" for text in texts), tuple(parameters.items()))
    why = why_unusable(formula)
    if why:
        raise UnaddedSignalsError(f"formulas: {why}")
    return formula


def _renamed(formula: TimeFormula, parameters: dict[str, float]) -> str:
    """The text of a formula that is added to others; its parameters are put among theirs, under names still free."""
    own = dict(formula.parameters)
    names = {}
    for name, value in own.items():
        free = name
        while parameters.get(free, value) != value or (free != name and free in own):
            free += "_"
        parameters[free], names[name] = value, free
    return re.sub(r"\b[A-Za-z_]\w*", lambda word: names.get(word[0], word[0]), formula.text)


def common_times(tables: list[Table]) -> FloatArray:
    """The rows' times of all tables, a time twice where any of them jumps."""
    times = np.unique(np.concatenate([table.times for table in tables]))
    jumps = np.unique(np.concatenate([table.times[1:][np.diff(table.times) == 0.0] for table in tables]))
    return np.sort(np.concatenate([times, jumps]))


def _sampled(signal: Signal, times: FloatArray) -> FloatArray:
    """A signal at rising times; of a time that is there twice the limit from the left, then that from the right."""
    assert not isinstance(signal, TimeFormula)
    if not isinstance(signal, Table):
        return np.full(len(times), signal)
    t, x = signal.times, signal.values[:, 0]
    values = np.interp(times, t, x)
    before_twin = np.append(np.diff(times) == 0.0, False)
    first = np.minimum(np.searchsorted(t, times, side="left"), len(t) - 1)
    last = np.maximum(np.searchsorted(t, times, side="right") - 1, 0)
    row = np.where(before_twin, first, last)
    return np.where(t[row] == times, x[row], values)
