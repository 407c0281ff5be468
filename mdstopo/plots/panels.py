"""Where the drawings of a picture are: as large as what they show needs, so that no room is left between them."""

from typing import Any

import numpy as np

from mdstopo.plots.scenery import Floats
from mdstopo.plots.window import scale_of

#: inches: left of a drawing, right of it (for the arrow of gravity), below it, above it
LEFT, RIGHT, BELOW, ABOVE = 0.6, 0.3, 0.4, 0.22
#: inches (2,): how wide and how high a drawing is at least, for its numbers and names
LEAST_SIZES = np.array([1.1, 0.7])


def fitted(box: tuple[Floats, Floats], most: Floats) -> Floats:
    """Inches (2,) of a drawing of a window (its lower left and upper right corner) that is no larger than `most`."""
    low, high = box
    inches = scale_of(low, high, most) / 72.0 * (high - low)
    return np.clip(inches, np.minimum(LEAST_SIZES, most), most)


def add_panel(figure: Any, x: float, y: float, inches: Floats) -> Any:
    """Axes of a size in inches (2,), with their lower left corner at x, y inches."""
    figure.set_layout_engine("none")
    wide, high = figure.get_size_inches()
    return figure.add_axes((x / wide, y / high, float(inches[0]) / wide, float(inches[1]) / high))
