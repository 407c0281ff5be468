"""The command: `python -m benchmarks.optimum [--problems NAME ...] [--parts PART ...]`."""

import argparse
import sys
from pathlib import Path

from benchmarks.optimum import problems, race, tables
from benchmarks.readme import replace_block
from mdstopo.bench.machine import description

#: where `--pages` puts the tables
PAGE = Path("docs/optimum.md")


def main() -> int:
    """Judge the optimiser, or make anew what it is judged by."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.optimum", description="Judge the optimiser.")
    parser.add_argument("--problems", nargs="+", metavar="NAME", help="those whose names begin so; default: all")
    parser.add_argument("--parts", nargs="+", choices=tables.PARTS, default=tables.PARTS, help="default: all")
    parser.add_argument("--exact", action="store_true", help="solve the cone programs again (needs the extra optimum)")
    parser.add_argument(
        "--other-solvers", action="store_true", help="run the other optimisers again (needs the extra optimum)"
    )
    parser.add_argument("--starts", type=int, default=race.STARTS, metavar="N", help="of each optimiser")
    parser.add_argument("--budget", type=int, default=race.BUDGET, metavar="N", help="evaluations of each start")
    parser.add_argument(
        "--iterations", nargs="+", type=int, default=tables.ITERATIONS, metavar="N",
        help="limits of iterations at which last words are judged; values are those of the first",
    )  # fmt: skip
    parser.add_argument("--pages", action="store_true", help=f"write the tables into {PAGE}")
    chosen = parser.parse_args()
    try:
        picked = problems.named(chosen.problems)
    except ValueError as error:
        parser.error(str(error))
    if chosen.exact:
        problems.write_exact(picked)
        return 0
    if chosen.other_solvers:
        race.write_other_solvers(picked, chosen.starts, chosen.budget)
        return 0
    machine = f"Measured on: {description()}."
    print(machine + "\n", flush=True)
    for part in chosen.parts:
        printed = []
        for table in tables.everything(chosen.problems, [part], chosen.starts, chosen.budget, chosen.iterations):
            printed.append(table.markdown())
            print(printed[-1], flush=True)
        if chosen.pages and printed:
            replace_block(PAGE, part, "\n".join([*printed, machine]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
