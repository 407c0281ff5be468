"""Where the time of tests goes: `--times` writes it of each test, and a summary ends the run (`make test-times`).

Seconds of the processor, so that a busy machine changes little: of a test itself, of programs that it starts and waits
for, and of kernels compiled within it. What two tests share, a kernel or a fixture of a module, counts for the first
one. Seconds by the clock beside them show where something was waited for.
"""

import json
import os
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from mdstopo.compiler.entry import Entry

#: a line of JSON for each test, from the root of the project
FILE = "results/test-times.jsonl"
#: how many tests, files and entries a summary names
SHOWN = 40


class Spent(NamedTuple):
    """Seconds, and how many programs were begun."""

    clock: float
    own: float
    children: float
    programs: int
    compiled: float

    def since(self, before: "Spent") -> "Spent":
        """What has been spent since then."""
        return Spent(*(now - then for now, then in zip(self, before, strict=True)))


class Times:
    """Notes what each test of this process spends, and what it compiles."""

    def __init__(self) -> None:
        self._programs = 0
        self._compiled = 0.0
        self._entries: list[tuple[str, str, float]] = []
        self._begun: Spent = self._now()
        sys.addaudithook(self._hear)
        self._follow_entries()

    def _hear(self, event: str, _: Any) -> None:
        self._programs += event in ("subprocess.Popen", "os.posix_spawn", "os.fork")

    def _follow_entries(self) -> None:
        built = Entry._built

        def timed(entry: Entry, path: Path, types: str) -> Any:
            before = time.process_time()
            try:
                return built(entry, path, types)
            finally:
                spent = time.process_time() - before
                self._compiled += spent
                self._entries.append((f"{entry.__module__}.{entry.__name__}", types, spent))

        Entry._built = timed  # type: ignore[method-assign]

    def _now(self) -> Spent:
        used = os.times()
        children = used.children_user + used.children_system
        return Spent(time.perf_counter(), time.process_time(), children, self._programs, self._compiled)

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self) -> Iterator[None]:
        """Begin to count."""
        self._begun = self._now()
        self._entries = []
        return (yield)

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_makereport(self, item: pytest.Item, call: pytest.CallInfo[None]) -> None:
        """Give what was counted to the report that ends a test, which reaches the process that gives tests out."""
        if call.when == "teardown":
            item.user_properties.append(("times", [*self._now().since(self._begun), self._entries]))

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Tell that process what all of this one has taken."""
        output = getattr(session.config, "workeroutput", None)
        if output is not None:
            output["spent"] = [time.process_time(), *self._now()[2:]]


class Account:
    """Gathers what processes have noted, in the one that gives tests out."""

    def __init__(self, file: Path) -> None:
        self._file = file.open("w", encoding="utf-8", buffering=1)
        self._tests: list[dict[str, Any]] = []
        self._workers: list[float] = []

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Take what was spent on a test."""
        found = dict(report.user_properties).get("times") if report.when == "teardown" else None
        if found is not None:
            *spent, entries = found  # type: ignore[misc]
            self._tests.append({"test": report.nodeid, **Spent(*spent)._asdict(), "entries": entries})
            self._file.write(json.dumps(self._tests[-1]) + "\n")

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any) -> None:
        """Take what a process of tests has spent in all."""
        spent = getattr(node, "workeroutput", {}).get("spent")
        if spent is not None:
            self._workers.append(spent[0])

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        """Tell what takes most."""
        self._file.close()
        for line in self._lines():
            terminalreporter.write_line(line)

    def _lines(self) -> Iterator[str]:
        own, children, programs, compiled = (
            sum(each[key] for each in self._tests) for key in ("own", "children", "programs", "compiled")
        )
        yield f"seconds of the processor in {len(self._tests)} tests: {own + children:.1f}"
        yield f"  kernels compiled in processes of tests   {compiled:7.1f}"
        yield f"  programs that tests start, {programs:6d}         {children:7.1f}"
        yield f"  everything else that tests do            {own - compiled:7.1f}"
        if self._workers:
            yield f"beside tests, in {len(self._workers)} processes: {sum(self._workers) - own:.1f}"
        yield from _largest("tests", ((each["test"], each["own"] + each["children"]) for each in self._tests))
        files = ((each["test"].partition("::")[0], each["own"] + each["children"]) for each in self._tests)
        yield from _largest("files", files)
        entries = ((name, seconds) for each in self._tests for name, _, seconds in each["entries"])
        yield from _largest("entries compiled", entries)


def _largest(what: str, spent: Any) -> Iterator[str]:
    """Those with most seconds; what has one name is added up."""
    whole: dict[str, float] = defaultdict(float)
    for name, seconds in spent:
        whole[name] += seconds
    yield f"{what} that take most"
    for name, seconds in sorted(whole.items(), key=lambda each: -each[1])[:SHOWN]:
        yield f"  {seconds:7.2f}  {name}"


def add_option(parser: pytest.Parser) -> None:
    """Enter `--times`."""
    parser.addoption("--times", action="store_true", help=f"write of each test where its time went, into {FILE}")


def begin(config: pytest.Config) -> None:
    """Count, where that is asked for."""
    if not config.getoption("times"):
        return
    if hasattr(config, "workerinput") or not config.getoption("numprocesses", None):
        config.pluginmanager.register(Times())
    if not hasattr(config, "workerinput"):
        config.pluginmanager.register(Account(config.rootpath / FILE))
