"""Time over the error of the gradient, a line for each program."""

from collections.abc import Sequence
from pathlib import Path

from benchmarks.peers.race import Entry, Measured
from benchmarks.peers.table import OURS


def draw(groups: Sequence[tuple[str, Sequence[Measured]]], path: Path) -> None:
    """A diagram for each scene and design, both axes logarithmic.

    Raises StoreError where matplotlib is missing or the picture cannot be written.
    """
    from mdstopo.plots.style import COLOURS, MARKERS, new_figure, save, styled

    with styled() as module:
        figure, axes = new_figure(module, len(groups))
        names = list(dict.fromkeys(line(each.entry) for _, found in groups for each in found))
        for axis, (title, found) in zip(axes, groups, strict=True):
            for k, name in enumerate(names):
                own = sorted((each for each in found if line(each.entry) == name), key=lambda each: each.error)
                style = {"color": COLOURS[k % len(COLOURS)], "marker": MARKERS[k % len(MARKERS)], "label": name}
                # rounding has no logarithm where it is exactly zero
                axis.plot([max(each.error, 1e-16) for each in own], [1e3 * each.seconds for each in own], **style)
            axis.set_xscale("log")
            axis.set_yscale("log")
            axis.set_ylabel("time, ms")
            axis.set_title(title)
        axes[0].legend(fontsize=5)
        axes[-1].set_xlabel("relative error of the gradient")
        save(figure, path)


def line(entry: Entry) -> str:
    """What belongs to one line: a program, ours with its integrator."""
    return f"{OURS}, {entry.setting.get('integrator', 'auto')}" if entry.peer == OURS else entry.peer
