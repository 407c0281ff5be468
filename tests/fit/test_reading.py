"""The section `fit` and the files that it names: what is read, and what is refused with its place."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from mdstopo.case.reader import load_case, read_case
from mdstopo.case.sections.measurements import read_measured
from mdstopo.case.text.errors import CaseError

from .scenes import DROP


def mistakes(text: str) -> list[str]:
    with pytest.raises(CaseError) as caught:
        read_case(text)
    return [f"{each.path_key}: {each.message}" for each in caught.value.mistakes]


def test_a_fit_is_read() -> None:
    fit = read_case(DROP).fit
    assert fit is not None
    assert [each.key for each in fit.numbers] == [
        "members.foam.law.stiffness", "members.foam.law.damping", "members.foam.law.gap",
    ]  # fmt: skip
    assert fit.numbers[0].range.initial == 6000.0
    (series,) = fit.series
    assert (series.file, series.deviation, series.response.component, series.load_case) == (
        "height.csv", 0.001, "y", "default",
    )  # fmt: skip
    assert not series.offset.is_free
    assert fit.confidence == 0.95


def test_the_case_says_where_a_fit_begins_else_the_middle() -> None:
    text = DROP.replace(", initial: 6000", "").replace("upper: 200, initial: 40", "upper: 10")
    fit = read_case(text).fit
    assert fit is not None
    assert [each.range.initial for each in fit.numbers[:2]] == [8000.0, 5.0]


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("law.damping: {", "law.dampin: {", "members.foam.law states no 'dampin', did you mean 'damping'?"),
        ("members.foam.law.gap: {", "solver.tolerance: {", "states no 'solver'"),
        ("members.foam.law.gap: {", "time.end: {", "time.end cannot be estimated: `time` says when"),
        ("members.foam.law.gap: {", "bodies.block: {", "what is estimated is one number"),
        ("lower: 0.02, upper: 0.08", "lower: 0.08, upper: 0.02", "found 0.08, allowed is a number below upper 0.02"),
        ("initial: 0.045", "initial: 0.1", "found 0.1, allowed is 0.02 to 0.08"),
        ("deviation: 0.001", "deviation: 0", "found 0, allowed is a number > 0"),
        ("file: height.csv", "file: height.csv\n      value_scale: 0", "found 0, allowed is any other number"),
        ("file: height.csv", "from: 2\n      to: 1\n      file: a.csv", "found 1, allowed is a number above from 2"),
        ("file: height.csv", "file: height.csv\n      time: -1", "the name of a column, or its place, from 0"),
        ("body: block, component: y", "body: blok, component: y", "no body is called 'blok'"),
        ("file: height.csv", "file: height.csv\n      delay: {lower: 1, upper: 0}", "a number below upper 0"),
        ("  measured:", "  los: huber\n  measured:", "did you mean 'loss'?"),
    ],
)  # fmt: skip
def test_what_makes_no_sense_is_refused(old: str, new: str, told: str) -> None:
    assert old in DROP
    found = mistakes(DROP.replace(old, new))
    assert any(told in each for each in found), found


def test_a_number_that_a_design_variable_decides_is_refused() -> None:
    text = DROP.replace(
        "fit:", "design: {variables: {k: {group: foam, parameter: stiffness, lower: 1, upper: 1e5}}}\nfit:"
    )
    assert any("it is the design variable k" in each for each in mistakes(text))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "drop.yaml").write_text(DROP, encoding="utf-8")
    return tmp_path


def read(folder: Path, table: str, **overrides: object) -> list[str]:
    """What is wrong with a table."""
    (folder / "height.csv").write_text(table, encoding="utf-8")
    series = {f"fit.measured.height.{key}": value for key, value in overrides.items()}
    with pytest.raises(CaseError) as caught:
        read_measured(load_case(folder / "drop.yaml", series))
    return [f"{each.path_key}: {each.message}" for each in caught.value.mistakes]


def test_a_table_is_read_with_its_columns_scales_and_window(folder: Path) -> None:
    (folder / "height.csv").write_text("# a drop\nms;mm;s\n0;0;1\n100;-5;2\n\n200;-10;2\n300;1;1\n400;2;1\n", "utf-8")
    series = {"time": "ms", "value": "mm", "deviation": "s", "time_scale": 0.001, "value_scale": -0.001, "to": 0.35}
    case = load_case(folder / "drop.yaml", {f"fit.measured.height.{key}": value for key, value in series.items()})
    (found,) = read_measured(case)
    np.testing.assert_allclose(found.t, [0.0, 0.1, 0.2, 0.3])
    np.testing.assert_allclose(found.y, [0.0, 0.005, 0.01, -0.001])
    np.testing.assert_allclose(found.deviation, [0.001, 0.002, 0.002, 0.001])


def test_rows_at_the_ends_of_a_window_are_in_it_whatever_scales_make_of_their_times(folder: Path) -> None:
    (folder / "height.csv").write_text("".join(f"{t},0\n" for t in range(500)), "utf-8")
    above = [t for t in range(1, 500) if t * 0.001 > t / 1000]
    assert len(above) > 5
    for t in above:
        window = {"time": 0, "value": 1, "time_scale": 0.001, "from": 0, "to": t / 1000}
        case = load_case(folder / "drop.yaml", {f"fit.measured.height.{key}": value for key, value in window.items()})
        assert len(read_measured(case)[0].t) == t + 1


@pytest.mark.parametrize(
    ("table", "overrides", "told"),
    [
        ("t,y\n0,0\n0.1,0\n0.2,0\n0.3,0\n", {"file": "hight.csv"}, "height.file: there is no file"),
        ("t,y\n0,0\n", {"value": "z"}, "height.value: found the column 'z', the file has t, y (height.csv)"),
        ("t,height\n0,0\n", {"value": "heigt"}, "did you mean 'height'?"),
        ("0,0\n0.1,1\n", {"value": "y"}, "the file has no header line"),
        ("0,0\n0.1,1\n", {"value": 2}, "found the column number 2, the file has 2 columns, numbered from 0"),
        ("t,y\n0,0\n0.1,nan\n", {}, "line 3: found 'nan', allowed is a finite number (column y)"),
        ("t,y\n0,0\n0.1,\n", {}, "line 3: found nothing, allowed is a finite number (column y)"),
        ("t,y\n0,0\n0.1,x\n", {}, "line 3: found 'x', allowed is a finite number (column y)"),
        ("t,y\n0,0\n0.6,1\n0.7,1\n", {}, "line 3: found the time 0.6, and 1 more such times, allowed is 0 to 0.5 s"),
        ("t,y\n0,0\n0.49,1\n", {"delay": "{lower: -0.02, upper: 0}"}, "allowed is 0 to 0.48 s"),
        ("t,y\n", {}, "found no row in 'height.csv', needed is at least one"),
        ("t,y\n0.1,0\n", {"from": 0.2}, "between `from` and `to`"),
        ("t,y,s\n0,0,1\n0.1,0,0\n", {"deviation": "s"}, "line 3: found 0, allowed is a number > 0"),
        ("t,y\n0,0\n0.1,0\n0.2,0\n", {}, "found 3 measured values for 3 estimates"),
    ],
)
def test_a_bad_table_is_refused_with_its_line(
    folder: Path, table: str, overrides: dict[str, object], told: str
) -> None:
    found = read(folder, table, **overrides)
    assert any(told in each for each in found), found


def test_other_commands_do_not_read_the_files(folder: Path) -> None:
    case = load_case(folder / "drop.yaml")
    assert dict(case.files) == {}


def table(folder: Path, text: str, **columns: object) -> list[float]:
    """The values of a series of a table."""
    (folder / "height.csv").write_text(text, encoding="utf-8")
    case = load_case(folder / "drop.yaml", {f"fit.measured.height.{key}": value for key, value in columns.items()})
    return read_measured(case)[0].y.tolist()


def test_columns_between_tabs_may_have_blanks_in_their_names_and_gaps(folder: Path) -> None:
    text = "t s\tforce N\tway\n" + "".join(f"0.0{i}\t{'' if i == 2 else i}\t{10 * i}\n" for i in range(1, 6))
    assert table(folder, text, time="t s", value="way") == [10.0, 20.0, 30.0, 40.0, 50.0]
    told = read(folder, text, time="t s", value="force N")
    assert told == ["fit.measured.height.file: height.csv, line 3: found nothing, allowed is a finite number "
                    "(column force N)"]  # fmt: skip


def test_tabs_in_a_row_that_only_align_columns_are_one_gap(folder: Path) -> None:
    rows = "".join(f"0.0{i}\t\t{i}\n" for i in range(1, 6))
    assert table(folder, rows) == table(folder, "t\t\ty\n" + rows, time="t", value="y") == [1.0, 2.0, 3.0, 4.0, 5.0]


def test_quoted_names_may_have_commas(folder: Path) -> None:
    text = '"t, s","a","b"\n' + "".join(f"0.0{i},{i},{10 * i}\n" for i in range(1, 6))
    assert table(folder, text, time="t, s", value="a") == [1.0, 2.0, 3.0, 4.0, 5.0]


def test_empty_cells_at_the_end_of_rows_are_no_columns(folder: Path) -> None:
    text = "t,y\n" + "".join(f"0.0{i},{i},,\n" for i in range(1, 6))
    assert table(folder, text, time="t", value="y") == [1.0, 2.0, 3.0, 4.0, 5.0]


VALUES = [1.0, 2.0, 3.0, 4.0, 5.0]
DECIMAL = "numbers have a point, not a comma"


def rows_of(head: str, row: str) -> str:
    """A header line over five rows at the times 0.01 to 0.05 with the values 1 to 5."""
    return head + "\n" * bool(head) + "".join(row.format(i=i) + "\n" for i in range(1, 6))


@pytest.mark.parametrize(
    ("head", "row", "columns"),
    [
        ("time\ty", "0.0{i}\t\t{i}", ("time", "y")),  # several tabs are one gap
        ("time\ty", "0.0{i}\t\t{i}", (0, 1)),
        ("t s\tforce N", "0.0{i}\t\t{i}", ("t s", "force N")),
        ("t\ty\tz", "0.0{i}\t\t{i}", ("t", "z")),  # here they are an empty cell
        ("\tt\ty", "{i}\t0.0{i}\t{i}", ("t", "y")),  # an index in front
        ("t\ty\ttemp\tnote", '\t{i}\t0.0{i}\t"q"', ("temp", "y")),
        ("t s\tF N", "0.0{i} {i}", ("t s", "F N")),
        ("t,y", "0.0{i} {i}", ("t", "y")),
        ("t [s]  F [N]", "0.0{i} {i}", (0, 1)),
        ("t [s]  F [N]", "0.0{i} {i}", ("t [s]", "F [N]")),
        ("Zeit, s;Kraft, N", "0.0{i};{i}", ("Zeit, s", "Kraft, N")),
        ("time, s\tforce, N", "0.0{i}\t{i}", ("time, s", "force, N")),
        ("t, s,y,z", "0.0{i},{i},5", (0, 1)),
        ("drop of a block", "0.0{i},{i}", (0, 1)),
        ("t,y", "0.0{i},{i} # first", ("t", "y")),
        ("t y", "0.0{i} {i} #first", ("t", "y")),
        ("t #1,y #2", "0.0{i},{i}", ('"t #1"', '"y #2"')),
        ("t,y,note\n0,7,", '0.0{i},{i},"a # b, c"', ("t", "y")),
    ],
)
def test_what_separates_the_rows_separates_the_names(
    folder: Path, head: str, row: str, columns: tuple[str | int, str | int]
) -> None:
    found = table(folder, rows_of(head, row), time=columns[0], value=columns[1])
    assert found[-5:] == VALUES


@pytest.mark.parametrize("columns", [("t", "y"), (0, 1)])
@pytest.mark.parametrize(
    ("head", "row", "remark"),
    [
        ("t,y,note", "0.0{i},{i},", "down, and up"),
        ("t;y;note", "0.0{i};{i};", "down; and up"),
        ("t y note", "0.0{i} {i}", "down"),
        ("t y note", "0.0{i} {i} down", " and up"),
    ],
)
def test_remarks_behind_the_columns_that_are_read_need_no_quotation_marks(
    folder: Path, head: str, row: str, remark: str, columns: tuple[str | int, str | int]
) -> None:
    first, *rows = rows_of(head, row).splitlines()
    blank = "" if row.endswith((",", ";")) else " "
    rows[2] += blank * (not remark.startswith(" ")) + remark
    assert table(folder, "\n".join([first, *rows]), time=columns[0], value=columns[1]) == VALUES


@pytest.mark.parametrize(
    ("head", "row", "columns", "told"),
    [
        ("t,y", "0,0{i},1,5", (0, 1), f"line 2: the row has 4 cells, the header line has 2; columns are taken to stand "
         f"between commas, and {DECIMAL}"),
        ("t,y", "0,0{i},1,5", ("t", "y"), "line 2: the row has 4 cells, the header line has 2"),
        ("t,y,note", "0,0{i},1,5", ("t", "y"), "line 2: the row has 4 cells, the header line has 3"),
        ("t,y,note", "0,0{i},1,5,a", (0, 1), "line 2: the row has 5 cells, the header line has 3"),
        ("t\ty", "0,0{i}\t{i},5", ("t", "y"), "line 2: found '0,01', allowed is a finite number (column t); numbers "
         "have a point, not a comma"),
        ("0.01,1", "0,0{i},1,5", (0, 1), "line 2: the row has 4 cells, the first row has 2"),
        ("t, s,y,z", "0.0{i},{i},5", ("t", "y"), "the row has 3 cells, the header line has 4; columns are taken to "
         "stand between commas; names with commas stand in quotation marks"),
        ("t y z", "0.0{i} 1", ("t", "y"), "line 2: the row has 2 cells, the header line has 3; columns are taken to "
         "stand between blanks; commas between columns say which is empty"),
        ("0,01,1,5", "{i},1,5", (0, 1), "line 2: the row has 3 cells, the first row has 4; columns are taken to stand "
         f"between commas, and {DECIMAL}"),
        ("0 1 2", "0.0{i} 1", (0, 1), "line 2: the row has 2 cells, the first row has 3"),
        ("t y note\n0 1 5", "0.0{i} 1", ("t", "y"), "line 3: the row has 2 cells, the header line has 3"),
        ("t", "0.0{i} 1", ("t", 1), "line 2: the row has 2 cells, the header line has 1; columns are taken to stand"),
        ("y z", "1", ("y", "z"), "line 2: the row has 1 cell, the header line has 2"),
        ("t\ty", "{i}\t0.0{i}\t1", ("t", "y"), "the row has 3 cells, the header line has 2; columns are taken to "
         "stand between tabs"),
        ("t,y,note,z", "{i},0.0{i},5,hit,7", ("t", "y"), "the row has 5 cells, the header line has 4"),
        ("t y note", "{i} 0.0{i} 5 hit", ("t", "y"), "the row has 4 cells, the header line has 3; columns are"),
        ("t\ty\tz s", "{i}\t0.0{i}\t5\t7", ("t", "y"), "the row has 4 cells, the header line has 3"),
        ("t,y\n0,1\n0.01", "0.0{i},1", ("t", "y"), "line 3: found nothing, allowed is a finite number (column y)"),
        ("t,y,note\n0,1,a", '0.0{i},1,"' + "a" * 140000 + '"', ("t", "y"),
         "line 3: a cell in quotation marks cannot be read: field larger than field limit (131072)"),
    ],
)  # fmt: skip
def test_rows_with_other_cells_than_columns_are_refused(
    folder: Path, head: str, row: str, columns: tuple[str | int, str | int], told: str
) -> None:
    """Decimal commas, commas in names, gaps between blanks, numbers of rows: nobody knows which cell is which."""
    found = read(folder, rows_of(head, row), time=columns[0], value=columns[1])
    assert any(told in each for each in found), found
    assert all(DECIMAL not in each for each in found) or re.search(r"\d,\d", row.format(i=1))


def test_a_name_that_two_columns_have_is_refused(folder: Path) -> None:
    text = "t,y,y\n" + "".join(f"0.0{i},{i},{10 * i}\n" for i in range(1, 6))
    assert any("found 2 columns called 'y'" in each for each in read(folder, text, time="t", value="y"))
    assert table(folder, text, time="t", value=2) == [10.0, 20.0, 30.0, 40.0, 50.0]
