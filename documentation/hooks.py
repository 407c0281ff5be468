"""What mkdocs calls while it builds the pages.

A line `<!-- keys: bodies -->` in a page becomes the keys of that part of a case (`<!-- keys: case -->`: of the whole),
`<!-- commands -->` the commands, `<!-- exit statuses -->` what they end with. Formulas become MathML. CHANGELOG.md
becomes a page, the JSON Schema of a case and a font for formulas become files beside the pages.
"""

import json
import re
import sys
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:  # mkdocs loads this file alone
    sys.path.insert(0, str(ROOT))

from documentation import array_tables, command_pages, maths  # noqa: E402
from mdstopo.case.schema import key_tables  # noqa: E402
from mdstopo.case.schema.json_schema import json_schema  # noqa: E402

_MARK = re.compile(r"^<!-- (keys|keys in space|arrays|commands|exit statuses)(?:: (\w+))? -->$", re.MULTILINE)


def on_files(files: Files, *, config: MkDocsConfig) -> Files:
    """Add what has no file of its own in `docs`."""
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    schema = json.dumps(json_schema(), indent=2, ensure_ascii=False)
    files.append(File.generated(config, "changelog.md", content=changelog))
    files.append(File.generated(config, "case.schema.json", content=schema))
    files.append(File.generated(config, "assets/math.ttf", abs_src_path=str(maths.font())))
    return files


def on_page_markdown(markdown: str, *, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Put what is generated in the place of its mark."""
    return expanded(markdown)


def on_page_content(html: str, *, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Turn formulas into MathML."""
    try:
        return maths.with_mathml(html)
    except maths.FormulaError as error:
        raise PluginError(f"{page.file.src_uri}: {error}") from error


def expanded(markdown: str) -> str:
    """A page with every mark replaced."""
    return _MARK.sub(_generated, markdown)


def _generated(mark: re.Match[str]) -> str:
    if mark[1] == "keys":
        return key_tables.keys_of("" if mark[2] == "case" else mark[2] or "")
    if mark[1] == "keys in space":
        return key_tables.keys_in_space(mark[2] or "")
    if mark[1] == "arrays":
        return array_tables.table_of(mark[2] or "")
    return command_pages.commands() if mark[1] == "commands" else command_pages.exit_statuses()
