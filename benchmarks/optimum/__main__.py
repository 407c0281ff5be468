"""The command: `python -m benchmarks.optimum [--problems NAME ...]`."""

import argparse
import sys

from benchmarks.optimum import problems, tables
from mdstopo.bench.machine import description


def main() -> int:
    """Judge the optimiser, or make anew what it is judged by."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.optimum", description=__doc__)
    parser.add_argument("--problems", nargs="+", metavar="NAME", help="those whose names begin so; default: all")
    parser.add_argument("--exact", action="store_true", help="solve the cone programs again (needs the extra optimum)")
    chosen = parser.parse_args()
    try:
        picked = problems.named(chosen.problems)
    except ValueError as error:
        parser.error(str(error))
    if chosen.exact:
        problems.write_exact(picked)
        return 0
    print(f"Measured on: {description()}.\n", flush=True)
    for table in tables.everything(chosen.problems):
        print(table.markdown(), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
