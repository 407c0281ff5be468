"""Numbers in the README, and in pages of the documentation, stand between marks; only this module writes there."""

import re
from collections.abc import Sequence
from pathlib import Path

README, PERFORMANCE, COMPARISON = Path("README.md"), Path("docs/performance.md"), Path("docs/comparison.md")
#: the mark of the README's five rows
FIVE = "five rows"
#: how other programs write their names
PROPER = {"jax": "JAX", "casadi": "CasADi", "scipy": "SciPy"}


def replace_block(path: Path, name: str, text: str) -> None:
    """Put text between `<!-- benchmarks: name -->` and `<!-- end -->`; ValueError where the marks are missing."""
    begin, end = f"<!-- benchmarks: {name} -->", "<!-- end -->"
    whole = path.read_text(encoding="utf-8")
    pattern = re.compile(re.escape(begin) + r".*?" + re.escape(end), re.DOTALL)
    if not pattern.search(whole):
        raise ValueError(f"{path} has no block {begin} ... {end}")
    path.write_text(pattern.sub(lambda _: f"{begin}\n\n{text.strip()}\n\n{end}", whole, count=1), encoding="utf-8")


def write_pages(tables: list[str], machine: str, names: Sequence[str] | None = None) -> None:
    """Put the tables of `applications` into the pages of these (None: of all): equally many for each."""
    from benchmarks.applications import APPLICATIONS, TABLES

    for i, name in enumerate(names or APPLICATIONS):
        own = tables[i * TABLES : (i + 1) * TABLES]
        replace_block(Path(f"docs/applications/{name}.md"), name, "\n".join([*own, machine]))


def write_five_rows() -> None:
    """Put five rows of the tables of the documentation into the README, as the pages have them now."""
    pages = [page.read_text(encoding="utf-8") for page in (PERFORMANCE, COMPARISON)]
    replace_block(README, FIVE, five_rows(*pages))


def five_rows(performance: str, comparison: str) -> str:
    """The README's table, from the tables of two pages: what, how long, and the command that measures it.

    Raises KeyError where a page has no such row any more.
    """
    speed = row(performance, "Objective and exact gradient, 1020 members", "fig6, uniform", "1e-08", "gauss")
    other = row(comparison, "Objective and exact gradient beside the fastest peer", "fig6, uniform", "1e-08")
    process = row(performance, "The whole process, cases/fig6.yaml", "warm `mdstopo run`")
    chain = row(performance, "A hanging chain: time of a step, ms", "1000")
    front = row(performance, "Fronts of cases/fig7.yaml, 21 points", "volume spent", "nbi")
    peer = PROPER.get(other["fastest peer"], other["fastest peer"])
    rows = [
        (
            "objective and exact gradient, 1,020 members, error at most 1e-8",
            median(speed["ms"]),
            "ms",
            "bench",
            "speed",
        ),
        (f"the same in {peer}, the fastest other program measured", other["its ms"], "ms", "peers", "peers"),
        ("`mdstopo run cases/fig6.yaml`, start to file", median(process["seconds"]), "s", "bench", "process"),
        ("a step of a chain of 1,000 jointed bodies", chain["generalized_alpha"], "ms", "bench", "chain"),
        ("a Pareto front of 21 points, 1,020 members", front["seconds"], "s", "bench", "fronts"),
    ]
    lines = [f"| {what} | {time} {unit} | `make {by} SECTIONS={section}` |" for what, time, unit, by, section in rows]
    return "\n".join(["| what | time | measured by |", "| --- | --- | --- |", *lines])


def row(page: str, title: str, begins: str, *others: str) -> dict[str, str]:
    """The cells, by column, of the first row of a page's table that begins so and has these cells as well.

    A column is named by what stands before its first comma; the second column of one name is `its ...`.
    """
    table = page.partition(f"### {title}\n")[2].partition("\n### ")[0]
    lines = [[cell.strip() for cell in line.strip("|").split(" | ")] for line in table.splitlines() if line[:1] == "|"]
    for cells in lines[2:]:
        if cells[0].startswith(begins) and set(others) <= set(cells):
            found: dict[str, str] = {}
            for column, cell in zip(lines[0], cells, strict=True):
                name = column.partition(",")[0]
                found[f"its {name}" if name in found else name] = cell
            return found
    raise KeyError(f"{title}: no row {begins}, {', '.join(others)}")


def median(cell: str) -> str:
    """The median in a cell that has the least and the most behind it."""
    return cell.partition(" (")[0]
