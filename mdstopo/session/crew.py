"""Processes beside this one: fresh interpreters that are given pickled messages and send some back.

They ignore the terminal's Ctrl-C and end when their input is closed, so that they neither spoil a clean stop nor
outlive a killed parent.
"""

import os
import pickle
import queue
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from typing import IO, Any

from mdstopo.children import command
from mdstopo.compiler.threads import VARIABLE, cores


def streams() -> tuple[IO[bytes], IO[bytes]]:
    """In a worker: where messages come from and where answers go. Signals are for the parent to act on."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    # Whatever prints by mistake must not disturb the messages.
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    return sys.stdin.buffer, answers


class WorkerProcess:
    """One process that runs a module, and a thread that listens to it.

    Messages arrive in `inbox` as (this, message), None once it has ended. crew: how many share the machine's cores.
    """

    def __init__(self, module: str, job: object, crew: int, inbox: "queue.Queue[tuple[WorkerProcess, Any]]") -> None:
        threads = str(max(1, cores() // crew))
        self._process = subprocess.Popen(
            command(module),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, "NUMBA_NUM_THREADS": threads, VARIABLE: threads},
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._input: IO[bytes] = self._process.stdin
        self._output: IO[bytes] = self._process.stdout
        self._inbox = inbox
        self.busy = False
        self.pid = self._process.pid
        self.send(job)
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    def send(self, message: object) -> None:
        """Give it a message; where it is gone, the listener says so."""
        with suppress(BrokenPipeError, ValueError):
            pickle.dump(message, self._input)
            self._input.flush()

    def stop(self) -> None:
        """Ask it to end after what it is at."""
        with suppress(BrokenPipeError):
            self._input.close()

    def close(self) -> None:
        """Let it end; end it if it does not."""
        self.stop()
        try:
            self._process.wait(timeout=5.0)
        except subprocess.TimeoutExpired:
            self.kill()
        self._listener.join()

    def kill(self) -> None:
        """End it at once."""
        self._process.kill()
        self._process.wait()
        self.stop()
        self._listener.join()

    def _listen(self) -> None:
        with self._output:
            while True:
                try:
                    message = pickle.load(self._output)
                except (EOFError, OSError, ValueError, pickle.UnpicklingError):
                    message = None
                self._inbox.put((self, message))
                if message is None:
                    return
