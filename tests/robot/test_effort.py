import pytest
import torch

from sidegan.errors import RobotError
from sidegan.robot import load_robot, with_effort


def test_only_a_share_of_speed_and_torque_is_left():
    arm = load_robot("planar2")
    gentle = with_effort(arm, 0.5)
    torch.testing.assert_close(gentle.velocity_limit, 0.5 * arm.velocity_limit)
    torch.testing.assert_close(gentle.torque_limit, 0.5 * arm.torque_limit)
    torch.testing.assert_close(gentle.position_upper, arm.position_upper)


def test_another_effort_is_another_arm_and_the_whole_is_the_arm_itself():
    arm = load_robot("planar2")
    assert with_effort(arm, 1.0) is arm
    digests = {with_effort(arm, effort).digest for effort in (0.3, 0.5, 1.0)}
    assert len(digests) == 3 and with_effort(arm, 0.5).digest == with_effort(arm, 0.5).digest


@pytest.mark.parametrize("effort", [0.0, -1.0, 1.1, float("nan")])
def test_what_is_no_share_is_refused(effort):
    with pytest.raises(RobotError, match="expected a share above 0 and up to 1"):
        with_effort(load_robot("planar2"), effort)
