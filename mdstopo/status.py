"""How a computation ended. The values are the sentences users read.

Inside the program a solve that cannot go on returns a `Status`, never an exception: exceptions are for bad
input and for bugs. `RunStatus` is how a whole optimisation stands; its values are the words of the result
file.
"""

import enum
from collections.abc import Sequence


class Status(enum.Enum):
    """The end of one evaluation or one simulation; the value is the sentence shown to the user."""

    OK = "done"
    NON_FINITE = "a value that is not finite appeared"
    ZERO_LENGTH = "the ends of a member that carries a force meet, so that it has no direction"
    UNRESOLVED = "a member stretches by so little that rounding leaves its energy hardly a digit"
    STEP_LIMIT = "the integrator needed more steps than it may take"
    STEP_TOO_SMALL = "the step became too small to move time on"
    NEWTON_FAILED = "Newton's iteration of the implicit integrator did not converge"
    STEP_TOO_LARGE = "the fixed step is far too large for the motion"
    SINGULAR = "the joints have become singular: they contradict or repeat each other in this configuration"
    HALF_TURN = "a bushing has turned by half a turn, beyond which its couple has no direction"
    ROTATION_JUMP = "a rotation that is looked at over time has reached half a turn, where its vector jumps"
    CHATTERING = "a member switches again and again within next to no time"
    NO_EQUILIBRIUM = "there is no static equilibrium near the stated configuration"
    NO_GRADIENT = "the objective has a value but no gradient here"
    NOT_POSITIVE = "an objective is not positive"
    GRAZING = "a member only just touches, or only just does not: the gradient holds on one side only"

    ok: bool  #: whether values and gradients can be trusted
    usable: bool  #: whether values can be trusted, and gradients at least on one side

    def __init__(self, sentence: str) -> None:
        self.ok = self.name == "OK"
        self.usable = self.name in ("OK", "GRAZING")


class RunStatus(enum.StrEnum):
    """Where an optimisation stands; members equal their words in the result file."""

    RUNNING = "running"
    CONVERGED = "converged"
    STALLED = "stalled"
    MAX_ITERATIONS = "max_iterations"
    INTERRUPTED = "interrupted"
    FAILED = "failed"
    VISITED = "visited"  #: of fronts: a design that was met on the way to others, and the end of nothing


def together(ends: Sequence[RunStatus], noun: str) -> tuple[RunStatus, str]:
    """The status of several runs as one, and a sentence on how many of them ended how. noun: what they are, in the
    plural."""
    counts = {end: ends.count(end) for end in sorted(set(ends))}
    words = ", ".join(f"{count} {end.value.replace('_', ' ')}" for end, count in counts.items())
    reason = f"{len(ends)} {noun}: {words}"
    if set(counts) == {RunStatus.FAILED}:
        return RunStatus.FAILED, reason
    for worst in (RunStatus.STALLED, RunStatus.MAX_ITERATIONS):
        if worst in counts:
            return worst, reason
    return RunStatus.CONVERGED, reason
