"""What becomes of arms that people own, from their stock descriptions, judged by physics that are not ours.

The table of docs/arms.md, with the extra ``arms``: ``pytest tests/robot/test_arms_table.py -n 0 -s``. Each
arm is loaded as its refusals say; its shapes are compared with coal on the original meshes; a small set is
made by ``+experiment=excite``, and every file of it is judged at 1 kHz. All descriptions that there are are
read, reduced and given to Pinocchio.
"""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from sidegan.errors import RobotError
from sidegan.pipeline.compose import composed
from sidegan.report.export import markdown
from sidegan.robot import Setup, load_robot
from sidegan.robot.description import Description, read_description
from sidegan.robot.model import pinocchio_model
from tests.refusals import refused
from tests.robot.arms import ROBOTS, outcome, remedied
from tests.robot.judge import Facts, Judge

MORE = 0.02  # share of free configurations by which more may be refused than when the table was made


# Franka's published accelerations and jerks.
PANDA = [
    f"robot.limits.{kind}={{{', '.join(f'panda_joint{k}: {x}' for k, x in enumerate(values, 1))}}}"
    for kind, values in {
        "acceleration": (15, 7.5, 10, 12.5, 15, 20, 20),
        "jerk": (7500, 3750, 5000, 6250, 7500, 10000, 10000),
    }.items()
]
# Arm: its file, share of free configurations that was refused, what a user says, what refusals ask for.
ARMS = {
    "kuka_lwr4": (None, 0.0, [], ""),
    "panda": ("panda_description/urdf/panda.urdf", 0.0012, [], ""),
    "panda_limited": ("panda_description/urdf/panda.urdf", 0.0012, PANDA, ""),
    "ur3": ("ur_description/urdf/ur3_robot.urdf", 0.0091, [], ""),
    "ur5": ("ur_description/urdf/ur5_robot.urdf", 0.0047, [], ""),
    "ur5_gripper": ("ur_description/urdf/ur5_gripper.urdf", 0.0035, [], ""),
    "ur10": ("ur_description/urdf/ur10_robot.urdf", 0.0018, [], ""),
    "jaco": ("kinova_description/robots/kinova.urdf", 0.0011, [], ""),
    "z1": ("z1_description/urdf/z1.urdf", 0.0, [], ""),
    "xarm7": ("xarm_description/urdf/xarm7.urdf", 0.0005, [], ""),
    "so100": ("so_arm_description/urdf/so100.urdf", 0.0011, [], ""),
    "so101": ("so_arm_description/urdf/so101.urdf", 0.0017, [], ""),
    "baxter": ("baxter_description/urdf/baxter.urdf", 0.0061, [], "tip may_touch"),
    "tiago": ("tiago_description/robots/tiago_no_hand.urdf", 0.0008, [], "tip may_touch"),
    "tiago_dual": ("tiago_description/robots/tiago_dual.urdf", 0.0, [], "tip may_touch"),
    "tiago_pro": ("tiago_pro_description/robots/tiago_pro.urdf", 0.0015, [], "tip"),
    "talos": ("talos_data/robots/talos_left_arm.urdf", 0.0017, [], "may_touch"),
    "b1_z1": ("b1_description/urdf/b1-z1.urdf", 0.0, [], "tip"),
}


@pytest.fixture(scope="module")
def rows():
    """Rows of the table, printed at its end."""
    found = []
    yield found
    print(f"\n{markdown(pd.DataFrame(found))}" if found else "")


@pytest.mark.slow
@pytest.mark.parametrize("name", ARMS)
def test_no_collision_is_missed_and_every_trajectory_is_valid(name, rows, tmp_path):
    file, recorded, given, asked = ARMS[name]
    if file is not None and ROBOTS is None:
        pytest.skip("needs example-robot-data: pip install 'sidegan[arms]'")
    found = outcome(name if file is None else ROBOTS / file, given, tmp_path)
    rows.append({"arm": name, **found.row})
    assert [word.partition("=")[0] for word in found.said] == [f"robot.{x}" for x in asked.split()]
    assert found.missed == 0 and found.refused <= recorded + MORE
    # of the three asked for, one may hardly move a tight arm, and is then left out
    assert len(found.verdicts) >= 2 and found.verdicts.valid.all(), found.verdicts


FILE, JOINTS = load_robot("planar2").urdf, ["shoulder", "elbow"]
PAIRS = [["forearm", "base"], ["upper_arm", "base"], ["upper_arm", "forearm"]]
TIGHT = {
    kind: Facts(limits={kind: {"elbow": [-1e-3, 1e-3] if kind == "position" else 1e-2}})
    for kind in ("position", "velocity", "acceleration", "jerk", "effort")
}
JUDGED = [
    *((1.0, facts, kind) for kind, facts in TIGHT.items()),
    (2.85, Facts(), "colliding"),
    (2.85, Facts(exempt=PAIRS), ""),
    (1.5, Facts(floor=0.6), "colliding"),
    (1.5, Facts(floor=0.6, standing=["forearm", "upper_arm"]), ""),
]


@pytest.mark.parametrize(("angle", "facts", "wrong"), JUDGED)
def test_the_judge_finds_every_kind_of_violation(angle, facts, wrong):
    """Of the elbow's motion to an angle [rad] and back: exceeded limits, links and a floor that touch."""
    time = np.arange(2001) / 250
    q = np.stack([0 * time, angle * np.sin(np.pi * time / 8) ** 4], 1)
    dq = np.gradient(q, time, axis=0)
    ddq = np.gradient(dq, time, axis=0)
    judge = Judge(FILE, JOINTS, facts)
    verdict = judge(time, q, dq, ddq)
    assert verdict["valid"] == (not wrong) and (not wrong or verdict[wrong] > 1)
    if not wrong:
        assert not judge(time, q, 0.9 * dq, ddq)["valid"]  # rates that are another motion's


# Joints of the arms of humanoids whose hands branch: where the refusals' own remedies end the arm.
HANDS = {
    "alex_description/urdf/alex_psyonic_hands.urdf": 10,
    "g1_description/urdf/g1_29dof_with_hand_rev_1_0.urdf": 10,
    "icub_description/robots/icub.urdf": 10,
    "romeo_description/urdf/romeo.urdf": 8,
    "talos_data/robots/talos_full_v2.urdf": 9,
}
NO_ARMS = {
    "hector_description/robots/quadrotor_base.urdf",
    "iris_description/robots/iris_simple.urdf",
    "ur_description/urdf/ur3.urdf",  # empty
}


@pytest.mark.skipif(ROBOTS is None, reason="needs example-robot-data, the extra arms")
def test_every_description_loads_once_the_suggested_settings_are_given():
    for path in sorted([*ROBOTS.glob("*/urdf/*.urdf"), *ROBOTS.glob("*/robots/*.urdf")]):
        name = str(path.relative_to(ROBOTS))
        if name in NO_ARMS:
            with refused(RobotError, path.name):
                read_description(path)
        else:
            description, _ = remedied(lambda words, path=path: read(path, words))
            assert len(description.moved) == HANDS.get(name, len(description.moved))
            assert description.missing == {} or name not in HANDS


def read(path: Path, words: list[str]) -> Description:
    setup = composed("+experiment=excite", *words).robot.setup if words else Setup()
    description = read_description(path, setup)
    pinocchio_model(description)
    return description
