"""What is called where nobody wants to be called."""


def ignore(_: object) -> None:
    """Nobody listens."""


def never() -> bool:
    """Nobody asks for a stop."""
    return False
