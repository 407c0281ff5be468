"""Files as arguments: what a shell offers for them."""

import os
import re
from pathlib import Path

import click
from click.shell_completion import CompletionItem

#: in a name: what a shell must quote, so that completing it is left to the shell
_SPECIAL = re.compile(r"[^\w@%+=:,./-]")


class FileOf(click.Path):
    """The path of a file whose name has one of some endings; others are taken as well, but not offered."""

    def __init__(self, endings: tuple[str, ...]) -> None:
        super().__init__(path_type=Path)
        self.endings = endings

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Files with these endings, and folders; of a folder that is the only choice, what is in it."""
        folder, _, begun = incomplete.rpartition("/")
        place = f"{folder}/" if "/" in incomplete else ""
        while not _SPECIAL.search(place):
            names = self._fitting(place, begun)
            if any(_SPECIAL.search(name) for name in names):
                break
            if len(names) != 1 or not names[0].endswith("/"):
                return [CompletionItem(place + name) for name in names or [""] if place + name]
            place, begun = place + names[0], ""
        return [CompletionItem(incomplete, type="file")]

    def _fitting(self, place: str, begun: str) -> list[str]:
        """What in a folder begins so; folders end in a slash. Hidden ones only where a dot was typed."""
        try:
            entries = sorted(os.scandir(place or "."), key=lambda entry: entry.name)
        except OSError:
            return []
        entries = [each for each in entries if each.name.startswith(begun) and (begun or each.name[0] != ".")]
        folders = [f"{each.name}/" for each in entries if each.is_dir()]
        return [each.name for each in entries if each.name.endswith(self.endings) and each.is_file()] + folders


class CaseFile(FileOf):
    """The path of a case file, or the name of a case that comes with the package."""

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Files, and the names of cases that begin with what was typed."""
        found = super().shell_complete(ctx, param, incomplete)
        if not incomplete or "/" in incomplete:
            return found
        from mdstopo.case.text.shipped import names

        return found + [CompletionItem(name) for name in names() if name.startswith(incomplete)]
