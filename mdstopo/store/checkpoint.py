"""When to save: by time, and never longer than what is saved is worth."""

import time
from collections.abc import Callable

from mdstopo.store.store_errors import WriteError

INTERVAL = 0.4
"""Seconds of work after which a checkpoint is due: with its own writing, about half a second can be lost."""

_COST_FACTOR = 2.0  # work saved per time spent saving it, at least


class Checkpointer:
    """Calls `save` whenever the work done since the last time is worth it.

    Parameters
    ----------
    save
        writes a checkpoint.
    expected_cost
        seconds that the first one is expected to take; afterwards the last one's is used.
    clock
        a clock in seconds.
    notify
        is given a sentence where a checkpoint could not be written, and the work goes on: there may be room on the disk
        at its end. None lets the WriteError through.
    """

    def __init__(
        self,
        save: Callable[[], None],
        expected_cost: float = 0.0,
        clock: Callable[[], float] = time.perf_counter,
        notify: Callable[[str], None] | None = None,
    ) -> None:
        self._save = save
        self._notify = notify
        self._cost = expected_cost
        self._clock = clock
        self._saved_at = clock()
        self._offered_at = self._saved_at
        self.count = 0

    def offer(self, urgent: bool = False) -> bool:
        """Write a checkpoint if it is time, after each iteration; whether one was written.

        urgent: what has just been reached took long, so that it is to be saved unless saving takes longer still.
        """
        now = self._clock()
        unsaved = now - self._saved_at
        iteration = now - self._offered_at
        self._offered_at = now
        # One more iteration like the last may carry the loss past the interval, so it counts already.
        early = unsaved + iteration < INTERVAL or unsaved < _COST_FACTOR * self._cost
        if early and not (urgent and self._cost < INTERVAL):
            return False
        try:
            self._save()
        except WriteError as error:
            if self._notify is None:
                raise
            self._notify(f"no checkpoint: {error}")
        self._saved_at = self._offered_at = self._clock()
        self._cost = self._saved_at - now
        self.count += 1
        return True
