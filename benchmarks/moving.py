"""The README's picture: the paper's scene with all belts that could be, and in motion with those that are kept.

`python -m benchmarks.pictures moving` draws it. It is an SVG whose paths are animated, so that it stays small, needs no
script and moves in a page as an image does.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.scenes import CASES
from mdstopo import load_case, optimize, simulate
from mdstopo.plots.body_shapes import planar_shapes
from mdstopo.plots.scenery import PRESENT, ends_at, sizes, start_state
from mdstopo.plots.style import COLOURS
from mdstopo.scene.point_positions import points_at

Floats = NDArray[np.float64]

#: the window (m) that a panel shows, pixels of a metre, of what is above a panel and around it
LEFT, RIGHT, BOTTOM, TOP, SCALE, HEAD, MARGIN = -1.5, 1.15, -1.58, 0.95, 138.0, 44.0, 14.0
#: frames of the motion; seconds that it takes in the picture, and with the rest at its end
FRAMES, SLOW, WHOLE = 13, 3.0, 5.0
WIDTH, HEIGHT = (RIGHT - LEFT) * SCALE, (TOP - BOTTOM) * SCALE
_FONT = 'font-family="system-ui, Helvetica, Arial, sans-serif"'
_RESULT = "{kept} that are kept, {slower:.0f} times slower"
_SCENE = "a torso in a vehicle that accelerates and turns"


def draw_moving(path: Path) -> None:
    """Optimise cases/fig6.yaml and draw it."""
    case = load_case(CASES / "fig6.yaml")
    (group,) = case.members
    result = optimize(case)
    motion = simulate(case, result.alpha)
    times = np.linspace(motion.t[0], motion.t[-1], FRAMES)
    states = motion.at(times).q
    kept = sizes(group, result.alpha) > PRESENT
    slower = SLOW / float(times[-1] - times[0])

    def outlines(moving: bool) -> list[str]:
        parts = []
        for k, body in enumerate(case.bodies):
            colour = COLOURS[(k + 2) % len(COLOURS)]
            for shape in planar_shapes(case, body.name):
                lines = [(area, f'fill="{colour}" fill-opacity=".14"', "Z") for area in shape.areas]
                lines += [(line, 'fill="none" stroke-width="2"', "") for line in shape.lines]
                for corners, style, end in lines:
                    places = points_at(case, body.name, corners, states if moving else start_state(case)[None])
                    parts.append(_drawn([_path(each[None]) + end for each in places], f'{style} stroke="{colour}"'))
        return parts

    thin = f'fill="none" stroke="{COLOURS[0]}" stroke-width=".4" stroke-opacity=".35"'
    thick = f'fill="none" stroke="{COLOURS[0]}" stroke-width="1.6" stroke-opacity=".8" stroke-linecap="round"'
    offered = [_path(ends_at(case, group, start_state(case)))]
    moved = [_path(ends_at(case, group, q)[kept]) for q in states]
    panels = [
        (
            f"{len(group):,} belts that could be",
            [*outlines(False), _drawn(offered, thin), _text(_SCENE, 0.0, HEIGHT - 8.0, 13)],
        ),
        (_RESULT.format(kept=int(kept.sum()), slower=slower), [*outlines(True), _drawn(moved, thick), _clock()]),
    ]
    path.write_text(_document(panels), encoding="utf-8")


def _path(chains: Floats) -> str:
    """Chains of places (R, K, 2) in m as the data of a path, in pixels from a panel's upper left corner."""
    x, y = (chains[..., 0] - LEFT) * SCALE, (TOP - chains[..., 1]) * SCALE
    return "".join(
        "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(*chain, strict=True)) for chain in zip(x, y, strict=True)
    )


def _drawn(frames: list[str], style: str) -> str:
    """A path with that style; of several frames, moved through them, with a rest at the end."""
    if len(frames) == 1:
        return f'<path d="{frames[0]}" {style}/>'
    moving = _animated("d", [*frames, frames[-1]], [*np.linspace(0.0, SLOW / WHOLE, len(frames)), 1.0])
    return f'<path d="{frames[-1]}" {style}>{moving}</path>'


def _text(words: str, x: float, y: float, size: int) -> str:
    return f'<text x="{x:.0f}" y="{y:.0f}" {_FONT} font-size="{size}" fill="#222222">{words}</text>'


def _clock() -> str:
    """A line below the panel that grows with time."""
    growing = _animated("width", ["0", f"{WIDTH:.0f}", f"{WIDTH:.0f}"], [0.0, SLOW / WHOLE, 1.0])
    return f'<rect y="{HEIGHT + 4:.0f}" width="{WIDTH:.0f}" height="3" fill="#999999">{growing}</rect>'


def _animated(attribute: str, values: list[str], at: list[float]) -> str:
    """An attribute that takes values at these shares of the whole, again and again."""
    shares = ";".join(f"{share:.4g}" for share in at)
    return (
        f'<animate attributeName="{attribute}" dur="{WHOLE:g}s" repeatCount="indefinite" keyTimes="{shares}" '
        f'values="{";".join(values)}"/>'
    )


def _document(panels: list[tuple[str, list[str]]]) -> str:
    """Panels side by side, each with its title above, on white."""
    width = len(panels) * (WIDTH + MARGIN) + MARGIN
    height = HEAD + HEIGHT + MARGIN
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}">',
        f'<rect width="{width:.0f}" height="{height:.0f}" rx="8" fill="white"/>',
    ]
    for k, (title, parts) in enumerate(panels):
        x = MARGIN + k * (WIDTH + MARGIN)
        lines.append(_text(title, x, 28.0, 16))
        lines += [f'<g transform="translate({x:.0f} {HEAD:.0f})">', *parts, "</g>"]
    return "\n".join([*lines, "</svg>", ""])
