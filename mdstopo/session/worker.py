"""The other end of `workers`: `python -m mdstopo.session.worker`, spoken to over its standard streams."""

import os
import pickle
import queue
import threading
from typing import IO, Any

from mdstopo.optimizer.state import State
from mdstopo.session.combining import even, problem_of
from mdstopo.session.crew import streams
from mdstopo.session.ready import get_ready
from mdstopo.session.stages import run_stages
from mdstopo.store.checkpoint import Checkpointer


def main() -> None:
    """Read the case, then one start after another, until the input is closed."""
    source, output = streams()
    case, initial, make_engine, scalarisation = pickle.load(source)
    inbox: queue.Queue[Any] = queue.Queue()
    stopped = threading.Event()
    threading.Thread(target=_listen, args=(source, inbox, stopped), daemon=True).start()
    engine = make_engine(case)
    get_ready(case, engine, problem_of(engine, even(case)), initial)
    problem = problem_of(engine, scalarisation)
    while (message := inbox.get()) is not None:
        task, arrays = message
        sender = _Sender(output)
        state = None if arrays is None else State.from_arrays(arrays)
        last = run_stages(case, make_engine, problem, task, state, initial, sender.keep, stopped.is_set)
        sender.send("done", task.index, last)
        if stopped.is_set():
            return


class _Sender:
    """Sends states as often as a checkpoint would be written."""

    def __init__(self, output: IO[bytes]) -> None:
        self._output = output
        self._latest: tuple[int, State] | None = None
        self._timer = Checkpointer(self._send_latest)

    def keep(self, index: int, state: State) -> None:
        self._latest = (index, state)
        self._timer.offer()

    def send(self, kind: str, index: int, state: State | None) -> None:
        pickle.dump((kind, index, None if state is None else state.to_arrays()), self._output)
        self._output.flush()

    def _send_latest(self) -> None:
        if self._latest is not None:
            self.send("state", *self._latest)


def _listen(source: IO[bytes], inbox: "queue.Queue[Any]", stopped: threading.Event) -> None:
    while True:
        try:
            inbox.put(pickle.load(source))
        except (EOFError, OSError, pickle.UnpicklingError):
            # The parent closed the input: it wants to stop, or is gone.
            stopped.set()
            inbox.put(None)
            return


if __name__ == "__main__":
    try:
        main()
    except BrokenPipeError:
        os._exit(1)
