"""The notebook of the documentation, docs/notebook.ipynb: `python -m documentation.notebook` runs it and writes it.

Its cells stand here, so that they can be read and changed as text. Needs nbclient and ipykernel.
"""

from importlib import import_module
from pathlib import Path
from typing import Any

PLACE = Path(__file__).resolve().parent.parent / "docs" / "notebook.ipynb"
#: what is run is in a line of its own; what is not begins with `md`
CELLS = (
    "md# mdstopo in a notebook\n\nTwo bodies, 1,020 candidate belts between them: which are kept?",
    "import mdstopo\n\ncase = mdstopo.load_case('fig6')\ncase",
    "md## One design\n\nThe motion of the initial design, all belts at a tenth; then the energy that the belts\n"
    "store, and the exact derivative by each of them.",
    "motion = mdstopo.simulate(case)\nmotion",
    "evaluation = mdstopo.evaluate(case)\nevaluation",
    "md## The best design\n\nA tenth of the material is shared out anew.",
    "result = mdstopo.optimize(case)\nresult",
    "md## As a function\n\nFor optimisers and frameworks that are not ours.",
    "from mdstopo.functions import Responses\n\nresponses = Responses(case)\n"
    "values, slopes = responses.at(result.alpha)\n"
    "dict(zip(responses.names, values.round(6).tolist(), strict=True)), slopes.shape",
)


def write() -> None:
    """Run the cells in a fresh kernel, and write them with what they show."""
    nbformat: Any = import_module("nbformat")
    client: Any = import_module("nbclient")
    cells = []
    for number, text in enumerate(CELLS):
        make = nbformat.v4.new_markdown_cell if text.startswith("md") else nbformat.v4.new_code_cell
        cells.append(make(text.removeprefix("md"), id=f"cell-{number}"))
    notebook = nbformat.v4.new_notebook(cells=cells)
    client.NotebookClient(notebook, timeout=600, kernel_name="python3").execute()
    for cell in notebook.cells:
        cell.metadata.clear()  # when it was run
    PLACE.write_text(nbformat.writes(notebook) + "\n", encoding="utf-8")


if __name__ == "__main__":
    write()
