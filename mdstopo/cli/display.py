"""How what takes long shows that it is going: a picture on a terminal, now and then a plain line elsewhere."""

import sys
import time
from collections.abc import Callable
from threading import Event, Thread
from types import TracebackType
from typing import TYPE_CHECKING, Generic, TypeVar

from mdstopo.cli.output import duration, write

if TYPE_CHECKING:
    from rich.table import Table

T = TypeVar("T")

_EVERY = 3.0  # seconds between plain lines
_SILENT = 60.0  # seconds without news after which a plain line says that work goes on
_REFRESH = 0.1  # seconds between changes of the picture


class Silent(Generic[T]):
    """A display that says nothing."""

    def __enter__(self) -> "Silent[T]":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        return None

    def __call__(self, progress: T) -> None:
        """Draw nothing."""


class Plain(Silent[T]):
    """A display for logs: a line every few seconds, and one a minute where there are no news. Work that is over before
    then is not mentioned."""

    def __init__(self, clock: Callable[[], float] = time.perf_counter, silent: float = _SILENT) -> None:
        self._clock, self._silent = clock, silent
        self._begun_at = self._said_at = clock()
        self._over = Event()

    def __enter__(self) -> "Plain[T]":
        Thread(target=self._say_in_silence, daemon=True).start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._over.set()

    def _say_in_silence(self) -> None:
        """Say that work goes on, each time that nothing has been said for long."""
        wait = self._silent
        while not self._over.wait(wait):
            now = self._clock()
            wait = self._said_at + self._silent - now
            if wait <= 0.0:
                self._said_at, wait = now, self._silent
                write(sys.stderr, f"at work for {duration(now - self._begun_at)}; the next result is still to come")

    def __call__(self, progress: T) -> None:
        """Say it if it is time."""
        now = self._clock()
        if now - self._said_at >= _EVERY:
            self._said_at = now
            write(sys.stderr, self._words(progress))

    def _words(self, progress: T) -> str:
        raise NotImplementedError


class Live(Silent[T]):
    """A display that changes in place, drawn with rich, which is imported only here."""

    def __init__(self) -> None:
        self._drawn_at = 0.0

    def __enter__(self) -> "Live[T]":
        from rich.console import Console
        from rich.live import Live as RichLive

        self._live = RichLive(console=Console(stderr=True), auto_refresh=False, transient=True)
        self._live.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._live.__exit__(kind, error, trace)

    def __call__(self, progress: T) -> None:
        """Draw it, but not faster than an eye can follow."""
        now = time.perf_counter()
        if now - self._drawn_at >= _REFRESH:
            self._drawn_at = now
            self._live.update(self._picture(progress), refresh=True)

    def _picture(self, progress: T) -> "Table":
        raise NotImplementedError
