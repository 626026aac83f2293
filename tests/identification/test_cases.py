"""Recordings that do not fit their description: each fault is named first, with what sets it right."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
import yaml

from sidegan.identification.description import implausible_links, implausible_mass
from sidegan.identification.verdict import BAD, GOOD, USABLE
from sidegan.motion.dynamics import RigidBody
from sidegan.recording.check import check_recording
from sidegan.recording.recording import Recording
from sidegan.recording.units import Counts
from sidegan.report.identification.content import advice, facts
from sidegan.robot import Setup, load_robot
from tests.identification.recordings import COULOMB, VISCOUS, checked, identified, multisine
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


# Change of both recordings, the verdict, and what its first reason names.
FAULTS = {
    "no gravity": (without_gravity, BAD, "no gravity"),
    "three at a quarter": (scaled(0.25, 0.25, 0.25, 1, 1, 1, 1), BAD, "0.25 (joint_1)", "0.25 (joint_3)"),
    "one at three": (scaled(3.0, *[1.0] * 6), USABLE, "3 (joint_1)", "robot.gains"),
    "all at 0.7": (scaled(*[0.7] * 7), USABLE, "0.70", "robot.gains"),
    "late": (late, BAD, "200 ±", "recording.delay=null"),
    "one reversed": (scaled(1, -1, *[1] * 5), BAD, "joint_2 runs", "recording.reverse=[joint_2]"),
    "all reversed": (scaled(*[-1] * 7), BAD, "recording.reverse=[joint_1, ", ", joint_7]"),
    "the last reversed": (scaled(*[1] * 6, -1), BAD, "friction of joint_7", "recording.reverse=[joint_7]"),
    "a belt": (of_belt, BAD, "'recording.torque_coupling={joint_6: {joint_5: 1, joint_6: 1}}'"),
    "per cent": (rated, USABLE, "per cent", "robot.gains=[1.76, 1.76, 1, 1, 1, 0.38, 0.38]"),
    "swapped": (swapped, BAD, "joint_2 fits joint_3", "recording.torque"),
    "one at 1.1": (scaled(1, 1, 1, 1.1, 1, 1, 1), USABLE, "joint_4 is 1.1", "robot.gains"),
    "an offset": (offset, GOOD, "joint_3", "offset of 9"),
    "a contact": (touching, BAD, "from 6.", "s of changed", "joint_3"),
    "a contact, at a quarter": (lambda x: scaled(*[0.25] * 7)(touching(x)), BAD, "0.25 (joint_1)"),
    "a drift": (drifting, USABLE, "changed", "joint_4 by 1"),
    "rotors": (of_motors, BAD, "model.rotor_inertia=true", "e-05 instead"),
    "a zero": (zeros(0, 0.3, 0, 0, 0, 0, 0), BAD, "encoder zero", "joint_2 by +0.3", "be 0.000"),
    "two zeros": (zeros(0, 0.3, 0, -0.2, 0, 0, 0), BAD, "joint_2 by +0.3", "joint_4 by -0.2"),
    "zeros that nothing shows": (zeros(0.3, 0, 0, 0, 0, 0, 0.3), GOOD, "mean nMSE"),
    "a column twice": (written_twice, BAD, "joint_4 and joint_6"),
    "a pull": (pulled, BAD, "joint 5 (joint_5)", "leaves"),
}


def first_reason(result, *names):
    """The first reason, which has to name these."""
    first, *_ = (x for x in result.quality.reasons if not x.startswith("the description is right"))
    assert not [name for name in names if name not in first], first
    return first


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_the_recordings_comes_first(fault):
    change, verdict, *names = FAULTS[fault]
    result = judged(*recordings(change))
    quality = result.quality
    first_reason(result, *names)
    assert quality.verdict == verdict and (quality.causes or verdict == GOOD)
    assert change is not pulled or ("derived instead" in quality.reasons[-1] and not quality.faulty)


TURNED = [  # direction of gravity, how the reason writes it, the mount to set
    ((0, 0, 1), "+z of the base", [math.pi, 0, 0]),
    ((0.0, math.sin(0.1), -math.cos(0.1)), "(0.00, 0.10, -1.00) of the base", [-0.1, 0, 0]),
    ((math.sqrt(0.5), 0.0, -math.sqrt(0.5)), "(0.71, 0.00, -0.71) of the base", [0, math.pi / 4, 0]),
]


@pytest.mark.parametrize(("direction", "words", "mount"), TURNED)
def test_gravity_along_another_direction_is_reported_with_the_mount_to_set(direction, words, mount):
    result = judged(*recordings(truth=replace(ARM, gravity=SIZE * np.array(direction))))
    first = first_reason(result, words, "along −z")
    assert result.quality.verdict == BAD and "reverse" not in first
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
    assert quality.verdict == BAD and "recording.reverse=[shoulder, elbow]" in quality.reasons[0]


MOTION = "position", "velocity"


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


def of_differential(made):
    """Two motors drive the fifth and sixth joint by their mean and half their difference."""
    coupling = np.eye(7)
    coupling[4:6, 4:6] = [[1, 1], [1, -1]]  # of the motors' positions, and of the joints' torques
    motion = {name: getattr(made, name) @ coupling.T for name in MOTION}
    return replace(made, torque=made.torque @ np.linalg.inv(coupling), **motion)


@of_torques
def of_ratio(made):
    """The fifth motor carries half of the sixth joint's torque, too."""
    return made.torque + 0.5 * made.torque[:, [5]] * np.eye(7)[4]


SPAN = ARM.position_upper - ARM.position_lower
MIDDLE = ARM.position_lower + SPAN / 2
RATIOS = np.array([2.0, 2.5, 2.0, 1.5, 1.5, 1.0, 1.0])  # of gears, times π/180
MISREAD = {  # how recordings differ, and what the reason names
    "turns": (recorded_as(0.5 / np.pi), "in turns"),
    "shares": (recorded_as(2 / SPAN, MIDDLE), "shares of it (−1 to 1)"),
    "motors": (recorded_as(RATIOS), "those of the motors"),
    "from the horizontal": (counted, "joint_4", "joint_3", "'recording.coupling="),
    "a differential": (of_differential, "joint_5 and joint_6", "differential"),
    "a ratio": (of_ratio, "joint_5", "0.5 times that of joint_6"),
}


def followed(reason, made):
    """A recording read with the settings that a reason advises."""
    if "position={" in reason:
        said = yaml.safe_load(reason.partition("position=")[2].partition("'")[0].rpartition("}")[0] + "}")
        position = Counts(**said).in_si(made.position, [False] * 7)
        return replace(made, position=position, velocity=None)
    said = re.findall(r"'recording\.(\w+)=(\{.*?\})'", reason)
    settings = of_file(**{name: yaml.safe_load(value) for name, value in said})
    motion, torque = settings.motion_matrix(ARM.joint_names), settings.torque_matrix(ARM.joint_names)
    states = {name: getattr(made, name) @ motion.T for name in MOTION}
    return replace(made, torque=made.torque @ torque.T, **states)


@pytest.mark.parametrize("case", MISREAD)
def test_the_advised_settings_make_the_model_good(case):
    change, *names = MISREAD[case]
    reason = first_reason(judged(*recordings(change)), *names)
    assert judged(*recordings(lambda made: followed(reason, change(made)))).quality.verdict == GOOD


def test_a_description_that_is_right_is_said_to_be():
    quality = judged(*recordings()).quality
    assert quality.verdict == GOOD and quality.reasons[0].startswith("the description is right")


DIFFERENT_LINKS = [  # link, its further mass [kg] and moment [kg·m], and what the reason names
    (6, 0.5, 0.02, "load of 0.", "on link_7"),
    (3, 2.0, 0.3, "link_4 (2", "kg more)"),
    (6, -0.15, -0.02, "link_7", "alone differs"),
]


@pytest.mark.parametrize("case", DIFFERENT_LINKS)
def test_what_alone_differs_from_the_description_is_named_first(case):
    link, mass, moment, *names = case
    links = ARM.inertial_parameters.copy()
    links[link, [0, 3]] += mass, moment
    result = judged(*recordings(truth=replace(ARM, inertial_parameters=links)))
    assert result.quality.verdict == GOOD and first_reason(result, *names)


def test_a_description_and_recording_in_degrees_are_asked_for():
    """Limits in degrees do not show it, so that nothing but the torques does."""
    wide = replace(ARM, position_lower=60 * ARM.position_lower, position_upper=60 * ARM.position_upper)
    warnings = " ".join(recorded(2, recorded_as(180 / np.pi), wide, ARM).warnings)
    assert "recording.units.angle=deg" in warnings and "right arm" not in warnings


ORDER = "'recording.joints=[2, 4, 5, 1, 7, 3, 6]' 'recording.pos"
WARNED = {
    "another joint order": (in_order([3, 0, 5, 1, 2, 6, 4], *MOTION, "torque"), BAD, ORDER),
    "swapped motions": (in_order([0, 3, 2, 1, 4, 5, 6], *MOTION), BAD, "joint_2 and joint_4"),
    "an axis": (turned_round, BAD, "axis of joint_4"),
    "half the pace": (slower, USABLE, "times as fast", "recording.rate"),
}


@pytest.mark.parametrize("case", WARNED)
def test_columns_and_time_that_do_not_fit_are_reported(case):
    change, verdict, *names = WARNED[case]
    recording = recorded(2, change)
    result = judged(recording)
    assert first_reason(result, *names) in recording.warnings and result.quality.verdict == verdict


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


@pytest.mark.parametrize("start", [0.0, 1.7e9], ids=["from zero", "since 1970"])
def test_a_load_held_for_a_while_is_named_with_its_time(start):
    result = judged(recorded(2, lambda made: replace(picking(made), time=made.time + start)), recorded(3))
    said = re.match(r"from (\S+) s to (\S+) s of changed .* \+(\S+) ± .* kg on link_7", first_reason(result))
    begin, end, mass = map(float, said.groups())
    np.testing.assert_allclose([begin - start, end - start, mass], [4.0, 9.0, 2.0], rtol=0.2)
    assert result.quality.verdict != GOOD


def test_what_the_filter_leaves_of_exact_torques_is_no_contact(planar):
    """It is largest where a recording begins and ends."""
    q, v, a = multisine(2, 2000, seed=1)
    torque = RigidBody(planar).torque(q, v, a) + 0.8 * v + 0.5 * np.tanh(v / 0.01)
    exact = Recording("exact", planar.joint_names, np.arange(2000) / 100, q, v, a, torque=torque)
    quality = identified(planar, [check_recording(exact, planar, of_file())], strength=1.0).quality
    assert quality.verdict == USABLE and "did the arm touch" not in " ".join(quality.reasons)


def test_joints_before_one_without_a_torque_are_identified_alone():
    first = load_robot("kuka_lwr4", Setup(tip="link_6"))

    def without(made):
        signals = {name: x[:, :6] for name, x in made.signals().items()}
        return replace(made, joint_names=first.joint_names, **signals)

    training, validation = recordings(without, first, ARM)
    assert identified(first, [training], [validation], strength=1.0).quality.verdict == GOOD


DIFFERENT = [  # change of the first recording, of the second, and what the first reason names
    (None, carrying, "changed", "+2 ±", "+experiment=payload"),
    (None, colder, "in changed", "friction of joint_1, joint_2"),
    (saturated, None, "changed", "joint_2", "saturated"),
    (saturated, colder, "friction of "),
]


@pytest.mark.parametrize("case", DIFFERENT)
def test_what_differs_between_recordings_is_named(case):
    first, second, *names = case
    result = judged(recorded(2, first), recorded(3, second))
    assert result.quality.verdict != GOOD and first_reason(result, *names)


@pytest.mark.parametrize(("size", "shows"), [(1.0, True), (0.02, False)])
def test_the_sign_of_a_joint_that_hardly_moves_is_unknown(size, shows):
    def moved_less(made):
        q, v = (x * [1, 1, 1, 1, 1, size, 1] for x in (made.position, made.velocity))
        torque = RigidBody(ARM).torque(q, v, np.gradient(v, 0.01, axis=0))
        return replace(made, position=q, velocity=v, torque=torque * [1, 1, 1, 1, 1, -1, 1])

    warnings = recorded(0, moved_less).warnings
    assert any("reverse=[joint_6]" in text for text in warnings) == shows
    assert any("does not show" in text and "joint_6" in text for text in warnings) != shows


@pytest.mark.parametrize(("found", "levels"), [(19.9, []), (20.1, [USABLE]), (0.201, []), (0.199, [USABLE])])
def test_a_mass_ten_times_off_is_reported(found, levels):
    assert [finding.level for finding in implausible_mass(found, 2.0)] == levels


def test_implausible_links_are_reported():
    heavy, far = ARM.inertial_parameters.copy(), ARM.inertial_parameters.copy()
    heavy[3] *= 12
    far[2, 1] = 2.0 * far[2, 0]
    found = [implausible_links(ARM, links) for links in (ARM.inertial_parameters, heavy, far)]
    levels = [[(finding.level, finding.joint) for finding in each] for each in found]
    assert levels == [[], [(USABLE, 3)], [(BAD, 2)]]
