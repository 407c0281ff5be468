"""Where the time of the applications goes: `mdstopo bench profile` of each."""

from collections.abc import Iterator

from mdstopo.bench.profile import profile as profile_of
from mdstopo.bench.tables import Table
from mdstopo.case.reader import load_case

CASES = ("restraint", "tiedown", "mooring", "lander")


def profile() -> Iterator[Table]:
    """Two tables for each application: force sums by what they are for, and milliseconds."""
    for name in CASES:
        yield from profile_of(load_case(f"cases/{name}.yaml"))
