"""What the driver calls of the diagonally implicit method for general scenes."""

from mdstopo.general.dense_output import compare, sample_response
from mdstopo.general.direct import follow, push
from mdstopo.general.esdirk import TAG, simulate
from mdstopo.general.integral_gradients import integral_with_gradient
from mdstopo.general.peak_gradients import peaks_vjp
from mdstopo.general.peak_search import peaks_of_pieces, peaks_of_steps, rank_rows
from mdstopo.general.row_sweep import rows_vjp

__all__ = [
    "TAG", "compare", "follow", "integral_with_gradient", "peaks_of_pieces", "peaks_of_steps", "peaks_vjp", "push",
    "rank_rows", "rows_vjp", "sample_response", "simulate",
]  # fmt: skip
