"""One drawing of a scene for several states: the same window for all, in perspective where bodies are in space."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from mdstopo.case.model import GROUND, Case, MemberGroup
from mdstopo.plots.acting import Mask, acting
from mdstopo.plots.cloud import planar_cloud, scene_cloud
from mdstopo.plots.drawn_plane import draw_bodies, draw_state, marks_of
from mdstopo.plots.member_lines import draw_members
from mdstopo.plots.scenery import Floats
from mdstopo.plots.solids import solid
from mdstopo.plots.source import Source
from mdstopo.plots.space_layout import draw_perspective, draw_scene
from mdstopo.plots.style import colour
from mdstopo.plots.symbol_marks import Mark, draw_marks, marks_at
from mdstopo.plots.symbols import Symbol, symbols
from mdstopo.plots.thickness import Thickness
from mdstopo.plots.views import views
from mdstopo.plots.window import scale_of, window
from mdstopo.scene.point_positions import points_at

#: at most so many states are looked at for room for their symbols
STATES = 40
#: inches that the number of a tick needs below a drawing and beside it; ticks at most
ACROSS, UP, MOST_TICKS = 0.42, 0.16, 8


class Stage:
    """Draws the states (T, n) of a result, in a plane or as a view of space.

    load_case, times: whose loads are shown, and when, and which members act then; None of a time shows each load at its
    largest and all members as acting.
    """

    def __init__(
        self, source: Source, states: Floats, load_case: str | None = None, times: Sequence[float | None] = ()
    ) -> None:
        self.source, self.case = source, source.case
        self.names = [*(body.name for body in self.case.bodies), GROUND]
        chosen = np.unique(np.linspace(0, len(states) - 1, STATES).astype(int)).tolist()
        self._windows: dict[tuple[float, ...], tuple[Floats, Floats]] = {}
        self._together = [self]
        self._states = [(states[k], (load_case, times[k] if times else None)) for k in chosen]

        def acts(group: MemberGroup, k: int) -> Mask:
            return acting(source, group, times[k] if times else None)

        if self.case.dimension == 3:
            self.solids = {name: solid(self.case, name) for name in self.names}
            self._places = scene_cloud(self.case, states, self.solids, acts)
        else:
            self._places = planar_cloud(self.case, states, acts)
        self._look_at(self._places, self.case)

    def _look_at(self, places: Floats, upright: Case) -> None:
        """Show so much that places (n, d) are seen, in space from an eye before their middle, up being as in the case
        `upright`."""
        self._windows.clear()
        if self.case.dimension == 3:
            low, high = places.min(axis=0), places.max(axis=0)
            self.radius = max(0.5 * float(np.linalg.norm(high - low)), 1e-12)
            self.view = views(upright, 0.5 * (low + high), self.radius)["perspective"]
        self.cloud = self.seen(places)

    @staticmethod
    def show_alike(stages: "list[Stage]") -> None:
        """Give stages one window, in space from the eye of the first, in which all that each of them draws is whole."""
        places = np.concatenate([stage._places for stage in stages])
        for stage in stages:
            stage._together = stages
            stage._look_at(places, stages[0].case)

    def window(self, inches: Floats) -> tuple[Floats, Floats]:
        """Lower left and upper right corner (2,) on the paper of what is seen in a picture of this size (2,)."""
        known = self._windows.get(tuple(inches.tolist()))
        if known is not None:
            return known
        scale = scale_of(self.cloud.min(axis=0), self.cloud.max(axis=0), inches)
        marks = [
            mark for stage in self._together for q, shown in stage._states for mark in stage._marks(q, shown, scale)
        ]
        found = window(self.cloud, marks, inches)
        self._windows[tuple(inches.tolist())] = found
        return found

    def _marks(self, q: Floats, shown: tuple[str | None, float | None], scale: float) -> list[Mark]:
        return self.marks(q, symbols(self.case, *shown), scale)

    def marks(self, q: Floats, found: list[Symbol], scale: float) -> list[Mark]:
        """These symbols at a state, in a plane with those of ground. scale: points (1/72 inch) in a metre."""
        if self.case.dimension == 2:
            return marks_of(self.case, q, found, scale)
        return marks_at(self.case, found, q, self.view.seen, self.radius)

    def draw(
        self,
        axis: Any,
        q: Floats,
        thick: Thickness,
        shown: tuple[str | None, float | None],
        inches: Floats,
        faint: float = 1.0,
    ) -> None:
        """Everything at a state q.

        axis: where it is drawn.
        q: the state.
        thick: how thick members are.
        shown: the load case whose loads are drawn, and the time of them and of members that act.
        inches (2,): the size of the drawing.
        faint: how much of the colours of bodies is left, for overlays.
        """
        low, high = self.window(inches)
        axis.set_aspect("equal", adjustable="box")
        if self.case.dimension == 3:
            draw_perspective(axis, self.view, (low, high), inches)
            draw_scene(axis, self.source, self.view, q, self.solids)
            draw_members(axis, self.source, q, self.view.seen, thick, shown[1])
            draw_marks(axis, self._marks(q, shown, scale_of(low, high, inches)))
            return
        scale = scale_of(low, high, inches)
        free = 72.0 * inches / scale - (high - low)  # of a flat scene above and below, of a narrow one beside it
        first, last = low - 0.5 * free, high + 0.5 * free
        axis.set_xlim(first[0], last[0])
        axis.set_ylim(first[1], last[1])
        for name, length, needed in (("x", float(inches[0]), ACROSS), ("y", float(inches[1]), UP)):
            axis.locator_params(axis=name, nbins=max(1, min(MOST_TICKS, int(length / needed))))
        for each in (axis.xaxis, axis.yaxis):
            each.set_major_formatter(lambda number, _: f"{number:g}".replace("-", "\u2212"))
        axis.set_xlabel("x, m")
        axis.set_ylabel("y, m")
        loaded = self.case.load_cases[0] if shown[0] is None else self.case.load_case(shown[0])
        gravity = np.array(loaded.gravity, dtype=np.float64)
        draw_state(axis, self.source, q, thick, self._marks(q, shown, scale), gravity, faint, shown[1])

    def draw_bodies(self, axis: Any, q: Floats, faint: float) -> None:
        """Bodies alone. faint: how much of their colours is left."""
        if self.case.dimension == 2:
            draw_bodies(axis, self.case, q, faint)
            return
        for k, (name, shape) in enumerate(self.solids.items()):
            flat = self.seen(points_at(self.case, name, shape.corners, q[None])[0])
            for edge in shape.edges if name != GROUND else ():
                axis.plot(*flat[list(edge)].T, "-", color=colour(k + 2), linewidth=0.7, alpha=faint, zorder=1.4)

    def seen(self, places: Floats) -> Floats:
        """Coordinates (n, 2) on the paper of places (n, d) in the scene."""
        return self.view.seen(places) if self.case.dimension == 3 else places
