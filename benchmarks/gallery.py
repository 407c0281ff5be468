"""The gallery: small problems, each with a picture, its case and what it teaches. `python -m benchmarks.gallery`

Every case of `gallery/` is optimised where there is something to choose, else simulated; its picture goes to
docs/images/gallery, and docs/gallery.md is written anew. NAMES on the command line make the pictures of these alone.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

from mdstopo.case.model import Case
from mdstopo.case.reader import load_case
from mdstopo.cli.group import run_group
from mdstopo.plots.layout_plot import draw
from mdstopo.plots.source import Source
from mdstopo.plots.style import save, styled

ROOT = Path(__file__).parent.parent
CASES, PAGE, PICTURES = ROOT / "gallery", ROOT / "docs" / "gallery.md", ROOT / "docs" / "images" / "gallery"
#: states in a picture
STATES = 4
_HEAD = """# Gallery

Small problems, each with what it teaches and its whole case. `make gallery` computes them and draws these pictures: the
motion in {states} states, from faint to full. Try one:

    mdstopo run gallery/crate.yaml          # where members or parameters are to be chosen
    mdstopo simulate gallery/pendulum.yaml  # where a motion is all

<!-- Written by benchmarks/gallery.py; edit the cases in gallery/ and run `make gallery`. -->
"""


def cases() -> list[Path]:
    """The case files, planar ones first."""
    return sorted(CASES.glob("*.yaml"), key=lambda path: (path.stem.startswith("space"), path.stem))


def taught(path: Path) -> str:
    """The comment at the top of a case."""
    lines = path.read_text(encoding="utf-8").splitlines()
    top = lines[: next(k for k, line in enumerate(lines) if not line.startswith("#"))]
    return " ".join(line.removeprefix("#").strip() for line in top)


def command_of(case: Case) -> str:
    """What computes it."""
    return "run" if case.is_optimizable else "simulate"


def compute(path: Path, folder: Path) -> Path:
    """The result file of a case. Raises SystemExit where it fails."""
    out = folder / f"{path.stem}.h5"
    case = load_case(path)
    status = run_group([command_of(case), str(path), "--quiet", "--overwrite", "--out", str(out)])
    if status:
        raise SystemExit(f"{path}: ended with {status}")
    return out


def picture(result: Path, out: Path) -> None:
    """The motion in a few states, one over the other."""
    with styled() as module:
        source = Source(result)
        span = source.case.load_cases[0]
        times = tuple(np.linspace(span.start, span.end, STATES).tolist())
        save(draw(module, source, times=times, overlay=True), out)


def page() -> str:
    """The page of all cases."""
    parts = [_HEAD.format(states=STATES)]
    for path in cases():
        text = path.read_text(encoding="utf-8")
        title = load_case(path).title
        body = "".join(line for line in text.splitlines(keepends=True) if not line.startswith("#"))
        block = "".join(f"    {line}" if line.strip() else line for line in body.splitlines(keepends=True))
        parts.append(
            f"## {title}\n\n{taught(path)}\n\n![{title}](images/gallery/{path.stem}.svg)\n\n"
            f'??? example "gallery/{path.name}"\n\n    ```yaml\n{block}    ```\n'
        )
    return "\n".join(parts)


def main(names: list[str]) -> None:
    """Pictures of the named cases, of all where none is named; then the page."""
    with tempfile.TemporaryDirectory() as folder:
        for path in cases():
            if not names or path.stem in names:
                picture(compute(path, Path(folder)), PICTURES / f"{path.stem}.svg")
                print(path.stem, flush=True)
    PAGE.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
