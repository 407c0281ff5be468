"""The command: `python -m benchmarks [SECTION ...]`."""

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path

from benchmarks.outside import outside
from benchmarks.readme import replace_block, write_five_rows, write_pages
from mdstopo.bench.machine import description
from mdstopo.bench.tables import Table

#: each section is a module with a function of the same name that yields tables
SECTIONS = {
    "speed": "objective and exact gradient: error against time; what finding a peak costs",
    "process": "the whole process: start, 50 iterations, file; help; the first run",
    "bars": "what the optimiser reaches within how many evaluations",
    "orders": "orders of convergence, agreement of methods, drift",
    "priced": "candidates that are priced beside all of them built: prices, optima, times; more than 1e8 of them",
    "catalogue": "sizes chosen from a catalogue by branch and bound beside the best of all choices",
    "chain": "cost of a step against the number of jointed bodies",
    "space": "objective and exact gradient of a scene in the plane and in space, of a thousand members and a million",
    "profile": "where the time of the applications goes: force sums by what they are for, and milliseconds",
    "lifts": "every planar case of the project beside itself in space: values and gradients",
    "rows": "cost of many competing peaks and members, whose gradients are pulled back in one sweep",
    "applications": "the applications: what a run finds, whether it holds, and a hand design beside it",
    "securing": "cargo on a ship's deck: the hand calculation of the Code beside the motion",
    "bound": "bounds over all members beside closed forms, and beside random designs of random scenes",
    "fit": "fits of synthetic measurements: how often intervals hold the truth; work beside differences",
    "formulas": "laws by formula beside the built-in laws: values, gradients, time",
    "chains": "springs between free bodies by their own kernels and by those of general scenes",
    "fronts": "fronts: hypervolume for how much work, beside a genetic algorithm; two processes (needs the extra ga)",
    "optimum": "does the optimiser find the optimum, is its last word true; beside other optimisers",
    "peers": "the paper's scene and others beside other programs, which the extra peers installs",
    "ring": "a closed loop of bodies beside other programs, forward runs too",
    "forward": "forward runs of the paper's bodies beside other programs",
    "peers_space": "two bodies in space with 1,020 springs beside other programs",
    "ring_space": "a closed loop of bodies in space beside other programs, forward runs too",
    "forward_space": "forward runs of two bodies in space beside other programs",
    "seat": "the seated occupant of the restraint case, with contacts and slack, beside JAX",
    "million": "a million members beside JAX",
    "parts": "what parts of our own save: powers, counting (compiles for minutes)",
    "golden": "what differs to the bit from values, gradients and iterates kept before (--check FILE, --write FILE)",
    "damage": "500 kills and 1,000 damages of result files, caches and locks: nothing is lost, nothing hangs",
    "hunt": "random scenes against a second model, differences, invariances and the error estimates (--minutes)",
    "hunt_space": "the same with scenes in space",
}

#: what compares with other programs is no part of a run without names: they compile for minutes
PEERS = ("peers", "ring", "forward", "seat", "million")

#: the same with scenes in space
PEERS_IN_SPACE = ("peers_space", "ring_space", "forward_space")

#: what looks for mistakes instead of measuring
CAMPAIGNS = ("damage", "hunt", "hunt_space")

#: sections that take an hour, or measure nothing, are run where they are named
NAMED = (*PEERS, *PEERS_IN_SPACE, *CAMPAIGNS, "optimum", "parts", "golden", "lifts", "priced", "catalogue", "chains")

#: the page that holds the tables of each section which `--readme` writes
PAGES = {
    "speed": "docs/performance.md",
    "process": "docs/performance.md",
    "bars": "docs/performance.md",
    "orders": "docs/accuracy.md",
    "chain": "docs/performance.md",
    "space": "docs/performance.md",
    "profile": "docs/performance.md",
    "fronts": "docs/performance.md",
}
#: the same of sections that `--pages` writes
TOLD = {
    "fit": "docs/fitting.md",
    "formulas": "docs/expressions.md",
    "bound": "docs/theory/bound.md",
    "catalogue": "docs/catalogue.md",
    "priced": "docs/theory/pricing.md",
    "securing": "docs/applications/cargo.md",
    "chains": "docs/architecture.md",
}


def main() -> int:
    """Measure, print, and on demand put the tables into the documentation."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description="Measure what the documentation says about accuracy and speed.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="sections:\n" + "\n".join(f"  {name:12} {what}" for name, what in SECTIONS.items()),
    )
    parser.add_argument(
        "sections", nargs="*", metavar="SECTION", help="default: all but other programs, campaigns and optimum"
    )
    parser.add_argument("--peers", metavar="DIR", help="a folder of other programs to compare with, with its bench.py")
    parser.add_argument("--peers-python", default=sys.executable, metavar="FILE", help="interpreter that runs them")
    parser.add_argument("--minutes", type=float, default=10.0, metavar="M", help="how long to hunt (default: 10)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="the first scene of a hunt (default: 0)")
    parser.add_argument("--check", type=Path, metavar="FILE", help="golden: compare with what is kept in FILE")
    parser.add_argument("--write", type=Path, metavar="FILE", help="golden: keep what is computed now in FILE")
    parser.add_argument(
        "--readme",
        action="store_true",
        help="write the tables into docs/performance.md and docs/accuracy.md, five of their rows into README.md",
    )
    parser.add_argument(
        "--pages",
        action="store_true",
        help="write the tables of applications, bounds and other programs into docs, designs into cases/designs",
    )
    parser.add_argument("--only", metavar="NAME", action="append", help="applications: this one alone; may be repeated")
    chosen = parser.parse_args()
    unknown = [name for name in chosen.sections if name not in SECTIONS]
    if unknown:
        parser.error(f"no section {', '.join(unknown)}; there are: {', '.join(SECTIONS)}")
    sections = chosen.sections or ([] if chosen.peers else [name for name in SECTIONS if name not in NAMED])
    machine = f"Measured on: {description()}."
    print(machine + "\n", flush=True)
    for table in outside(chosen.peers, chosen.peers_python) if chosen.peers else ():
        print(table.markdown(), flush=True)
    for name in sections:
        began = time.perf_counter()
        printed, summary = [], []
        for table in _tables(name, chosen):
            text = table.markdown()
            printed.append(text)
            if not table.detail:
                summary.append(text)
            print(text, flush=True)
        print(f"({name}: {time.perf_counter() - began:.0f} s)\n", flush=True)
        if chosen.readme and name in PAGES:
            replace_block(Path(PAGES[name]), name, "\n".join([*printed, machine]))
        if chosen.pages and name == "applications":
            write_pages(printed, machine, chosen.only)
        if chosen.pages and name in TOLD:
            replace_block(Path(TOLD[name]), name, "\n".join([*printed, machine]))
        if chosen.pages and name in (*PEERS, *PEERS_IN_SPACE):
            replace_block(Path("docs/comparison.md"), name, "\n".join([*summary, machine]))
    if chosen.readme:
        write_five_rows()
    return 0


def _tables(name: str, chosen: argparse.Namespace) -> Iterator[Table]:
    module = "benchmarks.peers.sections" if name in (*PEERS, *PEERS_IN_SPACE) else f"benchmarks.{name}"
    section: Callable[..., Iterator[Table]] = getattr(import_module(module), name)
    if name in ("hunt", "hunt_space"):
        return section(chosen.minutes, chosen.seed)
    if name == "golden":
        return section(chosen.check, chosen.write)
    if name == "applications":
        return section(chosen.only, Path("cases/designs") if chosen.pages else None)
    return section()


if __name__ == "__main__":
    sys.exit(main())
