import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
import torch

from sidegan.errors import RecordingError
from sidegan.recording.check import check_recording, split
from sidegan.recording.recording import Recording
from sidegan.recording.statistics import statistics_of
from sidegan.robot import Limits, Setup, load_robot
from tests.recording.conftest import load_recording, of_file, real, recorded

GAINS = (14.87, 13.26, 11.13, 10.62, 11.03, 11.47)


def joined_warnings(recording, arm, **settings):
    return "\n".join(check_recording(recording, arm, of_file(**settings)).warnings)


def test_a_good_recording_raises_no_suspicion(planar, clock):
    checked = check_recording(recorded(planar, clock), planar, of_file())
    assert not [w for w in checked.warnings if "excited" not in w]
    assert (checked.agreement.sign > 0.9).all()
    assert abs(checked.agreement.lag) < 1e-9  # at the very sample
    assert checked.derived == ["acceleration"]
    assert 15 < checked.moving < 20
    json.dumps(checked.as_json(), allow_nan=False)


def test_degrees_for_radians_are_noticed(planar, clock):
    recording = recorded(planar, clock)
    turned = replace(recording, position=recording.position * 180 / math.pi)
    with pytest.raises(RecordingError, match="are these degrees"):
        check_recording(turned, planar, of_file())
    turned = replace(recording, position=recording.position * math.pi / 180)
    with pytest.raises(RecordingError, match="are these radians"):
        check_recording(turned, planar, of_file(), angle="deg")
    turned = replace(recording, velocity=recording.velocity * 180 / math.pi)
    with pytest.raises(RecordingError, match="one of them is in degrees"):
        check_recording(turned, planar, of_file())


@pytest.mark.parametrize(("unit", "size"), [("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_time_stamps_in_another_unit_are_noticed(planar, clock, unit, size):
    """In seconds they would be hours apart; what is said makes them right, whatever was declared."""
    recording = recorded(planar, clock)
    for declared, factor in (("s", 1.0), ("ms", 1e-3)):
        read = replace(recording, time=recording.time * size * factor)
        settings = of_file(units={"time": declared})
        if unit != declared:
            with pytest.raises(RecordingError, match=rf"another unit\? \(recording\.units\.time={unit}\)"):
                check_recording(read, planar, settings)


def test_currents_in_milliamperes_are_noticed(planar, clock):
    recording = recorded(planar, clock, ("position", "velocity", "current"))
    wrong = replace(recording, current=1e3 * recording.current)
    for arm, words in ((planar, "its limit"), (without_limits(planar), "what the description's links need")):
        assert check_recording(recording, arm, of_file(), (2.0, 2.0)).agreement.heavier == pytest.approx(
            1.0, abs=0.01
        )
        with pytest.raises(RecordingError, match=rf"times {words}: .*\(recording\.units\.current=mA\)"):
            check_recording(wrong, arm, of_file(), (2.0, 2.0))
        with pytest.raises(RecordingError, match=r"are the gains \(robot\.gains\)"):
            check_recording(wrong, arm, of_file(units={"current": "mA"}), (2.0, 2.0))
        with pytest.raises(RecordingError, match=r"are the gains \(robot\.gains\)"):
            check_recording(recording, arm, of_file(), (2e5, 2e5))


def test_torques_in_another_unit_are_noticed_and_can_be_insisted_on(planar, clock):
    recording = recorded(planar, clock)
    wrong = replace(recording, torque=1e3 * recording.torque)
    with pytest.raises(RecordingError, match=r"\(recording\.units\.torque=mNm\)") as error:
        check_recording(wrong, planar, of_file())
    limits = re.findall(r"(\w+): (\d+)", str(error.value).partition("robot.limits.effort={")[2])
    strong = load_robot("planar2", Setup(limits=Limits(effort={name: float(x) for name, x in limits})))
    assert check_recording(wrong, strong, of_file()).kept
    with pytest.raises(RecordingError, match="is it in N·m, and in this order"):
        check_recording(replace(recording, torque=1e7 * recording.torque), planar, of_file())


def test_limits_that_the_arms_own_links_exceed_are_none(planar, clock):
    weak = replace(planar, torque_limit=torch.full((2,), 1e-3, dtype=torch.float64))
    assert "the torque of shoulder, elbow is beyond the arm's limit" in joined_warnings(
        recorded(planar, clock), weak
    )


def without_limits(arm):
    return replace(arm, torque_limit=torch.full_like(arm.torque_limit, torch.inf))


def test_a_torque_that_stays_the_same_while_its_joint_moves_is_told(planar, clock):
    recording = recorded(planar, clock)
    stuck = recording.torque.clone()
    stuck[600:1900, 1] = stuck[600, 1]
    frozen = replace(recording, torque=stuck)
    words = "the torque of elbow stays the same from 6.00 s to 18.99 s, though it moves"
    assert words in joined_warnings(frozen, planar)
    halves = [part_of(frozen, 0, 1000), part_of(frozen, 1000, 2000)]
    assert statistics_of(halves).frozen == statistics_of(frozen).frozen
    rows = torch.tensor([k for k in range(2000) if not 600 <= k < 1900])
    assert "stays the same" not in joined_warnings(part_of(frozen, rows), planar)
    resting = replace(recording, position=torch.where(stuck == stuck[600, 1], 0.3, recording.position))
    assert "stays the same" not in joined_warnings(resting, planar)


def part_of(recording, first, last=None):
    """Some samples of a recording, from one number to another or those that are listed."""
    rows = slice(first, last) if last else first
    signals = {name: x[rows] for name, x in recording.signals().items()}
    return replace(recording, time=recording.time[rows], **signals)


def test_another_arm_is_asked_for(planar, clock):
    recording = recorded(planar, clock)
    torque = torch.sin(recording.time[:, None] * torch.tensor([3.1, 4.3]))
    words = "is this the arm, and are its joints in this order?"
    assert words in joined_warnings(replace(recording, torque=torque), planar)
    assert words not in joined_warnings(recording, planar)


def test_a_wrong_sign_is_noticed(planar, clock):
    recording = recorded(planar, clock)
    flipped = replace(recording, torque=recording.torque * torch.tensor([1.0, -1.0]))
    name = planar.joint_names[1]
    assert f"recording.reverse=[{name}]" in joined_warnings(flipped, planar)
    assert "reverse" not in joined_warnings(flipped, planar, reverse=[name])
    backwards = replace(recording, velocity=recording.velocity * torch.tensor([-1.0, 1.0]))
    assert "is its sign wrong?" in joined_warnings(backwards, planar)


@pytest.mark.parametrize("late", [0.08, -0.08])
def test_a_late_torque_is_noticed(planar, late):
    time = np.arange(2000) * 0.01
    shifted = recorded(planar, time - late).torque
    checked = check_recording(replace(recorded(planar, time), torque=shifted), planar, of_file())
    assert checked.agreement.lag == pytest.approx(late, abs=0.02)
    assert ("later" if late > 0 else "earlier") in "\n".join(checked.warnings)


def test_what_cannot_be_used_is_refused(planar, clock):
    recording = recorded(planar, clock)
    with pytest.raises(RecordingError, match="there is no motion"):
        check_recording(replace(recording, position=torch.ones_like(recording.position)), planar, of_file())
    with pytest.raises(RecordingError, match="every torque is zero"):
        check_recording(replace(recording, torque=torch.zeros_like(recording.torque)), planar, of_file())
    stuck = recording.torque.clone()
    stuck[:, 1] = 3.0
    with pytest.raises(RecordingError, match="torque of elbow is constant"):
        check_recording(replace(recording, torque=stuck), planar, of_file())
    with pytest.raises(RecordingError, match="neither torque nor current"):
        check_recording(recorded(planar, clock, ("position",)), planar, of_file())
    for dead in (torch.ones_like(recording.velocity), torch.zeros_like(recording.velocity)):
        with pytest.raises(RecordingError, match=r"velocity of shoulder, elbow is constant.*velocity=null"):
            check_recording(replace(recording, velocity=dead), planar, of_file())
    one = Recording("one", ("a",), recording.time, recording.position[:, :1], torque=recording.torque[:, :1])
    with pytest.raises(RecordingError, match="has 1 joint, planar2 has 2"):
        check_recording(one, planar, of_file())


def test_what_a_person_should_look_at_is_a_warning(planar, clock):
    recording = recorded(planar, clock)
    time = recording.time.clone()
    time[700] = time[699]
    time[1000:] += 2
    cut = recording.torque.clamp(max=float(recording.torque.max()) / 2)
    odd = replace(recording, time=time, torque=cut, corrupt=((7, "no number in q1"),))
    warnings = joined_warnings(odd, planar)
    for part in (
        "1 gap, the longest 2",
        "1 sample with the time stamp",
        "looks saturated",
        "1 corrupt row, left out; the first is row 7: no number",
    ):
        assert part in warnings
    still = recording.position.clone()
    still[:, 1] = 0.3
    warnings = joined_warnings(replace(recording, position=still, velocity=None), planar)
    assert f"{planar.joint_names[1]} never moves" in warnings


def test_the_ur10e_is_found_sound_but_for_a_joint_that_does_not_tell():
    arm = load_robot(real("ur10e/reference.urdf"))
    path = real("ur10e/recorded_20s8h.csv")
    checked = check_recording(load_recording(path, of_file(), arm.joint_names), arm, of_file(), GAINS)
    assert (checked.agreement.sign[:5] > 0.5).all()
    assert checked.warnings == [
        "the motion does not tell whether the sign of the torque of wrist_3_joint is right"
    ]
    assert 0.3 < checked.statistics.bandwidth < 0.5 and len(checked.segments) == 1


def test_the_lwr_is_found_poorly_excited(arm):
    path = real("kuka_lwr4/recorded_hw1_50hz.csv")
    checked = check_recording(load_recording(path, of_file(), arm.joint_names), arm, of_file())
    assert (checked.agreement.sign[:4] > 0.9).all()
    warnings = "\n".join(checked.warnings)
    assert "does not tell whether the sign of the torque of joint_5, joint_6, joint_7 is right" in warnings
    assert "hardly excited" in warnings and checked.derived == []


@pytest.mark.parametrize("size", [1e-4, 0.005])
def test_a_file_that_hardly_moves_is_told_as_that(planar, clock, size):
    recording = recorded(planar, clock)
    with pytest.raises(RecordingError, match=r"made hardly moves: no joint by more than 0\.0"):
        check_recording(replace(recording, position=size * recording.position), planar, of_file())
    assert "hardly moves" in joined_warnings(replace(recording, position=0.1 * recording.position), planar)
    assert "hardly moves" not in joined_warnings(recording, planar)


def test_a_part_of_a_recording_is_held_out(planar, clock):
    clock[900:] += 3.0
    checked = check_recording(recorded(planar, clock), planar, of_file())
    first, last = split(checked, 0.3)
    assert (first.role, last.role) == ("training", "validation")
    assert first.name == "made, first 70%" and last.name == "made, last 30%"
    assert last.kept == round(0.3 * checked.kept) or last.kept == checked.kept - round(0.7 * checked.kept)
    assert len(first.segments) == 2 and len(last.segments) == 1
    apart = float(last.segments[0].time[0] - first.segments[-1].time[-1])
    assert apart > 1 / checked.grid.cutoff  # what the low-pass mixes is in neither
    for part in (first, last):
        torch.testing.assert_close(
            part.segments[-1].torque[-1:], sample_at(checked, part.segments[-1].time[-1])
        )
    with pytest.raises(RecordingError, match="too short to hold out 1%"):
        split(checked, 0.01)


def test_drives_that_count_the_other_way_round_have_the_same_noise(planar, clock):
    """A gain below zero must not make the noise of a joint nothing."""
    recording = recorded(planar, clock)
    noisy = replace(recording, torque=recording.torque + 0.1 * torch.randn(recording.torque.shape).double())
    gains = torch.tensor([-2.0, 3.0], dtype=torch.float64)
    currents = replace(noisy, torque=None, current=noisy.torque / gains)
    one = check_recording(noisy, planar, of_file())
    other = check_recording(currents, planar, of_file(), gains.tolist())
    assert other.excitation.condition_number == pytest.approx(one.excitation.condition_number)


def sample_at(checked, time):
    """The torque of one kept sample."""
    return torch.cat([segment.torque[segment.time == time] for segment in checked.segments])
