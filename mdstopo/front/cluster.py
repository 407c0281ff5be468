"""Pieces of work on a Dask cluster: `--cluster tcp://host:8786`, with the extra `cluster`.

The scheduler is Dask's, and so is what happens to pieces whose worker dies: they are given to another one.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from mdstopo.front.jobs import Job, Setting, perform
from mdstopo.front.pool import PATIENCE
from mdstopo.store.errors import StoreError


class Cluster:
    """Workers of a running Dask cluster. They need this version of mdstopo."""

    def __init__(self, setting: Setting, stop: Callable[[], bool], address: str) -> None:
        try:
            from distributed import Client
        except ImportError as error:
            raise StoreError("--cluster needs Dask: pip install 'mdstopo[cluster]'") from error
        self._stop = stop
        try:
            self._client = Client(address, timeout=10, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            raise StoreError(f"no Dask scheduler answers at {address}: {error}") from error
        self._setting = self._client.scatter(setting, broadcast=True)

    def results(self, jobs: Sequence[Job]) -> Iterator[tuple[int, Any]]:
        """As they are done."""
        from distributed import wait

        futures = {
            self._client.submit(perform, self._setting, job, pure=False, retries=2): place
            for place, job in enumerate(jobs)
        }
        open_ones = set(futures)
        while open_ones:
            if self._stop():
                self._client.cancel(list(open_ones))
                return
            try:
                done = wait(open_ones, timeout=PATIENCE, return_when="FIRST_COMPLETED").done
            except TimeoutError:
                continue
            for future in sorted(done, key=lambda each: futures[each]):
                open_ones.discard(future)
                yield futures[future], future.result()

    def close(self) -> None:
        """Leave the cluster to itself."""
        self._client.close()
