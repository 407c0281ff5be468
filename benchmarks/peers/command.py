"""What `mdstopo bench work-precision --peers` does."""

from collections.abc import Callable, Iterator
from pathlib import Path

from benchmarks.peers.picture import draw
from benchmarks.peers.sections import Group, case_groups, compared, paper_groups
from benchmarks.peers.translate import NotForPeersError
from mdstopo.bench.tables import Table
from mdstopo.case.model import Case
from mdstopo.case.text.errors import CaseError


def comparison(case: Case | None, tell: Callable[[str], None], picture: Path | None) -> Iterator[Table]:
    """Tables of a case, or of the paper's scenes, and a picture of them where one is wanted.

    Raises CaseError for a case that the other programs are not written for.
    """
    known: list[Group] = []

    def kept(groups: Iterator[Group]) -> Iterator[Group]:
        for group in groups:
            known.append(group)
            yield group

    if case is None:
        yield from compared(kept(paper_groups(tell)))
    else:
        try:
            yield from compared(kept(case_groups(case, tell)))
        except NotForPeersError as error:
            message = f"the other programs cannot compute it: {error}"
            raise CaseError([case.marks.mistake("", message)], str(case.path or case.name)) from None
    if picture is not None:
        draw(known, picture)
