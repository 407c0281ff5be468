"""The joints that a case file may name: what is declared of each, one file a joint.

What a joint does stands in `mdstopo.mechanics.joints`, in the module that its record names.
"""

from mdstopo.case.joints.distance_joint import DistanceJoint
from mdstopo.case.joints.fixed_joint import FixedJoint
from mdstopo.case.joints.joint import Joint
from mdstopo.case.joints.prismatic_joint import PrismaticJoint
from mdstopo.case.joints.revolute_joint import RevoluteJoint

#: the joints by their word; their codes in kernels follow this order
JOINTS: dict[str, type[Joint]] = {
    joint.type: joint
    for joint in (
        RevoluteJoint,
        PrismaticJoint,
        FixedJoint,
        DistanceJoint,
    )
}

__all__ = ["JOINTS", "DistanceJoint", "FixedJoint", "Joint", "PrismaticJoint", "RevoluteJoint"]
