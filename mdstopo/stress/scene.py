"""What a scene of the stress test is: a case, what is compared with what, and how it has to end."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mdstopo.case.model import Case

#: wall time in which a scene has to end, in s; machines that are busy with other things are slow
LIMIT = 120.0


class Refused(Exception):  # noqa: N818 - a refusal is an outcome, not an error
    """The engine refused to compute a scene; the text is the status with its message."""


@dataclass(frozen=True)
class Scene:
    """One scene.

    data: the case. measure: the error of what the engine computes of it, relative to the independent value, and what
    else is to be reported; it raises Refused where there is a refusal. A scene has to be right within `bound`, or,
    where `refusal` has words, to be refused in a message that has them all. limit: seconds until it counts as one
    that hangs. long: only on demand.
    """

    name: str
    checks: str
    data: dict[str, Any]
    measure: "Callable[[Case], float | tuple[float, str]]"
    bound: float = 0.0
    refusal: tuple[str, ...] = ()
    limit: float = LIMIT
    long: bool = False

    @property
    def expected(self) -> str:
        """How the scene has to end, in words."""
        return "refused" if self.refusal else "right"

    @property
    def integrator(self) -> str:
        """The integrator of the case."""
        return str(self.data.get("solver", {}).get("integrator", "auto"))

    @property
    def text(self) -> str:
        """The case as the text of a file (JSON, which is YAML too)."""
        return json.dumps({"format": 1, "title": self.checks, **self.data}, indent=2) + "\n"


@dataclass(frozen=True)
class Outcome:
    """How a scene ended. outcome: right, wrong, refused, not finite, hangs, crashes; error: None where it has none."""

    scene: Scene
    outcome: str
    error: float | None
    message: str
    seconds: float
    note: str = ""

    @property
    def ok(self) -> bool:
        """Whether the scene ended as it had to."""
        named = all(word in self.message for word in self.scene.refusal)
        return self.outcome == self.scene.expected and named
