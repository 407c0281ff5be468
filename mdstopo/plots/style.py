"""How pictures look: one column wide, colours that colour-blind readers can tell apart, units on the axes."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mdstopo.store.store_errors import StoreError

#: Okabe and Ito (2008)
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#8C7A00")
#: the same, as far from each other, on a dark ground
ON_DARK = ("#56B4E9", "#FF8C42", "#2EC4A0", "#E29BC4", "#F0B429", "#9AD1F5", "#E6E6E6", "#C9B400")
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
    "text.parse_math": False,  # names of files may have dollars
    "savefig.dpi": DPI,
}


_PAPER, _INK, _MIDDLE, _FAR = "#16181d", "#e8e8e8", "#9a9a9a", "#3a3d44"
_DARK: dict[str, Any] = {
    **dict.fromkeys(("figure.facecolor", "axes.facecolor", "savefig.facecolor"), _PAPER),
    **dict.fromkeys(("text.color", "axes.labelcolor", "xtick.color", "ytick.color", "axes.edgecolor"), _INK),
    "grid.color": _FAR,
}


def use_log_scale(axis: Any) -> None:
    """Give the values of an axis a logarithmic scale, with plain numbers: Matplotlib's own labels are formulas, which
    this style does not set."""
    axis.set_yscale("log")
    axis.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axis.yaxis.set_minor_formatter(lambda value, _: "")


def is_dark() -> bool:
    """Whether the style that is on draws on a dark ground."""
    matplotlib = sys.modules.get("matplotlib")  # what draws without it draws on a light ground
    return matplotlib is not None and bool(matplotlib.rcParams["figure.facecolor"] == _PAPER)


def colour(number: int) -> str:
    """The colour of a group, a body or a curve, on the ground that is drawn on."""
    chosen = ON_DARK if is_dark() else COLOURS
    return chosen[number % len(chosen)]


def ink(strength: str = "full") -> str:
    """The colour of what is neither a group nor a body: full, middle or faint."""
    light = {"full": "#222222", "middle": "#6A6A6A", "faint": "#BBBBBB"}
    return {"full": _INK, "middle": _MIDDLE, "faint": "#5a5d64"}[strength] if is_dark() else light[strength]


def difference() -> str:
    """The colour of what differs between two designs: none that a group, a body or ink has."""
    return "#B13CFF" if is_dark() else "#7A00C8"


def paper() -> str:
    """The colour of the background."""
    return _PAPER if is_dark() else "#FFFFFF"


@contextmanager
def styled(dark: bool = False) -> Iterator[Any]:
    """Matplotlib's figure module, with the style on. Raises StoreError where matplotlib is not installed."""
    try:
        import matplotlib
    except ImportError as error:
        raise StoreError("pictures need matplotlib: pip install 'mdstopo[plot]'") from error
    settings: Any = _SETTINGS | (_DARK if dark else {})
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
