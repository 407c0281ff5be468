"""Between which places everything is that a picture shows."""

import numpy as np

from mdstopo.case.reader import read_case
from mdstopo.plots.cloud import FAR_SIZES, planar_cloud, without_far
from mdstopo.plots.scenery import start_state
from mdstopo.plots.slack import CORNERS

BELT = """
format: 1
gravity: [0, -9.81]
time: {end: 1}
bodies: {a: {mass: 1, inertia: 1e-3, position: [1, 0]}}
members:
  belts: {from: {body: ground, at: [0, 0]}, to: {body: a, at: [1, 0]}, law: {type: gap, stiffness: 5, gap: GAP}}
"""


def cloud_of(gap: float) -> np.ndarray:
    case = read_case(BELT.replace("GAP", str(gap)))
    return planar_cloud(case, start_state(case)[None])


def test_a_slack_belt_is_seen_where_it_hangs_and_a_taut_one_adds_no_places() -> None:
    taut, slack = cloud_of(0.0), cloud_of(0.5)
    assert slack[:, 1].min() < -0.25
    assert taut[:, 1].min() > -0.1
    # as one of those that are chosen, and as one of all
    assert (len(slack) - len(taut)) % CORNERS == 0
    assert len(slack) > len(taut)


def test_what_is_far_off_is_left_out_unless_what_is_looked_at_is_a_single_place() -> None:
    inner, near, far = (np.array([[0.0, 0.0], [reach, 0.0]]) for reach in (1.0, FAR_SIZES, 1.01 * FAR_SIZES))
    assert without_far(inner, far, near) is near
    assert without_far(inner, near, inner) is near
    assert without_far(inner, far) is inner
    assert without_far(np.zeros((1, 2)), far) is far
