"""The pictures of the pages of the applications: `python -m benchmarks.pictures [NAME ...] [--fronts]` draws them.

Designs are those of `cases/designs`; fronts are computed, which takes minutes each, only with `--fronts`.
"""

import sys
from collections.abc import Iterator
from pathlib import Path
from subprocess import run
from tempfile import TemporaryDirectory

from benchmarks.applications import APPLICATIONS
from benchmarks.scenes import CASES

IMAGES = Path(__file__).resolve().parent.parent / "docs" / "images"

#: pictures of the motion: application, load case, time in s, end of the name
MOMENTS = {"restraint": ("forward", 0.13, "far"), "lander": ("level", 0.206, "deep")}
#: points of a front and iterations of each of its solves
FRONTS = {"restraint": (3, 40), "tiedown": (5, 40), "mooring": (3, 60), "lander": (5, 40)}


def commands(name: str, folder: Path, fronts: bool) -> Iterator[list[str]]:
    """The command lines, without `mdstopo`, that draw the pictures of an application."""
    case, still = str(CASES / f"{name}.yaml"), "optimizer.max_iterations=0"
    design = ["--alpha", str(CASES / "designs" / f"{name}.txt")]
    for end, start in (("candidates", []), ("design", design)):
        result = str(folder / f"{end}.h5")
        yield ["run", case, *start, "--set", still, "--set", "combine.normalize=false", "--out", result, "--quiet"]
        yield ["plot", result, "layout", "--out", str(IMAGES / f"{name}-{end}.svg")]
    if name in MOMENTS:
        load_case, time, end = MOMENTS[name]
        where = ["--load-case", load_case, "--time", f"{time:g}"]
        yield ["plot", str(folder / "design.h5"), "layout", *where, "--out", str(IMAGES / f"{name}-{end}.svg")]
    if fronts:
        points, iterations = FRONTS[name]
        result, limit = str(folder / "front.h5"), f"optimizer.max_iterations={iterations}"
        yield ["pareto", case, "--points", str(points), "--method", "nbi", "--set", limit, "--out", result]
        yield ["plot", result, "front", "--out", str(IMAGES / f"{name}-front.svg")]


def main(asked: list[str]) -> None:
    """Draw them; an unknown name is a KeyError."""
    names = [name for name in asked if name != "--fronts"] or list(APPLICATIONS)
    for name in names:
        with TemporaryDirectory() as folder:
            for line in commands(name, Path(folder), "--fronts" in asked):
                run([sys.executable, "-m", "mdstopo", *line], check=True)


if __name__ == "__main__":
    main(sys.argv[1:])
