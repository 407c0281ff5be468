"""`mdstopo import`: points of drawings, and bodies and joints of robots against moments worked out by hand."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mdstopo.case.reader import read_case
from mdstopo.case.text.yaml_text import text_of
from mdstopo.cli.group import run_group
from mdstopo.cli.import_points import ImportedError, path_points, points_in
from mdstopo.cli.import_robots import robot_in

ENTITIES = """0 SECTION 2 HEADER 9 $INSUNITS 70 4 0 ENDSEC 0 SECTION 2 ENTITIES
    0 LINE 8 rail 10 0 20 0 30 0 11 100 21 0 31 0
    0 LWPOLYLINE 8 hull 90 2 10 0 20 50 10 100 20 50
    0 POINT 8 rail 10 25 20 5
    0 CIRCLE 8 pins 10 7 20 8 40 3
    0 POLYLINE 8 old 66 1 0 VERTEX 8 old 10 1 20 2 0 SEQEND
    0 TEXT 8 notes 10 9 20 9 1 hello 0 ENDSEC 0 EOF"""
DXF = "\n".join(ENTITIES.split())
SVG = """<svg xmlns="http://www.w3.org/2000/svg" width="200mm" viewBox="0 0 100 50">
  <g id="frame"><rect x="0" y="0" width="10" height="5"/><line x1="1" y1="2" x2="3" y2="4"/></g>
  <path id="keel" d="M 0 0 h 10 v5 l -10,0 z"/>
  <circle id="pin" cx="4" cy="-6" r="1"/>
</svg>"""
ARM = """<robot name="two arms">
  <link name="base"/>
  <link name="upper-arm">
    <inertial><origin xyz="0 0 0.5" rpy="0 0 1.5707963267948966"/><mass value="2"/>
      <inertia ixx="0.1" iyy="0.2" izz="0.25" ixy="0.01" ixz="0" iyz="0"/></inertial>
  </link>
  <link name="weight"><inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0.2 0 0"/><mass value="3"/>
    <inertia ixx="1" iyy="1" izz="1"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper-arm"/>
    <origin xyz="0 0 1" rpy="1.5707963267948966 0 0"/><axis xyz="0 0 1"/><limit effort="1" velocity="1"/></joint>
  <joint name="glue" type="fixed"><parent link="upper-arm"/><child link="weight"/><origin xyz="0 0 1"/></joint>
  <joint name="slide" type="prismatic"><parent link="upper-arm"/><child link="lower"/>
    <origin xyz="0 0 1"/><axis xyz="1 0 0"/></joint>
</robot>"""
MJCF = """<mujoco model="toy">
  <worldbody>
    <body name="cart" pos="0 0 1"><joint name="rail" type="slide" axis="1 0 0" damping="1"/>
      <geom type="box" size="0.2 0.1 0.05" mass="3"/>
      <body name="pole" pos="0 0 0.05" euler="0 90 0"><joint type="hinge" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 0 0 1" size="0.1" density="500"/>
        <body name="tip" pos="0 0 1"><geom type="sphere" size="0.1" mass="2"/></body>
      </body>
    </body>
    <body name="ball" pos="1 0 0"><freejoint/><geom size="0.3"/></body>
  </worldbody>
</mujoco>"""


def case_of(text: str, name: str, fixed: bool = False) -> tuple[Any, list[str]]:
    content, told = robot_in(Path(name), text, fixed)
    return read_case(text_of(content)), told


def test_points_of_a_dxf_come_by_layer_with_its_unit() -> None:
    layers, unit = points_in(Path("a.dxf"), DXF)
    assert unit == 1e-3
    assert layers == {
        "rail": [(0.0, 0.0), (100.0, 0.0), (25.0, 5.0)],
        "hull": [(0.0, 50.0), (100.0, 50.0)],
        "pins": [(7.0, 8.0)],
        "old": [(1.0, 2.0)],
    }


def test_points_of_an_svg_come_by_id_with_y_upwards_and_its_unit() -> None:
    layers, unit = points_in(Path("a.svg"), SVG)
    assert unit == 0.002
    assert layers["frame"] == [(0, 0), (10, 0), (10, -5), (0, -5), (1, -2), (3, -4)]
    assert layers["keel"] == [(0, 0), (10, 0), (10, -5), (0, -5)]
    assert layers["pin"] == [(4, 6)]


def test_paths_go_where_their_commands_say() -> None:
    assert path_points("m1 1 2 0 0 2z l1 0") == [(1, 1), (3, 1), (3, 3), (2, 1)]
    assert path_points("M0,0C1 1 2 2 3 3S4 4 5 5Q6 6 7 7T8 8A1 1 0 0 1 9 9") == [(k, k) for k in (0, 3, 5, 7, 8, 9)]
    assert path_points("M-1.5.5L1e1-2") == [(-1.5, 0.5), (10, -2)]


def test_flags_of_an_arc_need_nothing_behind_them() -> None:
    spaced = path_points("M 0 0 A 10 10 0 0 1 10 20 a 5 5 0 1 0 -.5 2 5 5 30 0 0 1 1")
    assert spaced == [(0, 0), (10, 20), (9.5, 22), (10.5, 23)]
    assert path_points("M0 0A10 10 0 0110 20a5 5 0 10-.5 2 5 5 30 001 1") == spaced


@pytest.mark.parametrize(("number", "metres"), [(3, 1609.344), (10, 0.9144), (13, 1e-6), (21, 1200 / 3937)])
def test_all_units_of_dxf_are_known(number: int, metres: float) -> None:
    assert points_in(Path("a.dxf"), DXF.replace("$INSUNITS\n70\n4", f"$INSUNITS\n70\n{number}"))[1] == metres


def test_tables_are_points_with_names_or_without() -> None:
    assert points_in(Path("rim.csv"), "x,y\n1,2\n3,4\n3,4\n")[0] == {"rim": [(1, 2), (3, 4)]}
    assert points_in(Path("a.csv"), "nr,X [mm],y_mm\n1,5,6\n2,7,8\n")[0] == {"a": [(5, 6), (7, 8)]}
    assert points_in(Path("a.csv"), "y;x;z;layer;weight\n1;2;3;a;9\n")[0] == {"a": [(2, 1, 3)]}
    assert points_in(Path("a.csv"), "a;1;2;3\nb;4;5;6\n")[0] == {"a": [(1, 2, 3)], "b": [(4, 5, 6)]}
    assert points_in(Path("a.txt"), "# made by hand\n1 2\n3  4\n")[0] == {"a": [(1, 2), (3, 4)]}


@pytest.mark.parametrize(
    ("name", "text", "layers"),
    [
        ("a.csv", "nr,x,y\n-,mm,mm\n1,5,6\n", {"a": [(5, 6)]}),
        ("a.csv", "x_std,y_std,x,y\n.1,.2,5,6\n", {"a": [(5, 6)]}),
        ("a.csv", "x_std,y_std,x_mm,y_mm\n.1,.2,5,6\n", {"a": [(5, 6)]}),
        ("a.csv", "id,x,y,z_order\n1,5,6,7\n", {"a": [(5, 6)]}),
        ("a.csv", "nr,X/mm,Y (mm)\n1,5,6\n", {"a": [(5, 6)]}),
        ("a.csv", "name,x,y,comment\nrim,5,6,new\nhub,7,8,\n", {"rim": [(5, 6)], "hub": [(7, 8)]}),
        ("a.csv", "x,y,comment,layer\n5,6,new,rim\n", {"rim": [(5, 6)]}),
        ("a.csv", "layer,x,y,comment\nrim,5,6,new, and round\n", {"rim": [(5, 6)]}),
        ("a.txt", "x [m] y [m]\n1 2\n", {"a": [(1, 2)]}),
        ("a.txt", "nr x [m] y [m]\n1 5 6\n", {"a": [(5, 6)]}),
        ("a.txt", "x\ty\n1\t\t2\n", {"a": [(1, 2)]}),
        ("a.csv", "east,north\n5,6\n", {"a": [(5, 6)]}),
        ("a.csv", "Points of the rim\n5,6,7\n", {"a": [(5, 6, 7)]}),
        ("a.csv", '"x";"y"\n5;6\n', {"a": [(5, 6)]}),
        ("a.csv", "x,y,part\n1,2,bolt #1\n3,4,bolt #2\n", {"bolt #1": [(1, 2)], "bolt #2": [(3, 4)]}),
        ("a.csv", '1,2,b\n3,4,"c\nd"\n', {"b": [(1, 2)], "c\nd": [(3, 4)]}),
    ],
)
def test_the_line_of_names_says_which_columns_are_coordinates(name: str, text: str, layers: dict[str, Any]) -> None:
    assert points_in(Path(name), text)[0] == layers


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.csv", "1,2\n1,2,3,4\n", "line 2: found 1, 2, 3, 4"),
        ("a.csv", "x,y\n", "there are no points"),
        ("a.csv", "x;y\n1,5;2\n", r"line 2: found 1,5 \(the decimal sign is a point\) in column x, allowed is a n"),
        ("a.csv", "x,y,nr\n1,,2\n", "line 2: found nothing in column y, allowed is a number"),
        ("a.csv", "x,y,z\n1,2,\n", "line 2: found nothing in column z, allowed is a number"),
        ("a.csv", "x,y\n1,5,2,5\n", r"found 1,5,2,5 \(the decimal sign is a point\), which has 4 cells; .* has 2"),
        ("a.csv", "x;y\n7;1;2\n", "line 2: found 7;1;2, which has 3 cells; the line of names has 2"),
        ("a.txt", "x y nr\n5 6 1\n6 2\n", "line 3: found 6 2, which has 2 cells; the line of names has 3"),
        ("a.csv", "x y\n1,5 2,5\n", "line 2: found 1, 5 2, 5 .the decimal sign is a point"),
        ("a.txt", "1,25   2,5\n", "line 1: found 1, 25   2, 5 .the decimal sign is a point"),
        ("a.csv", "x;y\n1,5;2,5\n", "line 2: found 1,5;2,5 .the decimal sign is a point"),
        ("a.csv", "x,y\n1e400,2\n", "line 2: found 1e400 in column x, allowed is a number"),
        ("a.csv", "nr,east,north\n1,5,6\n", "line 2: found 1, 5, 6 in columns called nr, east, north, which may be"),
        ("a.csv", f'x,y,note\n1,2,"{"a" * 140000}"\n', "line 2: a cell cannot be read: field larger than"),
        ("a.dxf", "hello\nworld\n", "this is no DXF"),
        ("a.svg", "<svg", "this is no SVG"),
        ("a.svg", '<svg><g id="k" transform="scale(2)"><line/></g></svg>', "'k' has a transform"),
        ("a.png", "", "points are read from .csv"),
        ("a.dxf", DXF.replace("$INSUNITS\n70\n4", "$INSUNITS\n70\n99"), "unit is number 99"),
        ("a.dxf", DXF.replace("\n100\n", "\nx\n"), "could not convert"),
        ("a.svg", SVG.replace('cx="4"', 'cx="4mm"'), "circle 'pin': cx is '4mm', allowed is a number"),
    ],
)
def test_what_is_no_drawing_is_refused_with_the_reason(name: str, text: str, words: str) -> None:
    with pytest.raises(ImportedError, match=words):
        points_in(Path(name), text)


def test_a_drawing_in_millimetres_becomes_points_in_metres(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("frame.dxf").write_text(DXF)
    assert run_group(["import", "frame.dxf", "--body", "deck"]) == 0
    said = capsys.readouterr()
    assert "points:" in said.out
    assert "[0.025, 0.005]" in said.out
    assert "unit is 0.001 m" in said.err
    assert run_group(["import", "frame.dxf", "--unit", "in", "--out", "p.yaml", "--quiet"]) == 0
    assert "[0.635, 0.127]" in Path("p.yaml").read_text()
    assert run_group(["import", "frame.dxf", "--out", "p.yaml"]) == 2
    assert "exists already" in capsys.readouterr().err
    assert run_group(["import", "frame.dxf", "--unit", "kg"]) == 2
    assert run_group(["import", "none.dxf"]) == 2


def test_a_robot_of_links_becomes_bodies_where_they_stand_with_parts_glued_together() -> None:
    case, told = case_of(ARM, "arm.urdf")
    assert [body.name for body in case.bodies] == ["upper-arm", "lower"]
    upper, lower = case.bodies
    # the shoulder turns z of the link to -y: the masses of 2 and 1 kg hang at 0.5 and 1 m
    assert upper.mass == 3.0
    assert upper.position == pytest.approx((0.0, -(2 * 0.5 + 1.0) / 3.0, 1.0), abs=1e-15)
    # turned a quarter about the link's z, ixx and iyy are exchanged and ixy has the other sign
    own = np.array([[0.2, -0.01, 0], [-0.01, 0.1, 0], [0, 0, 0.25]])
    turn = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    steiner = 2 * 1.0 / 3.0 * 0.5**2 * np.diag([1, 0, 1])
    assert upper.inertia == pytest.approx(turn @ own @ turn.T + 0.01 * np.eye(3) + steiner, abs=1e-14)
    assert lower.position == pytest.approx((0.2, -1.0, 1.0), abs=1e-15)
    shoulder, slide = case.joints
    assert (shoulder.name, shoulder.type, shoulder.bodies) == ("shoulder", "revolute", ("ground", "upper-arm"))
    assert (slide.type, slide.bodies) == ("prismatic", ("upper-arm", "lower"))
    assert told == ["<limit> of joints is left out"]


def test_a_mass_that_is_fixed_to_a_first_link_without_one_is_told_to_be_left_out() -> None:
    massless = '<link name="footprint"/><link name="base"><inertial><mass value="5"/></inertial></link>'
    joints = (
        '<joint name="a" type="fixed"><parent link="footprint"/><child link="base"/></joint>'
        '<joint name="b" type="revolute"><parent link="base"/><child link="arm"/></joint>'
    )
    arm = '<link name="arm"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>'
    case, told = case_of(f"<robot>{massless}{arm}{joints}</robot>", "cart.urdf")
    assert [body.name for body in case.bodies] == ["arm"]
    assert told == ["the mass of 'base' is left out: it is fixed to a first link without mass, taken for ground"]


@pytest.mark.parametrize("number", ["nan", "inf"])
def test_an_inertia_that_is_no_number_is_refused_with_its_body(number: str) -> None:
    arm = f'<link name="arm"><inertial><mass value="1"/><inertia ixx="{number}" iyy="1" izz="1"/></inertial></link>'
    with pytest.raises(ImportedError, match="body 'arm': its mass or its inertia is no number"):
        robot_in(Path("arm.urdf"), f"<robot>{arm}</robot>")


def test_a_robot_of_nested_bodies_has_the_masses_of_its_shapes() -> None:
    case, told = case_of(MJCF, "toy.xml")
    cart, pole, ball = case.bodies
    assert cart.inertia == pytest.approx(np.diag([0.1**2 + 0.05**2, 0.2**2 + 0.05**2, 0.2**2 + 0.1**2]), abs=1e-15)
    capsule = 500 * (math.pi * 0.1**2 * 1.0 + 4 / 3 * math.pi * 0.1**3)
    assert pole.mass == pytest.approx(capsule + 2.0, rel=1e-14)
    # a quarter turn about y brings z along x
    centre = (0.5 * capsule + 2.0) / (capsule + 2.0)
    assert pole.position == pytest.approx((centre, 0.0, 1.05), abs=1e-14)
    along = 500 * (math.pi * 0.1**4 / 2 + 8 / 15 * math.pi * 0.1**5) + 0.4 * 2.0 * 0.1**2
    assert pole.inertia[0, 0] == pytest.approx(along, rel=1e-13)
    assert ball.mass == pytest.approx(1000 * 4 / 3 * math.pi * 0.3**3, rel=1e-14)
    assert [joint.bodies for joint in case.joints] == [("ground", "cart"), ("cart", "pole")]
    assert told == ["damping of joints is left out"]


def test_the_moment_of_a_capsule_is_that_of_its_slices() -> None:
    geom = '<geom type="capsule" size="0.2 0.5"/>'
    text = f'<mujoco><worldbody><body name="a"><freejoint/>{geom}</body></worldbody></mujoco>'
    (body,) = case_of(text, "a.xml")[0].bodies
    nodes, weights = np.polynomial.legendre.leggauss(60)
    total = 0.0
    for low, high in ((-0.7, -0.5), (-0.5, 0.5), (0.5, 0.7)):
        z = 0.5 * (high + low) + 0.5 * (high - low) * nodes
        r2 = 0.2**2 - np.maximum(np.abs(z) - 0.5, 0.0) ** 2
        total += 0.5 * (high - low) * float(weights @ (1000 * math.pi * r2 * (r2 / 4 + z**2)))
    assert body.inertia[0, 0] == pytest.approx(total, rel=1e-12)


def test_the_first_body_is_held_on_request() -> None:
    text = ARM.replace(
        '<link name="base"/>',
        '<link name="base"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>',
    )
    free, _ = case_of(text, "arm.urdf")
    held, _ = case_of(text, "arm.urdf", fixed=True)
    assert len(free.bodies) == len(held.bodies) == 3
    assert [joint.type for joint in held.joints] == ["fixed", *(joint.type for joint in free.joints)]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<robot", "this is no XML"),
        ("<house/>", "found <house>"),
        ('<robot><link name="a"/></robot>', "no body in it has a mass"),
        (ARM.replace('type="prismatic"', 'type="screw"'), "'screw', which no case has"),
        (ARM.replace('<parent link="base"/>', '<parent link="bass"/>'), "'bass' is no link"),
        (ARM.replace('<mass value="3"/>', '<mass value="0"/>'), "'lower' has no mass"),
        (ARM.replace('<mass value="3"/>', '<mass value="-3"/>'), "'lower': found the mass -3 kg .*; both have"),
        (MJCF.replace("<freejoint/>", '<joint/><joint type="slide"/>'), "has 2 joints"),
        (MJCF.replace('type="capsule"', 'type="mesh"'), "state an <inertial>"),
        (MJCF.replace("<freejoint/>", '<freejoint/><frame pos="0 0 1"/>'), "<frame> in 'ball' is not read"),
        (MJCF.replace("<worldbody>", "<worldbody><replicate/>"), "<replicate> in 'worldbody' is not read"),
        (MJCF.replace("<worldbody>", '<include file="more.xml"/><worldbody>'), "<include> is not read"),
        (MJCF.replace("<worldbody>", '<compiler settotalmass="9"/><worldbody>'), "settotalmass is not read"),
        (MJCF.replace("<worldbody>", '<default><joint axis="0 1 0"/></default><worldbody>'), "defaults of joints"),
        (MJCF.replace('size="0.3"', 'size="0.3" shellinertia="true"'), "shells are not read"),
        (MJCF.replace('name="ball"', 'name="pole"'), "two bodies have the name 'pole'"),
        (MJCF.replace('pos="1 0 0"', 'pos="1 0"'), "found '1 0', allowed are 3 numbers"),
        (ARM.replace('xyz="0.2 0 0"', 'xyz="${far} 0 0"'), "'[$]{far} 0 0', allowed are numbers"),
        (
            ARM.replace('"weight"', '"upper arm"')
            .replace("upper-arm", "upper_arm")
            .replace('"glue" type="fixed"', '"glue" type="floating"'),
            "two bodies have the name 'upper_arm'",
        ),
    ],
)
def test_robots_that_no_case_can_say_are_refused_by_name(text: str, words: str) -> None:
    with pytest.raises(ImportedError, match=words):
        robot_in(Path("a.urdf"), text)


def test_a_box_between_two_points_is_square_across() -> None:
    geom = '<geom type="box" fromto="0 0 0 0 0.6 0" size="0.1" density="500"/>'
    text = f'<mujoco><worldbody><body name="a"><freejoint/>{geom}</body></worldbody></mujoco>'
    (body,) = case_of(text, "a.xml")[0].bodies
    assert body.mass == pytest.approx(500 * 0.2 * 0.2 * 0.6, rel=1e-14)
    across, along = 0.2**2 + 0.6**2, 2 * 0.2**2
    assert body.inertia == pytest.approx(body.mass / 12 * np.diag([across, along, across]), abs=1e-15)


def test_turns_of_mjcf_are_about_fixed_axes_for_capitals_letter_by_letter() -> None:
    axis = '<joint type="hinge" axis="0 0 1"/>'
    text = f"""<mujoco><compiler eulerseq="zXy"/><option gravity="1 2 -3"/>
      <worldbody><body name="a" euler="90 30 50">{axis}<geom size="0.1"/></body></worldbody></mujoco>"""
    content, _ = robot_in(Path("a.xml"), text)
    # its own y leans z by 50 degrees along x, z makes that y, and the fixed x turns back by 30
    lean = math.radians(50 - 30)
    assert content["joints"][0]["axis"] == pytest.approx([0.0, math.sin(lean), math.cos(lean)], abs=1e-15)
    assert content["gravity"] == [1.0, 2.0, -3.0]


def test_masses_are_those_of_mujoco() -> None:
    mujoco = pytest.importorskip("mujoco")
    case, _ = case_of(MJCF, "toy.xml")
    model = mujoco.MjModel.from_xml_string(
        MJCF.replace('<body name="tip" pos="0 0 1"><geom', '<geom pos="0 0 1"').replace(
            'mass="2"/></body>', 'mass="2"/>'
        )
    )
    for body in case.bodies:
        at = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, body.name)
        assert model.body_mass[at] == pytest.approx(body.mass, rel=1e-12)
        assert sorted(model.body_inertia[at]) == pytest.approx(np.linalg.eigvalsh(body.inertia).tolist(), rel=1e-9)


def test_what_of_a_robot_no_case_can_have_is_told_when_it_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("arm.urdf").write_text(ARM.replace('iyy="1" izz="1"', 'iyy="1" izz="5"'), encoding="utf-8")
    assert run_group(["import", "arm.urdf", "--out", "arm.yaml"]) == 0
    told = capsys.readouterr().err
    assert "warning: to be mended in the case: bodies.lower.inertia: found the principal moments 1, 1, 5" in told
    Path("right.urdf").write_text(ARM, encoding="utf-8")
    assert run_group(["import", "right.urdf", "--out", "right.yaml"]) == 0
    assert "to be mended" not in capsys.readouterr().err


def test_points_cannot_be_held(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """--fix did nothing to points, without a word."""
    monkeypatch.chdir(tmp_path)
    Path("rim.csv").write_text("x,y\n1,2\n", encoding="utf-8")
    assert run_group(["import", "rim.csv", "--fix", "--out", "rim.yaml"]) == 2
    assert (
        "rim.csv has points, which have no body to hold; --fix is for robots (.urdf, .xml)" in capsys.readouterr().err
    )
    assert not Path("rim.yaml").exists()


def test_shapes_of_a_robot_that_are_left_out_are_counted() -> None:
    shape = '<visual><geometry><box size="1 1 1"/></geometry></visual>'
    text = ARM.replace('<link name="base"/>', f'<link name="base">{shape}{shape}<collision/></link>')
    sentence = "shapes are left out (2 visuals, 1 collision): write an `outline` for bodies to be drawn by"
    assert sentence in robot_in(Path("arm.urdf"), text)[1]
    assert not any("shapes" in each for each in robot_in(Path("arm.urdf"), ARM)[1])
