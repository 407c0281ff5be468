"""Several processes read all tests, and share what that costs: each rewrites the assertions of other files first.

pytest keeps what it has rewritten on the disk, where each process finds what the others have. Left to themselves they
would all go through the files in one order, side by side, and each would rewrite all of them.
"""

import contextlib
import gc
import re
from collections.abc import Iterator

import pytest


def _share(config: pytest.Config) -> tuple[int, int]:
    """Which of how many processes this one is; the only one is the first of one."""
    worker = getattr(config, "workerinput", {"workerid": "0", "workercount": 1})
    return int(re.sub(r"\D", "", worker["workerid"])), worker["workercount"]


@pytest.hookimpl(wrapper=True)
def pytest_collection(session: pytest.Session) -> Iterator[None]:
    """Import files of this process before all others; objects of tests live to the end, so none is looked for."""
    gc.disable()
    try:
        which, count = _share(session.config)
        if count > 1 and session.config.args == session.config.getini("testpaths"):
            for path in sorted((session.config.rootpath / "tests").rglob("test_*.py"))[which::count]:
                # what goes wrong is told when the file's turn comes
                with contextlib.suppress(Exception, pytest.skip.Exception):
                    _ = pytest.Module.from_parent(session, path=path).obj
        return (yield)
    finally:
        gc.enable()
        gc.freeze()
