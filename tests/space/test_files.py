"""What is printed and stored of a case in space."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from mdstopo.cli.group import run_group

from .support import CASES, load

LOOP = """
format: 1
dimension: 3
title: Four bars
time: {end: 0.1}
bodies:
  crank: {mass: 1, inertia: [0.1, 0.1, 0.1], position: [0, 0.5, 0]}
  coupler: {mass: 1, inertia: [0.1, 0.1, 0.1], position: [0.5, 1, 0]}
  rocker: {mass: 1, inertia: [0.1, 0.1, 0.1], position: [1, 0.5, 0]}
joints:
  - {type: revolute, bodies: [ground, crank], at: [0, 0, 0], axis: [0, 0, 1]}
  - {type: revolute, bodies: [crank, coupler], at: [0, 1, 0], axis: [0, 0, 1]}
  - {type: revolute, bodies: [coupler, rocker], at: [1, 1, 0], axis: [0, 0, 1]}
  - {name: last, type: revolute, bodies: [rocker, ground], at: [1, 0, 0], axis: [0, 0, 1]}
"""


Say = Callable[..., str]


@pytest.fixture
def said(capsys: pytest.CaptureFixture[str]) -> Say:
    """What a command prints, which ends well."""

    def say(*arguments: object) -> str:
        capsys.readouterr()
        assert run_group([str(each) for each in arguments]) == 0, capsys.readouterr().err
        return capsys.readouterr().out

    return say


def test_check_prints_joints_degrees_of_freedom_and_redundancies(said: Say, tmp_path: Path) -> None:
    case = tmp_path / "loop.yaml"
    case.write_text(LOOP)
    text = said("check", case)
    assert "4 joints" in text
    assert "1 degrees of freedom" in text
    assert "joints with equations that follow from other joints: last" in text
    assert "principal moments" in text
    document = json.loads(said("check", CASES / "springs.yaml", "--json"))
    assert document["degrees_of_freedom"] == 6
    assert {"centre of mass, z", "external force at the start, z"} <= document["totals"].keys()
    assert len(document["frequencies"][0]["initial"]) == 6


def test_a_motion_in_space_is_stored_printed_and_exported(said: Say, tmp_path: Path) -> None:
    result = tmp_path / "linkage.h5"
    text = said("simulate", CASES / "linkage.yaml", "--out", result)
    assert "z, m" in text
    with h5py.File(result) as file:
        group = file["trajectories/default"]
        count = len(group["t"])
        assert group["q"].shape == (count, 14)
        assert group["v"].shape == group["a"].shape == (count, 12)
        assert group["reactions/card"].shape == (count, 6)
        assert group["lambda"].shape == (count, 7)
        assert file["members/p"].shape == file["members/q"].shape == (30, 3)
        assert np.abs(np.linalg.norm(group["q"][:, 3:7], axis=1) - 1.0).max() < 1e-14
        names = [name.decode() for name in group["coordinate"][:]]
        assert names[:7] == [f"hull.{axis}" for axis in ("x", "y", "z", "qw", "qx", "qy", "qz")]
        assert len(group["freedom"]) == 12
    assert "y" in said("show", result)
    said("export", result, "--csv")
    rows = list(csv.reader(io.StringIO((tmp_path / "linkage.csv" / "trajectory-default.csv").read_text())))
    assert len(rows) == count + 1
    assert len(rows[0]) == len(set(rows[0])) == 1 + 14 + 12 + 12 + 2 * 6
    assert {"q arm.qz", "v hull.turn_x", "card.Mz"} <= set(rows[0])
    members = list(csv.reader(io.StringIO((tmp_path / "linkage.csv" / "members.csv").read_text())))
    assert members[0][:8] == ["member", "group", *(f"{e}_{a}_m" for e in ("from", "to") for a in "xyz")]
    assert members[0][8] == "length_m"
    for row in members[1:]:
        ends = np.array(row[2:8], dtype=float)
        assert float(row[8]) == pytest.approx(np.linalg.norm(ends[3:] - ends[:3]), rel=1e-15)


def test_results_in_space_have_pictures_and_a_page(said: Say, tmp_path: Path) -> None:
    result = tmp_path / "springs.h5"
    said("simulate", CASES / "springs.yaml", "--out", result)
    said("plot", result, "layout")
    said("plot", result, "histories")
    said("report", result)
    assert (tmp_path / "springs-layout.png").read_bytes()[:4] == b"\x89PNG"
    assert (tmp_path / "springs-histories.png").read_bytes()[:4] == b"\x89PNG"
    assert load("springs").title in (tmp_path / "springs.html").read_text(encoding="utf-8")
