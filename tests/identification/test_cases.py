"""Recordings that do not fit their description: the verdict on each kind."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
import yaml

from sidegan.identification.causes import implausible_links, implausible_mass
from sidegan.identification.verdict import BAD, GOOD, USABLE
from sidegan.motion.dynamics import RigidBody
from sidegan.recording.units import Counts
from sidegan.report.identification.content import advice, facts
from sidegan.robot import Setup, load_robot
from tests.identification.recordings import COULOMB, VISCOUS, checked, identified
from tests.recording.conftest import of_file

SIZE = 9.81
ARM = load_robot("kuka_lwr4")


def recorded(seed, change=None, arm=ARM, truth=None):
    """A recording of a motion that excites every joint, so that verdicts are about what is changed."""
    return checked(arm, seed, truth, change, rate=100, friction=(VISCOUS[0], COULOMB[0]), period=6.0)


def recordings(change=None, arm=ARM, truth=None):
    """One recording to identify from and another to test with, both changed."""
    return [recorded(seed, change, arm, truth) for seed in (2, 3)]


def judged(training, validation=None):
    """An arm identified with one conic program, not one a round."""
    return identified(ARM, [training], [] if validation is None else [validation], strength=1.0)


def of_torques(change):
    """A recording with other torques."""
    return lambda made: replace(made, name="changed", torque=change(made))


def scaled(*factors):
    return of_torques(lambda made: made.torque * factors)


def zeros(*off):
    """Positions that count from elsewhere."""
    return lambda made: replace(made, position=made.position + off)


@of_torques
def without_gravity(made):
    return made.torque - RigidBody(ARM).torque(made.position, 0 * made.position, 0 * made.position)


@of_torques
def late(made):
    """Torques of 200 ms before."""
    return np.roll(made.torque, 20, 0)


@of_torques
def swapped(made):
    return made.torque[:, [0, 2, 1, 3, 4, 5, 6]]


@of_torques
def offset(made):
    return made.torque + np.array([0, 0, 9.0, 0, 0, 0, 0])


@of_torques
def touching(made):
    """A push for a second, in the middle."""
    pushed = np.abs(made.time - 6.5) < 0.5
    return made.torque + 10.0 * pushed[:, None] * [0, 1, 1, 1, 1, 0, 0]


@of_torques
def drifting(made):
    return made.torque + np.outer(made.time, [0, 0, 0, 1.0, 0, 0, 0])


@of_torques
def of_motors(made):
    """Torques that accelerate rotors too, which the model of joint torques lacks."""
    rotors = np.array([3.0, 3, 2, 2, 0.5, 0.5, 0.2])
    return made.torque + rotors * np.gradient(made.velocity, 0.01, axis=0)


@of_torques
def saturated(made):
    return np.clip(made.torque, None, [60.0, 20.0, 60.0, 60.0, 60.0, 60.0, 60.0])


@of_torques
def colder(made):
    return made.torque + 0.7 * (VISCOUS[0] * made.velocity + COULOMB[0] * np.tanh(made.velocity / 0.01))


def written_twice(made):
    """The positions of a joint in the place of another's."""
    return replace(made, position=made.position[:, [0, 1, 2, 3, 4, 3, 6]], velocity=None)


def pulled(made):
    """Something that pulls at a joint, and a wrong acceleration, which is derived instead."""
    wrong = 0.5 * np.gradient(made.velocity, 0.01, axis=0)
    pull = 6.0 * np.sin(3.3 * made.time)[:, None] * [0, 0, 0, 0, 1, 0, 0]
    return replace(made, torque=made.torque + pull, acceleration=wrong)


@of_torques
def of_belt(made):
    """The sixth motor carries the fifth joint's torque, too."""
    return made.torque - made.torque[:, [4]] * np.eye(7)[5]


@of_torques
def rated(made):
    return 100 * made.torque / ARM.torque_limit


OFF = "^the encoder zero looks off: joint_2 by \\+0\\.3 rad"
TOUCHED = r"^from 6\.\S+ s to 7\S* s of changed the residual of .*joint_3.* did the arm touch something"
DRIFTS = r"^through changed the torque drifts, of joint_4 by 1[45] N·m or N: does a sensor warm up"
# What is made of both recordings, the verdict, and its first reason.
CASES = [
    (without_gravity, BAD, "contain no gravity"),
    (scaled(*[0.25] * 3, *[1] * 4), BAD, r"0\.25 \(joint_1\), 0\.25 \(joint_2\), 0\.25 \(joint_3\) times"),
    (scaled(3.0, *[1.0] * 6), USABLE, r"3 \(joint_1\) times those"),
    (scaled(*[0.7] * 7), USABLE, "^all torques are 0.70 times the description's: drive constants or masses"),
    (late, BAD, "^torques are 200 ± .* later than the motion: not corrected; recording.delay=null corrects"),
    (scaled(1, -1, *[1] * 5), BAD, r"^the torque of joint_2 runs against .*recording.reverse=\[joint_2\]"),
    (
        scaled(*[-1] * 7),
        BAD,
        r"^the torque of .* count torques the other way\? .*reverse=\[joint_1,.*,joint_7\]",
    ),
    (
        of_belt,
        BAD,
        r"^the torque of joint_6 looks like its own and -1 times that of joint_5, .*"
        r"'recording\.torque_coupling=\{joint_6: \{joint_5: 1, joint_6: 1\}\}'",
    ),
    (
        rated,
        USABLE,
        r"^the torques look like per cent of each joint's limit; .*robot.gains=\[1.76,1.76,1,1,1,0.38,0.38\]",
    ),
    (scaled(*[1] * 6, -1), BAD, r"^the friction of joint_7 would drive .* \(recording.reverse=\[joint_7\]\)"),
    (swapped, BAD, "^torques look swapped: that of joint_2 fits joint_3"),
    (scaled(1, 1, 1, 1.1, 1, 1, 1), USABLE, "^the torque of joint_4 is 1.1. times what the other joints"),
    (offset, GOOD, r"^joint 3 \(joint_3\): its torque has an offset of 9.* ± .* was the sensor tared"),
    (touching, BAD, TOUCHED),
    (
        lambda made: scaled(*[0.25] * 7)(touching(made)),
        BAD,
        r"^measured torques are 0\.25 \(joint_1\).* times those",
    ),
    (drifting, USABLE, DRIFTS),
    (of_motors, BAD, r"^rotors explain the residuals: with model=motor_current the mean nMSE is \S+e-05 "),
    (zeros(0, 0.3, 0, 0, 0, 0, 0), BAD, OFF + r"; .* be 0\.000\d+ instead of 0\.0"),
    (zeros(0, 0.3, 0, -0.2, 0, 0, 0), BAD, OFF + r", joint_4 by -0\.2\d* rad; "),
    (written_twice, BAD, "^the positions of joint_4 and joint_6 are the same column"),
    (pulled, BAD, r"^joint 5 \(joint_5\): the model leaves"),
    # nothing depends on the first zero; the last link makes up for its own
    (zeros(0.3, 0, 0, 0, 0, 0, 0.3), GOOD, "^mean nMSE"),
]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("change", "verdict", "words"), CASES, ids=[words for *_, words in CASES])
def test_a_fault_of_the_recordings_comes_first(change, verdict, words):
    quality = judged(*recordings(change)).quality
    first, *_ = (reason for reason in quality.reasons if not reason.startswith("the description is right"))
    assert re.search(words, first) and quality.verdict == verdict
    assert quality.causes or quality.verdict == GOOD
    assert change is not pulled or ("derived instead" in quality.reasons[-1] and not quality.faulty)


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
    assert advice(result).startswith("Use none")
    assert not any("use this" in name for name in facts(result))
    said = [float(x) for x in first.partition("robot.mount=[")[2].partition("]")[0].split(",")]
    turned, truth = (load_robot("kuka_lwr4", Setup(mount=tuple(angles))) for angles in (said, mount))
    training, validation = recordings(arm=turned, truth=truth)
    again = identified(turned, [training], [validation], strength=1.0)
    assert again.quality.verdict == GOOD
    assert again.tested["consistent"].nmse_mean < 0.5 * result.tested["consistent"].nmse_mean


def test_reversed_torques_without_noise_have_a_verdict(planar):
    """No possible links explain them, so the residuals of the consistent fit are many times the noise."""
    changes = {"change": of_torques(lambda made: -made.torque), "friction": (0.5, 0.3), "noise": 0.0}
    both = [checked(planar, seed, **changes) for seed in (0, 1)]
    quality = identified(planar, both[:1], both[1:], strength=1.0).quality
    assert quality.verdict == BAD and "recording.reverse=[shoulder,elbow]" in quality.reasons[0]


def in_order(order, *names):
    """Columns of some signals in another order."""
    return lambda made: replace(made, **{name: getattr(made, name)[:, order] for name in names})


def turned_round(made):
    """A joint whose axis points the other way."""
    signs = [1, 1, 1, -1, 1, 1, 1]
    return replace(made, **{name: signs * getattr(made, name) for name in MOTION}, torque=signs * made.torque)


def slower(made):
    """Time stamps of half the pace."""
    return replace(made, time=2 * made.time, velocity=None, acceleration=None)


def recorded_as(factor, zero=0.0):
    """Positions with a zero [rad] elsewhere, and rates, in other units or of motors."""

    def change(made):
        return replace(made, position=(made.position - zero) * factor, velocity=made.velocity * factor)

    return change


def counted(made):
    """The fourth angle counted from the third."""
    both = np.eye(7) + np.outer(np.eye(7)[3], np.eye(7)[2])
    return replace(made, position=made.position @ both.T, velocity=made.velocity @ both.T)


SPAN = ARM.position_upper - ARM.position_lower
MIDDLE = ARM.position_lower + SPAN / 2
RATIOS = np.array([2.0, 2.5, 2.0, 1.5, 1.5, 1.0, 1.0])  # of gears, times π/180
OTHER_UNITS = [  # how positions are recorded, and the question
    (recorded_as(0.5 / np.pi), r"^are the positions in turns\?"),
    (recorded_as(2 / SPAN, MIDDLE), r"^are the positions in shares of it \(−1 to 1\)\?"),
    (recorded_as(RATIOS), "^positions divided by about .* are they those of the motors"),
]


@pytest.mark.parametrize(("change", "words"), OTHER_UNITS, ids=[words for _, words in OTHER_UNITS])
def test_the_advised_unit_of_positions_makes_the_model_good(change, words):
    first, *_ = judged(*recordings(change)).quality.reasons
    assert re.search(words, first)
    said = yaml.safe_load(first.partition("position=")[2].partition("'")[0].rpartition("}")[0] + "}")

    def followed(made):
        there = change(made)
        counts = Counts(**said).in_si(there.position, [False] * 7)
        return replace(there, position=counts, velocity=None)

    assert judged(*recordings(followed)).quality.verdict == GOOD


def of_differential(made):
    """Two motors drive the fifth and sixth joint by their mean and half their difference."""
    coupling = np.eye(7)
    coupling[4:6, 4:6] = [[1, 1], [1, -1]]  # of the motors' positions, and of the joints' torques
    motion = {name: getattr(made, name) @ coupling.T for name in ("position", "velocity")}
    return replace(made, torque=made.torque @ np.linalg.inv(coupling), **motion)


@of_torques
def of_ratio(made):
    """The fifth motor carries half of the sixth joint's torque, too."""
    return made.torque + 0.5 * made.torque[:, [5]] * np.eye(7)[4]


COUPLED = [
    (counted, "^the position of joint_4 looks counted from joint_3's"),
    (of_differential, "^joint_5 and joint_6 look driven by a differential"),
    (of_ratio, "^the torque of joint_5 looks like its own and 0.5 times that of joint_6"),
]


@pytest.mark.parametrize(("change", "words"), COUPLED, ids=[words for _, words in COUPLED])
def test_the_advised_coupling_makes_the_model_good(change, words):
    first, *_ = judged(*recordings(change)).quality.reasons
    assert re.search(words, first)
    said = re.findall(r"'recording\.(\w+)=(\{.*?\})'", first)
    settings = of_file(**{name: yaml.safe_load(value) for name, value in said})
    motion, torque = settings.motion_matrix(ARM.joint_names), settings.torque_matrix(ARM.joint_names)

    def followed(made):
        there = change(made)
        states = {name: getattr(there, name) @ motion.T for name in ("position", "velocity")}
        return replace(there, torque=there.torque @ torque.T, **states)

    assert judged(*recordings(followed)).quality.verdict == GOOD


def test_a_description_that_is_right_is_said_to_be():
    quality = judged(*recordings()).quality
    first, *_ = quality.reasons
    assert quality.verdict == GOOD and first.startswith("the description is right: its own links predict")


LOAD = r"^a load of 0\.[45]\d* kg at \(.*\) m on link_7 explains the difference from the description"
HEAVIER = r"^.*link_4 \(2(\.\d)? kg more\).* alone differs from the description$"
LIGHTER = r"^.*link_7.* alone differs from the description$"
DIFFERENT_LINKS = [(6, 0.5, 0.02, LOAD), (3, 2.0, 0.3, HEAVIER), (6, -0.15, -0.02, LIGHTER)]


@pytest.mark.parametrize(("link", "mass", "moment", "words"), DIFFERENT_LINKS)
def test_what_alone_differs_from_the_description_is_named_first(link, mass, moment, words):
    links = ARM.inertial_parameters.copy()
    links[link, [0, 3]] += mass, moment
    quality = judged(*recordings(truth=replace(ARM, inertial_parameters=links))).quality
    assert quality.verdict == GOOD and re.search(words, quality.reasons[0])


def test_a_description_and_recording_in_degrees_are_asked_for():
    """Limits in degrees do not show it, so that nothing but the torques does."""
    wide = replace(ARM, position_lower=60 * ARM.position_lower, position_upper=60 * ARM.position_upper)
    recording = recorded(2, recorded_as(180 / np.pi), wide, ARM)
    assert "are these degrees? (recording.units.angle=deg)" in recording.warnings
    assert not any("right arm" in warning for warning in recording.warnings)


MOTION = "position", "velocity"
ORDER = r"'recording\.joints=\[2,4,5,1,7,3,6\]' 'recording\.pos"
WARNED = [
    (in_order([3, 0, 5, 1, 2, 6, 4], *MOTION, "torque"), BAD, "another joint order.* " + ORDER),
    (in_order([0, 3, 2, 1, 4, 5, 6], *MOTION), BAD, "the motions of joint_2 and joint_4 look swapped"),
    (
        counted,
        BAD,
        "the position of joint_4 looks counted from joint_3's, as from the horizontal: 'rec",
    ),
    (turned_round, BAD, "the axis of joint_4 looks reversed"),
    (slower, USABLE, r"^with a motion (2|1\.9\d|2\.0\d) times as fast .* are the time stamps right"),
]


@pytest.mark.parametrize(("change", "verdict", "words"), WARNED, ids=[words for *_, words in WARNED])
def test_columns_and_time_that_do_not_fit_are_reported(change, verdict, words):
    recording = recorded(2, change)
    assert any(re.search(words, warning) for warning in recording.warnings)
    quality = judged(recording).quality
    assert quality.verdict == verdict and re.search(words, quality.reasons[0])


def carrying(made):
    """A recording with 2 kg in the hand."""
    links = ARM.inertial_parameters.copy()
    links[-1, [0, 3]] += [2.0, 0.2]
    loaded = RigidBody(replace(ARM, inertial_parameters=links))
    motion = made.position, made.velocity, np.gradient(made.velocity, 0.01, axis=0)
    load = loaded.torque(*motion) - RigidBody(ARM).torque(*motion)
    return replace(made, name="changed", torque=made.torque + load)


def picking(made):
    """A recording with these 2 kg in the hand for a third of it."""
    held = (made.time > 4) & (made.time < 9)
    return replace(made, name="changed", torque=np.where(held[:, None], carrying(made).torque, made.torque))


def test_a_load_held_for_a_while_is_named_with_its_time():
    quality = judged(recorded(2, picking), recorded(3)).quality
    assert quality.verdict != GOOD
    said = re.search(
        r"^from (\S+) s to (\S+) s of changed .* \+(\S+) ± .* kg on link_7.*held", quality.reasons[0]
    )
    np.testing.assert_allclose([float(x) for x in said.groups()], [4.0, 9.0, 2.0], rtol=0.2)


def test_joints_before_one_without_a_torque_are_identified_alone():
    first = load_robot("kuka_lwr4", Setup(tip="link_6"))

    def without(made):
        signals = {name: x[:, :6] for name, x in made.signals().items()}
        return replace(made, joint_names=first.joint_names, **signals)

    training, validation = recordings(without, first, ARM)
    assert identified(first, [training], [validation], strength=1.0).quality.verdict == GOOD


COLD = r"^in changed the friction of joint_1, joint_2.* differs: is the arm warmer or colder there, or"
DIFFERENT = [  # change of the first recording, of the second, and the first reason
    (None, carrying, r"^changed was recorded with a different load .*: \+2 ± .* kg on "),
    (None, colder, COLD),
    (saturated, None, "^changed: the torque of joint_2 looks saturated"),
    (saturated, colder, "the friction of .* differs"),
]


@pytest.mark.parametrize(("first", "second", "words"), DIFFERENT)
def test_what_differs_between_recordings_is_named(first, second, words):
    quality = judged(recorded(2, first), recorded(3, second)).quality
    assert quality.verdict != GOOD and re.search(words, quality.reasons[0])


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
