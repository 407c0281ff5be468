"""The picture of the layers, docs/images/layers.svg: `python -m documentation.layers` draws it.

tests/layers/test_picture.py holds it to the code: every module has a box, and none stands above one that imports it.
"""

import sys
from dataclasses import dataclass
from html import escape
from pathlib import Path

IMAGE = Path(__file__).resolve().parent.parent / "docs" / "images" / "layers.svg"

#: sizes in pixels: the picture's width, the column of labels, a row, the gap between boxes, the
#: margin, the key below
WIDTH, LABELS, ROW, GAP, MARGIN, KEY = 900, 118, 58, 8, 12, 34
_FONT = "system-ui, -apple-system, 'Segoe UI', Helvetica, Arial, sans-serif"
_INK, _GREY, _BADGE = "#1f2a30", "#5b6a72", "#D55E00"
#: fills: of what both chains use, of springs between free bodies, of everything else
_COMMON, _SPRINGS, _GENERAL = "#e8eef1", "#d5ebe3", "#f5e2ee"


@dataclass(frozen=True)
class Box:
    """Modules in one box: their names, what they do, and the station of alpha there.

    left, width: of the row, as shares; rows: how many it spans.
    """

    names: tuple[str, ...]
    what: str
    left: float = 0.0
    width: float = 1.0
    station: str = ""
    fill: str = _COMMON
    rows: int = 1


#: from top to bottom: the label of a row, and its boxes
ROWS: tuple[tuple[str, tuple[Box, ...]], ...] = (
    (
        "faces",
        (
            Box(("cli", "__main__"), "the commands", 0.0, 0.165),
            Box(("stress", "bench"), "tests and times", 0.165, 0.175),
            Box(("report",), "HTML page", 0.34, 0.135, "8"),
            Box(("plots",), "pictures", 0.475, 0.095),
            Box(("api", "functions", "jax", "torch", "openmdao"), "four calls; in other frameworks", 0.57, 0.43),
        ),
    ),
    (
        "many runs",
        (
            Box(("finalize",), "few members, sized anew", 0.0, 0.26),
            Box(("limiting",), "bounds over all members", 0.26, 0.26),
            Box(("fit",), "numbers from tests", 0.52, 0.24),
            Box(("front",), "fronts and sweeps", 0.76, 0.24),
        ),
    ),
    (
        "a run",
        (
            Box(("session",), "start, iterate, save, resume; stages", 0.0, 0.5),
            Box(("plan",), "what a front has to solve, in rounds", 0.5, 0.5),
        ),
    ),
    (
        "uncertainty",
        (
            Box(("evaluators",), "which evaluator a case needs", 0.0, 0.4),
            Box(("robust",), "samples, measures over them", 0.4, 0.6),
        ),
    ),
    ("a start", (Box(("starts",), "one start of the optimiser: kernels ready, where it begins, which go on"),)),
    (
        "an evaluation",
        (
            Box(("compile_responses",), "run in another process", 0.0, 0.3),
            Box(("engine",), "the evaluator of a case", 0.3, 0.4),
            Box(("warm",), "the first compilation", 0.7, 0.3),
        ),
    ),
    (
        "",
        (
            Box(("design_problem",), "a case as the optimiser sees it", 0.0, 0.37, "5"),
            Box(("error_estimate", "coarse"), "how far off it is", 0.37, 0.29),
            Box(
                ("general",),
                "the same three once more: joints, motions, contacts, any law, any response",
                0.66,
                0.34,
                "2 3 4",
                _GENERAL,
                4,
            ),
        ),
    ),
    ("gradients", (Box(("sensitivity",), "adjoint, prices of candidates", 0.0, 0.66, "4", _SPRINGS),)),
    ("objectives", (Box(("responses",), "energy, peaks, points of bodies", 0.0, 0.66, "4", _SPRINGS),)),
    ("motion", (Box(("integrators",), "gauss, runge_kutta, generalized_alpha", 0.0, 0.66, "3", _SPRINGS),)),
    ("forces", (Box(("mechanics",), "relative poses, laws of members, joints, sums over members"),)),
    ("arrays", (Box(("scene",), "a load case as arrays", station="2"),)),
    (
        "results",
        (
            Box(("store",), "the file: written whole, sealed, read back", 0.0, 0.55, "7"),
            Box(("workers",), "the worker pool", 0.55, 0.45),
        ),
    ),
    ("optimiser", (Box(("optimizer",), "GSAO and the bundle method; knows no mechanics", station="6"),)),
    ("case", (Box(("case",), "the format: keys, mistakes with their places, immutable objects", station="1"),)),
    (
        "compiler",
        (Box(("compiler",), "marks what is compiled; machine code: made, kept, called without Numba"),),
    ),
    (
        "records",
        (
            Box(("evaluation",), "what comes back", 0.0, 0.19),
            Box(("formula",), "expressions in cases", 0.19, 0.2),
            Box(("settings",), "the optimiser's options", 0.39, 0.22),
            Box(("status", "shown", "children", "installed", "_version"), "", 0.61, 0.39),
        ),
    ),
)


def drawn() -> str:
    """The picture as SVG."""
    height = 2 * MARGIN + len(ROWS) * ROW + KEY
    size = f'viewBox="0 0 {WIDTH} {height}" width="{WIDTH}"'
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="{_FONT}">',
        f'<rect width="{WIDTH}" height="{height}" rx="8" fill="white"/>',
    ]
    for k, (label, boxes) in enumerate(ROWS):
        top = MARGIN + k * ROW
        parts.append(_text(label, MARGIN, top + ROW / 2 + 4, 13, _GREY))
        for box in boxes:
            parts += _box(box, top)
    return "\n".join([*parts, *_key(height - KEY), "</svg>", ""])


def _key(top: float) -> list[str]:
    """What colours and numbers mean."""
    parts, x, y = [], float(LABELS), top + KEY / 2
    for fill, what, width in (
        (_SPRINGS, "springs between free bodies", 210),
        (_GENERAL, "all other scenes", 145),
        (_BADGE, "stations of alpha", 140),
    ):
        parts.append(f'<rect x="{x:.0f}" y="{y - 7:.0f}" width="14" height="14" rx="3" fill="{fill}"/>')
        parts.append(_text(what, x + 20, y + 4.5, 12, _GREY))
        x += width
    return [*parts, _text("An import points downwards.", x, y + 4.5, 12, _GREY)]


def _box(box: Box, top: float) -> list[str]:
    room = WIDTH - LABELS - MARGIN
    x, width = LABELS + box.left * room, box.width * room - GAP
    height = box.rows * ROW - GAP
    y = top + GAP / 2
    parts = [f'<rect x="{x:.0f}" y="{y:.0f}" width="{width:.0f}" height="{height:.0f}" rx="5" fill="{box.fill}"/>']
    middle = y + height / 2
    if box.what:
        parts.append(_text(", ".join(box.names), x + 10, middle - 3, 15, _INK, bold=True))
        parts += [
            _text(line, x + 10, middle + 14 + 15 * i, 12, _GREY) for i, line in enumerate(_lines(box.what, width))
        ]
    else:
        parts.append(_text(", ".join(box.names), x + 10, middle + 5, 13, _INK))
    for i, station in enumerate(reversed(box.station.split())):
        cx = x + width - 18 - 26 * i
        parts.append(f'<circle cx="{cx:.0f}" cy="{y + 17:.0f}" r="11" fill="{_BADGE}"/>')
        parts.append(_text(station, cx, y + 21.5, 13, "white", bold=True, anchor="middle"))
    return parts


def _lines(text: str, width: float) -> list[str]:
    """Words in lines that fit a box."""
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if 6.2 * len(longer) > width - 16 and lines[-1]:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines


def _text(words: str, x: float, y: float, size: int, fill: str, *, bold: bool = False, anchor: str = "start") -> str:
    weight = ' font-weight="600"' if bold else ""
    place = f'x="{x:.0f}" y="{y:.1f}" font-size="{size}" fill="{fill}" text-anchor="{anchor}"{weight}'
    return f"<text {place}>{escape(words)}</text>"


def main() -> int:
    """Write the picture."""
    IMAGE.write_text(drawn(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
