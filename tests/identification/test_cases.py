"""Recordings that do not fit their description: the verdict on each kind."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from sidegan.identification.verdict import BAD, GOOD, USABLE, implausible_links, implausible_mass
from sidegan.motion.dynamics import RigidBody
from sidegan.report.identification.content import advice, facts
from sidegan.robot import Setup, load_robot
from tests.identification.recordings import COULOMB, VISCOUS, checked, identified

SIZE = 9.81
ARM = load_robot("kuka_lwr4")


def recorded(seed, change=None, arm=ARM, truth=None):
    """A recording of a motion that excites every joint, so that verdicts are about what is changed."""
    return checked(arm, seed, truth, change, rate=100, friction=(VISCOUS[0], COULOMB[0]), period=6.0)


def recordings(arm=ARM, change=None, truth=None):
    """One recording to identify from and another to test with, with what a change makes of the torques."""
    changed = None if change is None else lambda made: replace(made, torque=change(made))
    return [recorded(seed, changed, arm, truth) for seed in (2, 3)]


def judged(training, validation=None):
    """An arm identified with one conic program, not one a round."""
    return identified(ARM, [training], [] if validation is None else [validation], strength=1.0)


def scaled(*factors):
    return lambda made: made.torque * factors


def without_gravity(made):
    return made.torque - RigidBody(ARM).torque(made.position, 0 * made.position, 0 * made.position)


def late(made):
    """Torques of 200 ms before."""
    return np.roll(made.torque, 20, 0)


def swapped(made):
    return made.torque[:, [0, 2, 1, 3, 4, 5, 6]]


def offset(made):
    return made.torque + np.array([0, 0, 9.0, 0, 0, 0, 0])


def of_motors(made):
    """Torques that accelerate rotors too, which the model of joint torques lacks."""
    rotors = np.array([3.0, 3, 2, 2, 0.5, 0.5, 0.2])
    return made.torque + rotors * np.gradient(made.velocity, 0.01, axis=0)


def touching(made):
    """A push for a second, in the middle."""
    pushed = np.abs(made.time - 6.5) < 0.5
    return made.torque + 10.0 * pushed[:, None] * [0, 1, 1, 1, 1, 0, 0]


def drifting(made):
    return made.torque + np.outer(made.time, [0, 0, 0, 1.0, 0, 0, 0])


# What is made of the torques, the verdict, and its first reason.
CASES = [
    (None, GOOD, "the description is right"),
    (without_gravity, BAD, "contain no gravity"),
    (
        scaled(*[0.25] * 3, *[1.0] * 4),
        BAD,
        r"0\.25 \(joint_1\), 0\.25 \(joint_2\), 0\.25 \(joint_3\) times those",
    ),
    (scaled(3.0, *[1.0] * 6), USABLE, r"3 \(joint_1\) times those"),
    (scaled(*[0.7] * 7), GOOD, ""),
    (late, BAD, "^torques are 200 ± .* later than the motion: not corrected; recording.delay=null corrects"),
    (
        scaled(1, -1, 1, 1, 1, 1, 1),
        BAD,
        r"^the torque of joint_2 runs against .*recording.reverse=\[joint_2\]",
    ),
    (scaled(*[-1] * 7), BAD, "^the torque of joint_1, .* runs against the description"),
    (
        scaled(1, 1, 1, 1, 1, 1, -1),
        BAD,
        r"^the friction of joint_7 would drive the motion: .* \(recording.reverse=\[joint_7\]\)",
    ),
    (swapped, BAD, "^torques look swapped: that of joint_2 fits joint_3"),
    (scaled(1, 1, 1, 1.1, 1, 1, 1), USABLE, "^the torque of joint_4 is 1.1. times what the other joints"),
    (offset, GOOD, r"^joint 3 \(joint_3\): its torque has an offset of 9.* ± .* was the sensor tared"),
    (
        touching,
        BAD,
        r"^from 6\.\S+ s to 7\S* s of made the residual of .*joint_3.* did the arm touch something",
    ),
    (
        drifting,
        USABLE,
        r"^through made the torque drifts, of joint_4 by 1[45] N·m or N: does a sensor warm up",
    ),
    (of_motors, BAD, r"^rotors explain the residuals: with model=motor_current the mean nMSE is \S+e-05 "),
]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("change", "verdict", "words"), CASES, ids=[words for *_, words in CASES])
def test_a_fault_of_the_recordings_comes_first_and_suppresses_advice(change, verdict, words):
    quality = judged(*recordings(change=change)).quality
    assert re.search(words, quality.reasons[0]) and quality.verdict == verdict
    if quality.verdict != GOOD:
        assert quality.causes and not any("excite it" in reason for reason in quality.reasons)


TILTED = (math.sqrt(0.5), 0.0, -math.sqrt(0.5))
SLOPE = (0.0, math.sin(0.1), -math.cos(0.1))
TURNED = [
    ((0, 0, 1), "along +z of the base, by the description along −z", [math.pi, 0, 0]),
    (SLOPE, "along (0.00, 0.10, -1.00) of the base", [-0.1, 0, 0]),
    (TILTED, "along (0.71, 0.00, -0.71) of the base", [0, math.pi / 4, 0]),
]


@pytest.mark.parametrize(("direction", "words", "mount"), TURNED, ids=[words for _, words, _ in TURNED])
def test_gravity_along_another_direction_is_reported_with_the_mount_to_set(direction, words, mount):
    result = judged(*recordings(truth=replace(ARM, gravity=SIZE * np.array(direction))))
    first = result.quality.reasons[0]
    assert result.quality.verdict == BAD and words in first and "reverse" not in first
    assert advice(result).startswith("Use none") and not any("excite it" in x for x in result.quality.reasons)
    assert not any("use this" in name for name in facts(result))
    said = [float(x) for x in first.partition("robot.mount=[")[2].partition("]")[0].split(",")]
    turned, truth = (load_robot("kuka_lwr4", Setup(mount=tuple(angles))) for angles in (said, mount))
    training, validation = recordings(turned, truth=truth)
    again = identified(turned, [training], [validation], strength=1.0)
    assert again.quality.verdict == GOOD
    assert again.tested["consistent"].nmse_mean < 0.5 * result.tested["consistent"].nmse_mean


@pytest.mark.parametrize("noise", [1e-4, 0.0])
def test_reversed_torques_without_noise_have_a_verdict(planar, noise):
    """No possible links explain them, so the residuals of the consistent fit are many times the noise."""

    def reverse(made):
        return replace(made, torque=-made.torque)

    both = [checked(planar, seed, None, reverse, friction=(0.5, 0.3), noise=noise) for seed in (0, 1)]
    quality = identified(planar, both[:1], both[1:], strength=1.0).quality
    assert quality.verdict == BAD and "recording.reverse=[shoulder,elbow]" in quality.reasons[0]


def test_reversed_torques_are_not_mistaken_for_reversed_gravity():
    every = recorded(2, lambda made: replace(made, torque=-made.torque))
    warnings = "\n".join(every.warnings)
    assert not every.agreement.turned and "recording.reverse=[joint_1" in warnings
    assert "hardly any torque matches" not in warnings


EXCHANGED = [  # order of positions and velocities in the file, signs of all, and what is reported
    ([0, 3, 2, 1, 4, 5, 6], [1] * 7, "the motions of joint_2 and joint_4 look swapped"),
    ([*range(7)], [1, 1, 1, -1, 1, 1, 1], "the axis of joint_4 looks reversed"),
]


def test_another_order_of_all_columns_is_reported_with_the_setting():
    order = [3, 0, 5, 1, 2, 6, 4]  # of the arm's joints in the file
    signals = ("position", "velocity", "torque")

    def shuffled(made):
        return replace(made, **{name: getattr(made, name)[:, order] for name in signals})

    first = recorded(0, shuffled).warnings[0]
    assert "another joint order" in first and "'recording.joints=[2,4,5,1,7,3,6]' 'recording.pos" in first


@pytest.mark.parametrize(("order", "signs", "words"), EXCHANGED)
def test_swapped_and_reversed_motion_columns_are_reported(order, signs, words):
    def exchanged(made):
        motion = {name: signs * getattr(made, name)[:, order] for name in ("position", "velocity")}
        return replace(made, torque=signs * made.torque, **motion)

    recording = recorded(0, exchanged)
    assert words in recording.warnings[0]
    quality = judged(recording).quality
    assert quality.verdict == BAD and words in quality.reasons[0]


ZEROS = [  # what is added to positions, and what is reported
    (
        [0, 0.3, 0, 0, 0, 0, 0],
        r"^the encoder zero looks off: joint_2 by \+0\.3 rad; .* be 0\.000\d+ instead of 0\.0",
    ),
    ([0, 0.3, 0, -0.2, 0, 0, 0], r"joint_2 by \+0\.3 rad, joint_4 by -0\.2\d* rad; "),
    (
        [0.3, 0, 0, 0, 0, 0, 0.3],
        "^mean nMSE",
    ),  # nothing depends on the first; the last link makes up for its own
]


@pytest.mark.parametrize(("zeros", "words"), ZEROS)
def test_encoder_zeros_that_are_off_are_reported(zeros, words):
    both = [recorded(seed, lambda made: replace(made, position=made.position + zeros)) for seed in (2, 3)]
    quality = judged(*both).quality
    assert re.search(words, quality.reasons[0])
    assert (quality.verdict == GOOD) == words.startswith("^mean")


def carrying(seed, since=0.0):
    """A recording with 2 kg in the hand, picked up at some time [s]."""
    links = ARM.inertial_parameters.copy()
    links[-1, [0, 3]] += [2.0, 0.2]
    loaded = RigidBody(replace(ARM, inertial_parameters=links))

    def pick_up(made):
        motion = made.position, made.velocity, np.gradient(made.velocity, 0.01, axis=0)
        load = loaded.torque(*motion) - RigidBody(ARM).torque(*motion)
        return replace(made, name="carrying", torque=made.torque + load * (made.time >= since)[:, None])

    return recorded(seed, pick_up)


def test_a_recording_with_another_load_is_reported():
    quality = judged(recorded(2), carrying(3)).quality
    assert re.search(r"^carrying was recorded with a different load .*: \+2 ± .* kg on ", quality.reasons[0])


def colder(made):
    return made.torque + 0.7 * (VISCOUS[0] * made.velocity + COULOMB[0] * np.tanh(made.velocity / 0.01))


def colder_at_first(made):
    return np.where(made.time[:, None] < 6.0, colder(made), made.torque)


def saturated(made):
    return np.clip(made.torque, None, [60.0, 20.0, 60.0, 60.0, 60.0, 60.0, 60.0])


DIFFERENT = [  # change of the torques in training, in validation, and the first reason
    (
        None,
        colder,
        "^in changed the friction of joint_1, joint_2.* differs: is the arm warmer or colder there, or",
    ),
    (colder_at_first, None, r"^from about (5|6|7)\S* s of changed on the friction of joint_1.* differs"),
    (saturated, None, "^changed: the torque of joint_2 looks saturated"),
    (saturated, colder, "the friction of .* differs"),
    (None, swapped, "^changed: torques look swapped: that of joint_2 fits joint_3"),
]


@pytest.mark.parametrize(("training", "validation", "words"), DIFFERENT)
def test_what_differs_between_or_within_recordings_is_named(training, validation, words):
    def changed(change):
        return change and (lambda made: replace(made, name="changed", torque=change(made)))

    both = [recorded(seed, changed(change)) for seed, change in ((2, training), (3, validation))]
    quality = judged(*both).quality
    assert quality.verdict != GOOD and re.search(words, quality.reasons[0])


@pytest.mark.parametrize("pace", [0.5, 2.0])
def test_a_clock_of_another_pace_is_reported(pace):
    def slower(made):
        return replace(made, time=pace * made.time, velocity=None, acceleration=None)

    found = recorded(2, slower).agreement
    assert found.pace == pytest.approx(pace, rel=0.05)
    (doubt, *_) = found.doubts(ARM)
    assert "are the time stamps right" in doubt


@pytest.mark.parametrize("since", [5.0, 9.0])
def test_an_object_that_is_picked_up_within_a_recording_is_reported(since):
    quality = judged(carrying(2, since), recorded(3)).quality
    said = re.search(
        r"^from about (\S+) s of carrying on the load differs: \+2 ± .* kg on ", quality.reasons[0]
    )
    assert quality.verdict == BAD and abs(float(said[1]) - since) < 1.2


@pytest.mark.parametrize(("size", "told"), [(1.0, True), (0.02, False)])
def test_the_sign_of_a_joint_that_hardly_moves_is_unknown(size, told):
    def moved_less(made):
        q, v = (x * [1, 1, 1, 1, 1, size, 1] for x in (made.position, made.velocity))
        torque = RigidBody(ARM).torque(q, v, np.gradient(v, 0.01, axis=0))
        return replace(made, position=q, velocity=v, torque=torque * [1, 1, 1, 1, 1, -1, 1])

    warnings = "\n".join(recorded(0, moved_less).warnings)
    assert ("reverse=[joint_6]" in warnings) == told
    unknown = re.search("does not show whether the sign of the torque of .*joint_6", warnings)
    assert (unknown is None) == told


@pytest.mark.parametrize(("found", "said"), [(19.9, 0), (20.1, 1), (0.201, 0), (0.199, 1)])
def test_a_mass_ten_times_off_is_reported(found, said):
    assert [finding.level for finding in implausible_mass(found, 2.0)] == said * [USABLE]


def test_implausible_links_are_reported():
    links = ARM.inertial_parameters.copy()
    assert implausible_links(ARM, links) == []
    links[3] *= 12
    assert [(finding.level, finding.joint) for finding in implausible_links(ARM, links)] == [(USABLE, 3)]
    links = ARM.inertial_parameters.copy()
    links[2, 1] = 2.0 * links[2, 0]
    (found,) = implausible_links(ARM, links)
    assert found.level == BAD and "beyond the arm's reach" in found.text
