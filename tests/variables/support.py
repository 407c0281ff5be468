"""What the tests of variables share."""

from mdstopo.session.run import run_session


def whole_and_resumed(case, folder):
    """A run, and the same run stopped after its fourth iterate and resumed."""
    whole = run_session(case, path=folder / "whole.h5")
    reached: list[int] = []
    run_session(
        case,
        path=folder / "parts.h5",
        on_iteration=lambda progress: reached.append(progress.iteration),
        stop_requested=lambda: len(reached) > 3,
    )
    return whole, run_session(case, path=folder / "parts.h5", resume=True)
