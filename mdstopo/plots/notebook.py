"""Cases, evaluations, motions and results as HTML for notebooks: what they are in a table, and a picture."""

import html as escaping
import importlib.util
import io
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from mdstopo.case.model import Case
from mdstopo.evaluation import Evaluation
from mdstopo.integrators.trajectory import Trajectory
from mdstopo.plots.layout_plot import draw
from mdstopo.plots.source import Floats, Motion, Source
from mdstopo.plots.style import COLOURS, new_figure, styled
from mdstopo.session.outcome import Outcome

Row = tuple[str, str]


class InMemory(Source):
    """A case and one of its designs, for pictures that need no file."""

    def __init__(self, case: Case, design: Floats) -> None:
        self.__dict__ |= {"case": case, "stated": case, "design": design, "alpha": design[: case.n_design]}

    @property
    def title(self) -> str:
        """The title of the case, or its name."""
        return self.case.title or self.case.name

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the objectives."""
        return tuple(objective.name for objective in self.case.objectives)

    def motion(self, load_case: str, times: Floats | None = None) -> Motion:
        """The motion of the design in a load case, simulated."""
        found = self.engine.trajectory(self.design, load_case)
        asked = found.t if times is None else times
        return Motion(asked, found.at(asked).q)


def html(value: Any) -> str:
    """A case, an evaluation, a motion or a result; ValueError for anything else."""
    writers: dict[type, Callable[[Any], tuple[list[Row], Callable[[Any], Any]]]] = {
        Case: _case,
        Evaluation: _evaluation,
        Trajectory: _trajectory,
        Outcome: _outcome,
    }
    if type(value) not in writers:
        raise ValueError(f"{type(value).__name__} has no form for notebooks")
    rows, picture = writers[type(value)](value)
    return f"<div>{_table(rows)}{_svg(picture)}</div>"


def _table(rows: Iterable[Row]) -> str:
    cells = "".join(
        f"<tr><th style='text-align:left'>{escaping.escape(name)}</th>"
        f"<td style='text-align:left'>{escaping.escape(text)}</td></tr>"
        for name, text in rows
    )
    return f"<table>{cells}</table>"


def _svg(picture: Callable[[Any], Any]) -> str:
    """A picture as SVG to be put into a page; nothing where matplotlib is not installed."""
    if importlib.util.find_spec("matplotlib") is None:
        return ""
    stream = io.StringIO()
    with styled() as module:
        picture(module).savefig(stream, format="svg", metadata={"Date": None})
    text = stream.getvalue()
    return text[text.index("<svg") :]


def _case(case: Case) -> tuple[list[Row], Callable[[Any], Any]]:
    rows = [
        ("case", case.title or case.name),
        ("bodies", ", ".join(body.name for body in case.bodies)),
        ("members", f"{case.n_members:,}, {case.n_design:,} of them design variables"),
        ("objectives", ", ".join(objective.name for objective in case.objectives) or "none"),
    ]
    return rows, lambda module: draw(module, InMemory(case, case.start))


def _evaluation(found: Evaluation) -> tuple[list[Row], Callable[[Any], Any]]:
    rows = [("status", found.status.value)]
    rows += [
        (name, f"{value:.9g}" + (f" at {time:.6g} s" if np.isfinite(time) else ""))
        for (name, value), time in zip(found.objectives.items(), found.peak_times.values(), strict=True)
    ]

    def slopes(module: Any) -> Any:
        figure, (axis,) = new_figure(module)
        for k, (name, slope) in enumerate(found.gradients.items()):
            axis.plot(slope, ".", color=COLOURS[k % len(COLOURS)], markersize=2, label=name)
        axis.set_xlabel("member")
        axis.set_ylabel("derivative by alpha")
        if found.gradients:
            axis.legend()
        return figure

    return rows, slopes


def _trajectory(motion: Trajectory) -> tuple[list[Row], Callable[[Any], Any]]:
    rows = [
        ("load case", motion.load_case),
        ("status", motion.status.value),
        ("steps", f"{len(motion.t) - 1} from {motion.t[0]:g} to {motion.t[-1]:g} s"),
    ]

    def speeds(module: Any) -> Any:
        figure, (axis,) = new_figure(module)
        each = 3 if motion.q.shape[1] == motion.v.shape[1] else 6
        for k, name in enumerate(motion.bodies):
            places = motion.v[:, each * k : each * k + each // 2 + (each == 3)]
            axis.plot(motion.t, np.linalg.norm(places, axis=1), color=COLOURS[k % len(COLOURS)], label=name)
        axis.set_xlabel("time, s")
        axis.set_ylabel("speed of the centre, m/s")
        axis.legend()
        return figure

    return rows, speeds


def _outcome(result: Outcome) -> tuple[list[Row], Callable[[Any], Any]]:
    rows = [("case", result.case.title or result.case.name), ("status", f"{result.status.value}: {result.reason}")]
    rows += [
        (name, f"{result.initial_objectives[name]:.9g} → {value:.9g}") for name, value in result.objectives.items()
    ]
    rows.append(("iterations", f"{result.iterations}, {result.evaluations} evaluations"))
    design = np.concatenate([result.alpha, *result.variables.values()])
    return rows, lambda module: draw(module, InMemory(result.case, design))
