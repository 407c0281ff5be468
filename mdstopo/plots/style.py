"""How pictures look: one column wide, colours that colour-blind readers can tell apart, units on the axes."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mdstopo.store.store_errors import StoreError

#: Okabe and Ito (2008)
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#8C7A00")
#: beside the colours, for print without them
DASHES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (1, 1)), (0, (8, 2)), (0, (3, 1)))
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
#: groups of members up to which a legend names each; a finalised design has as many groups as members
MOST_NAMED = 12
#: inches: one column of a page, and its usual height
WIDTH, HEIGHT = 3.5, 2.6
FORMATS = (".png", ".svg", ".pdf")
DPI = 300

_SETTINGS: dict[str, Any] = {
    "font.size": 8.0,
    "axes.titlesize": 8.0,
    "axes.labelsize": 8.0,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "legend.fontsize": 7.0,
    "legend.frameon": False,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.1,
    "lines.markersize": 3.5,
    "axes.grid": True,
    "grid.linewidth": 0.3,
    "grid.color": "#CCCCCC",
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "figure.constrained_layout.use": True,
    "svg.hashsalt": "mdstopo",
    "svg.fonttype": "none",
    "savefig.dpi": DPI,
}


@contextmanager
def styled() -> Iterator[Any]:
    """Matplotlib's figure module, with the style on. Raises StoreError where matplotlib is not installed."""
    try:
        import matplotlib
    except ImportError as error:
        raise StoreError("pictures need matplotlib: pip install 'mdstopo[plot]'") from error
    settings: Any = _SETTINGS
    with matplotlib.rc_context(settings):
        from matplotlib import figure

        yield figure


def new_figure(module: Any, rows: int = 1, height: float = HEIGHT, width: float = WIDTH) -> tuple[Any, list[Any]]:
    """A figure with so many axes below each other that share their x axis."""
    figure = module.Figure(figsize=(width, height if rows == 1 else 0.62 * height * rows))
    axes = figure.subplots(rows, 1, sharex=True, squeeze=False)
    return figure, [row[0] for row in axes]


def save(figure: Any, path: Path) -> None:
    """Write a picture as its name says. Raises StoreError for another kind of name, and for a full disk."""
    if path.suffix.lower() not in FORMATS:
        raise StoreError(f"{path}: a picture ends in {', '.join(FORMATS)}")
    metadata = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(path.suffix.lower())
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, metadata=metadata)
    except OSError as error:
        raise StoreError(f"{path}: cannot be written: {error.strerror}") from error
