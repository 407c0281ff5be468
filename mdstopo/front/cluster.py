"""Pieces of work on a Dask cluster: `--cluster tcp://host:8786`, with the extra `cluster`.

Whoever can reach its scheduler or a worker can have it run anything, and so can the scheduler here: Dask trusts them
and the network between them. Where that is not to be trusted, use tls://host:8786: certificates are those of Dask's own
settings (DASK_DISTRIBUTED__COMM__TLS__CA_FILE, ..._TLS__CLIENT__CERT, ..._TLS__CLIENT__KEY).

The scheduler is Dask's, and so is what happens to pieces whose worker dies: they are given to another one.
"""

import asyncio
import logging
import queue
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from mdstopo._version import __version__
from mdstopo.front.jobs import Job, Setting, perform
from mdstopo.front.pool import Keep, ignore_both
from mdstopo.store.store_errors import StoreError
from mdstopo.workers.worker_pool import PATIENCE, Lost, WorkerError

#: s within which a scheduler has to answer
ANSWERING = 10.0
#: engines are for one thread at a time, and a Dask worker may have several
_one_at_a_time = threading.Lock()


def perform_alone(setting: Setting, job: Job) -> Any:
    """The result of one job; a process of the cluster does one after the other."""
    with _one_at_a_time:
        return perform(setting, job)


def _version() -> str:
    """The version of mdstopo in the process that this runs in."""
    try:
        from mdstopo._version import __version__ as found
    except ImportError:
        return ""
    return str(found)


def _is_no_lost_connection(record: logging.LogRecord) -> bool:
    """Whether a message of Dask tells of anything but a scheduler that does not answer any more.

    What ends its attempts to connect again is an error that was raised from a lost connection, or the client's end.
    """
    from distributed.comm.core import CommClosedError

    if str(record.msg).startswith("Failed to reconnect to scheduler"):
        return False
    error = record.exc_info[1] if record.exc_info else None
    while error is not None:
        if isinstance(error, CommClosedError | ConnectionError | TimeoutError | asyncio.CancelledError):
            return False
        error = error.__cause__ or error.__context__
    return True


def tell_lost_connections_in_our_words() -> None:
    """Leave out what Dask's client logs of a lost scheduler, with tracebacks; all else it goes on to tell.

    `distributed.batched` logs it only where something was being sent.
    """
    for name in ("distributed.client", "distributed.batched"):
        logging.getLogger(name).addFilter(_is_no_lost_connection)


class Cluster:
    """Workers of a running Dask cluster. They need this version of mdstopo."""

    at_once = 0

    def __init__(self, setting: Setting, stop: Callable[[], bool], address: str) -> None:
        try:
            from distributed import Client
        except ImportError as error:
            raise StoreError("--cluster needs Dask: pip install 'mdstopo[cluster]'") from error
        tell_lost_connections_in_our_words()
        self._stop = stop
        self._address = address
        if "://" not in address or ":" not in address.split("://")[1]:
            raise StoreError(f"no Dask scheduler answers at {address}: write it as tcp://host:8786")
        try:
            self._client = Client(address, timeout=ANSWERING, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            raise StoreError(f"no Dask scheduler answers at {address}: {error}") from error
        versions = self._client.run(_version)
        other = {address: found for address, found in versions.items() if found != __version__}
        if other:
            self._client.close()
            worker, found = next(iter(other.items()))
            raise StoreError(f"the worker at {worker} has mdstopo {found or 'not at all'}, this is {__version__}")
        # goes with every piece: what is scattered dies with the workers that hold it
        self._setting = setting

    def results(self, jobs: Sequence[Job], keep: Keep = ignore_both) -> Iterator[tuple[int, Any]]:
        """Results as they are done; missing ones are left out. Raises WorkerError where the scheduler is gone."""
        done: queue.Queue[Any] = queue.Queue()
        futures = {
            self._client.submit(perform_alone, self._setting, job, pure=False, retries=2): place
            for place, job in enumerate(jobs)
        }
        for future in futures:
            future.add_done_callback(done.put)
        left = len(futures)
        while left:
            if self._stop():
                self._client.cancel(list(futures))
                return
            try:
                future = done.get(timeout=PATIENCE)
            except queue.Empty:
                continue
            if future.cancelled():
                raise WorkerError(f"the Dask scheduler at {self._address} is gone; what is finished is saved")
            left -= 1
            error = future.exception()
            yield futures[future], future.result() if error is None else Lost(f"the cluster failed on it: {error}")

    def close(self) -> None:
        """Leave the cluster running, and give up the connection to it."""
        self._client.close()
