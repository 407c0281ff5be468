"""The command: `python -m reproduce [ITEM ...]`."""

import argparse
import sys
import time
from pathlib import Path

from reproduce.convergence import figure_6
from reproduce.desk import ROOT, Desk, Item
from reproduce.front import figure_7, figure_8
from reproduce.page import page
from reproduce.sensitivities import figure_4, figure_5
from reproduce.timing import timing

ITEMS = (
    Item("fig4", "Figure 4: sensitivities at t_n", figure_4, ("fig4.png",)),
    Item("fig5", "Figure 5: sensitivities over time", figure_5, ("fig5.png",)),
    Item("fig6", "Figure 6: convergence", figure_6, ("fig6.png", "fig6.h5")),
    Item("timing", "Times of an iteration", timing, ("timing.txt",)),
    Item("fig7", "Figure 7: the front", figure_7, ("fig7-direct.png", "fig7-iterative.png", "fig7-direct.h5")),
    Item("fig8", "Figure 8: the 0.5/0.5 design", figure_8, ("fig8.png", "fig8-layout.png"), ("fig7",)),
)


def main() -> int:
    """Make what is not made yet, then the page."""
    parser = argparse.ArgumentParser(prog="python -m reproduce", description="Every figure and table of the paper.")
    parser.add_argument("items", nargs="*", metavar="ITEM", help=f"of {', '.join(item.name for item in ITEMS)}")
    parser.add_argument("--out", type=Path, default=ROOT / "results", metavar="FOLDER")
    chosen = parser.parse_args()
    names = [item.name for item in ITEMS]
    unknown = [name for name in chosen.items if name not in names]
    if unknown:
        parser.error(f"no item {', '.join(unknown)}; there are: {', '.join(names)}")
    began = time.perf_counter()

    def say(line: str) -> None:
        print(line, flush=True)

    desk = Desk(chosen.out, say)
    made = 0
    for k, item in enumerate(ITEMS, start=1):
        if chosen.items and item.name not in chosen.items:
            continue
        if desk.is_done(item):
            continue
        say(f"[{k}/{len(ITEMS)}] {item.title}")
        start = time.perf_counter()
        desk.make(item)
        made += 1
        say(f"[{k}/{len(ITEMS)}] {item.title}: {time.perf_counter() - start:.1f} s")
    missing = [item.name for item in ITEMS if not desk.is_done(item)]
    if missing:
        say(f"not made yet: {', '.join(missing)}")
        return 0
    index = desk.path("index.html")
    if made or not index.exists():
        index.write_text(page(desk, ITEMS), encoding="utf-8")
        say(f"{made} items made in {time.perf_counter() - began:.0f} s; open {index}")
    else:
        say(f"nothing to do; open {index}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
