"""A real Dask cluster on loopback, one of whose workers dies in the middle."""

import asyncio
import json
import logging
import subprocess
import sys
import time
from importlib.util import find_spec
from pathlib import Path

import pytest

from mdstopo.cli.group import run_group
from mdstopo.front.cluster import tell_lost_connections_in_our_words
from tests.front.support import CASE
from tests.front.test_fronts import assert_equal, contents

# to be looked for and not imported: only the process that runs these tests needs it
pytestmark = pytest.mark.skipif(find_spec("distributed") is None, reason="distributed is not installed")

#: enough members for a front that takes some seconds
LARGE = CASE.replace("count: 8}", "count: 40}").replace("count: 3}", "count: 20}").replace("equals: 7.2", "equals: 240")
LARGE = LARGE.replace("max_iterations: 40", "max_iterations: 15")
PATIENCE = 90.0
#: the one that is running
SCHEDULERS: list[subprocess.Popen] = []


def wait_for(what, process):
    end = time.monotonic() + PATIENCE
    while not what():
        assert process.poll() is None, "ended too early"
        assert time.monotonic() < end, "too slow"
        time.sleep(0.02)


@pytest.fixture
def cluster(tmp_path, monkeypatch):
    """The scheduler's address, and two workers that are processes of their own."""
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "scheduler.json"
    running = []

    def start(module, *words):
        log = (tmp_path / f"{module}.{len(running)}.log").open("w")
        with log:
            process = subprocess.Popen(
                [sys.executable, "-m", f"distributed.cli.{module}", *words, "--no-dashboard"], stdout=log, stderr=log
            )
        running.append(process)
        return process

    scheduler = start("dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(file))
    wait_for(lambda: file.exists() and file.read_text().endswith("}"), scheduler)
    address = json.loads(file.read_text())["address"]
    workers = [start("dask_worker", address, "--no-nanny", "--nthreads", "1") for _ in range(2)]
    SCHEDULERS[:] = [scheduler]
    yield address, workers
    for process in reversed(running):
        process.kill()
        process.wait()


def test_a_worker_that_dies_in_mid_sweep_costs_nothing_of_the_front(cluster):
    address, workers = cluster
    Path("probe.yaml").write_text(LARGE)
    command = [sys.executable, "-m", "mdstopo", "pareto", "probe.yaml", "--points", "7", "--quiet"]
    process = subprocess.Popen([*command, "--cluster", address, "--out", "cluster.h5"])
    wait_for(lambda: Path("cluster.h5").exists() and "pareto/tasks/key" in contents("cluster.h5"), process)
    workers[0].kill()
    assert process.poll() is None, "the front was done before the worker died"
    assert process.wait(timeout=PATIENCE) == 0
    assert workers[1].poll() is None
    assert subprocess.run([*command, "--workers", "1", "--out", "here.h5"], check=False).returncode == 0
    assert_equal("cluster.h5", "here.h5")
    assert len(contents("cluster.h5")["pareto/objectives"]) == 7


def test_a_sweep_runs_on_the_cluster_too(cluster):
    address, _ = cluster
    single = CASE.replace("  G2: {response: energy, load_case: translation}\n", "")
    Path("probe.yaml").write_text(single.replace("combine: {weights: {G1: 1, G2: 3}}\n", ""))
    words = ["sweep", "set", "probe.yaml", "members.belts.law.stiffness=3000:5000:1000", "--quiet"]
    assert run_group([*words, "--workers", "1", "--out", "here.h5"]) == 0
    command = [sys.executable, "-m", "mdstopo", *words, "--cluster", address, "--out", "cluster.h5"]
    assert subprocess.run(command, check=False, timeout=PATIENCE).returncode == 0
    assert_equal("cluster.h5", "here.h5")


def test_a_scheduler_that_dies_leaves_a_front_that_goes_on_without_it(cluster):
    address, _ = cluster
    Path("probe.yaml").write_text(LARGE)
    command = [sys.executable, "-m", "mdstopo", "pareto", "probe.yaml", "--points", "7", "--out", "front.h5"]
    process = subprocess.Popen([*command, "--cluster", address], stderr=subprocess.PIPE, text=True)
    wait_for(lambda: Path("front.h5").exists() and "pareto/tasks/key" in contents("front.h5"), process)
    SCHEDULERS[-1].kill()
    _, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert f"the Dask scheduler at {address} is gone" in said
    assert "Traceback" not in said
    assert subprocess.run([*command, "--resume", "--quiet"], check=False).returncode == 0


class BrokenComm:
    """A connection on which nothing can be sent."""

    def __init__(self, error):
        self.error = error

    async def write(self, *payload, **more):
        raise self.error

    def closed(self):
        return False

    def abort(self):
        pass


class Noted(logging.Handler):
    def __init__(self):
        super().__init__()
        self.records = []

    def emit(self, record):
        self.records.append(record)


@pytest.fixture
def logged():
    """What Dask's client logs; its loggers pass nothing on to pytest."""
    handler = Noted()
    logger = logging.getLogger("distributed")
    logger.addHandler(handler)
    yield handler.records
    logger.removeHandler(handler)


def test_a_connection_that_is_lost_while_sending_is_told_once_and_other_errors_as_dask_does(logged):
    """The scheduler of the test above seldom dies at just that moment."""
    from distributed.batched import BatchedSend
    from distributed.comm import CommClosedError

    async def send(error):
        sender = BatchedSend(interval="1ms")
        sender.start(BrokenComm(error))
        sender.send("a task")
        await sender.stopped.wait()

    tell_lost_connections_in_our_words()
    asyncio.run(send(CommClosedError("closed")))
    client = logging.getLogger("distributed.client")
    client.error("Failed to reconnect to scheduler after %.2f seconds", 10.0)
    try:
        raise OSError("cannot connect") from CommClosedError("refused")
    except OSError as error:
        client.exception(error)
    try:
        raise asyncio.CancelledError
    except asyncio.CancelledError as error:
        client.exception(error)
    assert not logged
    asyncio.run(send(TypeError("cannot be sent")))
    try:
        raise KeyError("callback")
    except KeyError:
        client.exception("Error in callback")
    assert [record.getMessage() for record in logged] == ["Error in batched write", "Error in callback"]
