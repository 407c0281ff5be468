"""Callbacks that do nothing, for callers who want none."""


def ignore(_: object) -> None:
    """A callback that does nothing."""


def ignore_state(_index: int, _state: object) -> None:
    """Take a state and do nothing with it."""


def never() -> bool:
    """Never ask for a stop."""
    return False
