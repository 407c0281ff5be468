"""Timing that treats all alike: rounds that go through everything in turn, medians, spread."""

import time
from collections.abc import Callable, Hashable, Mapping
from statistics import median
from typing import TypeVar

Key = TypeVar("Key", bound=Hashable)


def interleaved(
    calls: Mapping[Key, Callable[[], object]], rounds: int = 7, seconds: float = 0.03
) -> dict[Key, list[float]]:
    """Seconds a call, the median of each round, for every call; each has been called once before it is timed.

    Drifts of the machine hit all calls alike, because a round goes through all of them.
    """
    for call in calls.values():
        call()
    found: dict[Key, list[float]] = {key: [] for key in calls}
    for _ in range(rounds):
        for key, call in calls.items():
            found[key].append(_round(call, seconds))
    return found


def _round(call: Callable[[], object], seconds: float) -> float:
    times: list[float] = []
    end = time.perf_counter() + seconds
    while len(times) < 3 or time.perf_counter() < end:
        began = time.perf_counter()
        call()
        times.append(time.perf_counter() - began)
    return median(times)
