"""What is called where nobody wants to be called."""


def ignore(_: object) -> None:
    """Nobody listens."""


def ignore_state(_index: int, _state: object) -> None:
    """Nobody keeps it."""


def never() -> bool:
    """Nobody asks for a stop."""
    return False
