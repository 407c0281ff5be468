"""`mdstopo bench work-precision --peers`: the comparison with other programs, which is no part of the package.

It stands in the folder `benchmarks` of a checkout, beside the package.
"""

import sys
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path

from mdstopo.bench.tables import Table
from mdstopo.case.model import Case

#: (case or None for the paper's scenes, told what is going on, where to draw) -> tables
Comparison = Callable[[Case | None, Callable[[str], None], Path | None], Iterator[Table]]

_ROOT = Path(__file__).resolve().parents[2]


class NotACheckoutError(Exception):
    """The package is installed without the rest of the project; the message says what to do."""


def load(root: Path = _ROOT) -> Comparison:
    """The comparison of the checkout that this package belongs to. Raises NotACheckoutError where there is none."""
    if not (root / "benchmarks" / "peers" / "command.py").exists():
        raise NotACheckoutError(
            "--peers needs a checkout of the project, whose folder benchmarks has the other programs: "
            "install from one with pip install --editable '.[peers]'"
        )
    if str(root) not in sys.path:
        sys.path.append(str(root))
    found: Comparison = import_module("benchmarks.peers.command").comparison
    return found
