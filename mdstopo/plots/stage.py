"""One drawing of a scene for several states: the same window for all, in perspective where bodies are in space."""

from functools import partial
from typing import Any

import numpy as np

from mdstopo.case.model import GROUND
from mdstopo.plots.body_shapes import planar_shapes
from mdstopo.plots.layout_plot import draw_bodies, draw_state
from mdstopo.plots.member_lines import draw_members
from mdstopo.plots.scenery import Floats, ends_at, own_points
from mdstopo.plots.solids import solid
from mdstopo.plots.source import Source
from mdstopo.plots.space_layout import draw_frame, draw_scene, scene_cloud
from mdstopo.plots.style import colour
from mdstopo.plots.symbol_marks import draw_symbols
from mdstopo.plots.symbols import symbols
from mdstopo.plots.thickness import Thickness
from mdstopo.plots.views import views
from mdstopo.scene.point_positions import points_at

#: share of the window that is left free
MARGIN = 0.08


class Stage:
    """Draws the states (T, n) of a result, in a plane or as views of space."""

    def __init__(self, source: Source, states: Floats) -> None:
        self.source, self.case = source, source.case
        self.names = [*(body.name for body in self.case.bodies), GROUND]
        if self.case.dimension == 3:
            self.solids = {name: solid(self.case, name) for name in self.names}
            self.cloud = scene_cloud(self.case, list(states), self.solids)
            low, high = self.cloud.min(axis=0), self.cloud.max(axis=0)
            radius = max(0.5 * float(np.linalg.norm(high - low)), 1e-12)
            self.view = views(self.case, 0.5 * (low + high), radius)["perspective"]
        else:
            self.cloud = self._planar_cloud(states)

    def _planar_cloud(self, states: Floats) -> Floats:
        pieces = [states[:, 3 * k : 3 * k + 2] for k in range(len(self.case.bodies))]
        for name in self.names:
            corners = [own_points(self.case, name)]
            corners += [area for shape in planar_shapes(self.case, name) for area in shape.areas]
            pieces.append(points_at(self.case, name, np.concatenate(corners), states).reshape(-1, 2))
        return np.concatenate(pieces)

    def draw(
        self, axis: Any, q: Floats, thick: Thickness, shown: tuple[str | None, float | None], faint: float = 1.0
    ) -> None:
        """Everything at a state q.

        axis: where it is drawn.
        q: the state.
        thick: how thick members are.
        shown: the load case whose loads are drawn, and the time of them.
        faint: how much of the colours of bodies is left, for overlays.
        """
        if self.case.dimension == 3:
            draw_frame(axis, self.view, np.array([1.4, 1.0]), self.cloud)
            draw_scene(axis, self.source, self.view, q, self.solids)
            draw_members(axis, self.source, q, self.view.seen, thick)
            draw_symbols(axis, self.case, symbols(self.case, *shown), q, self.view.seen)
            return
        draw_state(axis, self.source, q, thick, shown, faint)
        low, high = self.cloud.min(axis=0), self.cloud.max(axis=0)
        room = MARGIN * max(float((high - low).max()), 1e-9)
        axis.set_aspect("equal", adjustable="box")
        axis.set_xlim(low[0] - room, high[0] + room)
        axis.set_ylim(low[1] - room, high[1] + room)

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

    def ends(self, q: Floats) -> Any:
        """Where members are drawn on the paper at a state, a function of their group."""
        if self.case.dimension == 3:
            return lambda group: self.view.seen(ends_at(self.case, group, q))
        return partial(ends_at, self.case, q=q)
