"""Who wants to know that something is compiled: it takes from a second to a minute, in which nothing else happens."""

from collections.abc import Callable

#: called with the name of each entry that is not on the disk, before it is compiled
listeners: list[Callable[[str], None]] = []


def compiling(name: str) -> None:
    """Tell them."""
    for listener in tuple(listeners):
        listener(name)
