"""The compiled entries of a method of integration for general scenes: its own `simulate`, and those of all methods.

The latter know a method by its tag (`method_interface`).
"""

from importlib import import_module
from typing import Any, NamedTuple

from mdstopo.case.methods.integrators import IntegratorKind
from mdstopo.general.peaks import dense_output, peak_search, rows_with_gradients
from mdstopo.general.sensitivity import direct, integral_gradients, row_sweep


class Entries(NamedTuple):
    """The compiled functions that a driver calls, and the tag of the method of integration."""

    TAG: tuple[int, ...]
    simulate: Any
    compare: Any = dense_output.compare
    follow: Any = direct.follow
    integral_with_gradient: Any = integral_gradients.integral_with_gradient
    peaks_of_pieces: Any = peak_search.peaks_of_pieces
    peaks_of_steps: Any = peak_search.peaks_of_steps
    rows_with_gradients: Any = rows_with_gradients.rows_with_gradients
    push: Any = direct.push
    rank_rows: Any = peak_search.rank_rows
    rows_vjp: Any = row_sweep.rows_vjp
    sample_responses: Any = dense_output.sample_responses


def entries_of(kind: IntegratorKind) -> Entries:
    """The compiled entries of a method of integration."""
    own: Any = import_module(kind.general)
    return Entries(own.TAG, own.simulate)
