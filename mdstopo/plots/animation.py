"""A motion as moving pictures: GIF and MP4 from drawings, SVG that moves by itself."""

import shutil
from pathlib import Path
from typing import Any

import numpy as np

from mdstopo.plots.moving_svg import Timing, moving_svg
from mdstopo.plots.panels import ABOVE, BELOW, LEFT, RIGHT, add_panel
from mdstopo.plots.scenery import Floats, start_state
from mdstopo.plots.source import Source
from mdstopo.plots.stage import Stage
from mdstopo.plots.style import WIDTH
from mdstopo.plots.thickness import Thickness, thickness
from mdstopo.store.store_errors import StoreError

FORMATS = (".gif", ".mp4", ".svg")
#: dots per inch of a frame, frames in a second at most
DPI, RATE = 150, 25
#: inches: a frame, and the drawing in it
FRAME = np.array([1.3 * WIDTH, WIDTH])
FILM = FRAME - np.array([LEFT + RIGHT, BELOW + ABOVE])


def write_motion(module: Any, source: Source, path: Path, load_case: str, frames: int, seconds: float) -> None:
    """The motion of the design in a load case.

    module: matplotlib's figure module, with the style on.
    source: the result.
    path: where to; its ending says what it is.
    load_case: whose motion.
    frames: pictures, at least 2.
    seconds: how long it plays.
    Raises StoreError for another ending, where ffmpeg is missing for .mp4, and where the file cannot be written.
    """
    ending = path.suffix.lower()
    if ending not in FORMATS:
        raise StoreError(f"{path}: a moving picture ends in {', '.join(FORMATS)}")
    if ending == ".mp4" and shutil.which("ffmpeg") is None:
        raise StoreError(f"{path}: .mp4 needs the program ffmpeg, which is not installed; .gif and .svg do not")
    span = source.case.load_case(load_case)
    whole = source.motion(load_case)
    times = np.linspace(whole.t[0], min(float(whole.t[-1]), span.end), frames)
    motion = source.motion(load_case, times)
    stage, thick = Stage(source, motion.q, load_case, times.tolist()), thickness(source)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if ending == ".svg":
            path.write_text(moving_svg(stage, thick, motion.q, Timing(load_case, times, seconds)), encoding="utf-8")
        else:
            _film(module, stage, thick, (load_case, times, motion.q), (path, seconds))
    except OSError as error:
        raise StoreError(f"{path}: cannot be written: {error.strerror}") from error


def still(source: Source) -> str:
    """The design of a result at the start of its motion, as SVG. Raises StoreError where the file has none."""
    states = start_state(source.case)[None]
    return moving_svg(Stage(source, states), thickness(source), states)


def _film(
    module: Any, stage: Stage, thick: Thickness, shown: tuple[str, Floats, Floats], out: tuple[Path, float]
) -> None:
    from matplotlib.animation import FFMpegWriter, PillowWriter
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    (load_case, times, states), (path, seconds) = shown, out
    figure = module.Figure(figsize=tuple(FRAME))
    FigureCanvasAgg(figure)
    axis = add_panel(figure, LEFT, BELOW, FILM)
    rate = max(1, min(RATE, round(len(times) / seconds)))
    kind = FFMpegWriter if path.suffix.lower() == ".mp4" else PillowWriter
    writer = kind(fps=rate)
    with writer.saving(figure, str(path), DPI):
        for t, q in zip(times.tolist(), states, strict=True):
            axis.clear()
            axis.child_axes.clear()
            stage.draw(axis, q, thick, (load_case, t), FILM)
            axis.set_title(f"t = {t:.4g} s", loc="left")
            writer.grab_frame()
