"""What a caller is told by; and callbacks that do nothing, for callers who want none."""

from collections.abc import Callable

#: is given sentences for the user
Notify = Callable[[str], None]


def ignore(_: object) -> None:
    """A callback that does nothing."""


def ignore_state(_index: int, _state: object) -> None:
    """A callback that does nothing with a state."""


def never() -> bool:
    """A question whether to stop, answered with no."""
    return False
