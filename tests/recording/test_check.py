import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from sidegan.errors import RecordingError
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.plant import IDEAL, Plant
from sidegan.recording.agreement import to_reverse
from sidegan.recording.checked import hold_out
from sidegan.recording.clock import stamp_text
from sidegan.recording.delay import Delay, delay_of, pool_delays
from sidegan.recording.gravity import fit_gravity
from sidegan.recording.misfit import misfit
from sidegan.recording.read import read_and_check
from sidegan.recording.recording import Recording
from sidegan.robot import Limits, Setup, load_robot
from tests.chains import random_states
from tests.recording.conftest import PLANAR, check, moved, of_file, recorded, states
from tests.recording.files import frame
from tests.refusals import refused


def test_a_good_recording_has_no_warnings(recording):
    checked = check(recording)
    assert not checked.warnings
    assert (checked.agreement.sign > 0.9).all()
    assert checked.derived == ["acceleration"]
    assert 15 < checked.moving < 20
    json.dumps(checked.as_json(), allow_nan=False)


def test_raised_effort_limits_accept_torques_in_a_suspicious_unit(recording):
    """With the limits that the refusal names."""
    wrong = replace(recording, torque=1e3 * recording.torque)
    with refused(RecordingError, "recording.units.torque=mNm") as error:
        check(wrong)
    limits = re.findall(r"(\w+): (\d+)", str(error.value).partition("robot.limits.effort={")[2])
    strong = load_robot("planar2", Setup(limits=Limits(effort={name: float(x) for name, x in limits})))
    assert check(wrong, strong).kept


WRONG = [  # a rate, what is recorded in its place from a velocity at 100 Hz, and what the remark says
    ("velocity", lambda v: 0.5 * v, ["0.50 (shoulder), 0.50 (elbow)"]),
    ("velocity", lambda v: v * [1, -1], ["-1.00 (elbow)"]),
    (
        "velocity",
        lambda v: v[:, ::-1],
        ["(shoulder: it is that of elbow", "(elbow: it is that of shoulder"],
    ),
    ("velocity", lambda v: v * [1.0, 1.2], ["1.20 (elbow)"]),
    ("acceleration", lambda v: np.gradient(v, 0.02, axis=0), ["(shoulder)", "(elbow)"]),
]


@pytest.mark.parametrize(("rate", "change", "words"), WRONG)
def test_an_inconsistent_rate_is_discarded(recording, rate, change, words):
    signals = change(recording.velocity), None
    checked, alone = (check(replace(recording, **{rate: x})) for x in signals)
    assert [*checked.remarks] == [rate] and all(word in checked.remarks[rate] for word in words)
    assert rate in checked.derived and checked.derived == alone.derived
    for found, derived in zip(checked.segments, alone.segments):
        np.testing.assert_array_equal(getattr(found, rate), getattr(derived, rate))


@pytest.mark.parametrize(("lag", "when"), [(0.04, "40 ms later"), (-0.02, "20 ms earlier"), (0.004, "")])
def test_a_velocity_at_another_time_is_discarded(recording, lag, when):
    late = np.stack([np.interp(recording.time - lag, recording.time, x) for x in recording.velocity.T], 1)
    remarks = check(replace(recording, velocity=late)).remarks
    if when:
        assert f"{when} than the derivative of the position" in remarks["velocity"]
    else:
        assert remarks == {}


def test_a_noisy_velocity_signal_is_kept(recording):
    noise = np.random.default_rng(0).standard_normal((2, *recording.position.shape))
    noisy = replace(recording, position=recording.position + 0.02 * noise[0])
    loud = replace(recording, velocity=recording.velocity + 0.5 * noise[1])
    for changed in (noisy, loud):
        assert check(changed).remarks == {}


def test_a_frozen_torque_sensor_is_reported(recording):
    stuck = recording.torque.copy()
    stuck[600:1900, 1] = stuck[600, 1]
    frozen = replace(recording, torque=stuck)
    held = recording.position.copy()
    held[1900:] -= held[1900] - held[600]
    held[600:1900] = held[600]
    still = replace(recording, torque=stuck, position=held, velocity=None)
    rows = [k for k in range(2000) if not 600 <= k < 1900]
    warnings, *others = (
        [w for w in check(changed).warnings if "is frozen" in w]
        for changed in (frozen, still, frozen.take(rows))
    )
    span = " to ".join(stamp_text(recording.time[k]) for k in (600, 1899))
    assert f"the torque of elbow is frozen from {span}, although the joint moves" in warnings[0]
    assert others == [[], []]


def test_the_end_of_a_recording_is_held_out_for_validation(planar, clock):
    time = clock + 3.0 * (np.arange(len(clock)) >= 900)
    checked = check(recorded(planar, time))
    first, last = hold_out(checked, 0.3)
    assert first.name == "made, first 70%" and last.name == "made, last 30%"
    assert abs(last.kept - 0.3 * checked.kept) <= 1
    assert len(first.segments) == 2 and len(last.segments) == 1
    apart = float(last.segments[0].time[0] - first.segments[-1].time[-1])
    assert apart > 1 / checked.grid.cutoff  # what the low-pass mixes is in neither
    for part in (first, last):
        end = part.segments[-1]
        same = np.concatenate([segment.torque[segment.time == end.time[-1]] for segment in checked.segments])
        np.testing.assert_allclose(end.torque[-1:], same)


def at_200_hz(seed, seconds=15, noise=0.02, begin=0.0):
    """A recording of a random motion with friction."""
    time = np.arange(seconds * 200) / 200 + begin
    return moved(PLANAR, time, 2.0, 1.0, np.random.default_rng(seed), noise=noise)


def late(delay, noise=0.02, seconds=30):
    """A recording with delayed torques."""
    return replace(at_200_hz(3, seconds), torque=at_200_hz(3, seconds, noise, -delay).torque)


@pytest.mark.parametrize("delay", [-0.2, -0.015, 0.0, 0.003, 0.03, 0.85])
def test_a_torque_delay_is_estimated_within_its_standard_deviation(planar, delay):
    wrong = replace(planar, inertial_parameters=1.7 * planar.inertial_parameters)
    checked = check(late(delay), wrong)
    found, warnings = checked.delay, "; ".join(checked.warnings)
    assert found.seconds == pytest.approx(delay, abs=4 * found.deviation)
    assert found.deviation < 1e-3 and found.believed == (delay != 0)
    assert (f"ms {'later' if delay > 0 else 'earlier'} than the motion: not" in warnings) == (
        abs(delay) > 0.02
    )


def test_friction_that_leads_the_velocity_is_not_mistaken_for_a_delay(planar):
    """MuJoCo's dry friction turns round before the velocity does, by more in some motions than in others."""
    plant = Plant(planar, replace(IDEAL, coulomb=[3.0], viscous=[0.5], rotor_inertia=[0.02]))
    family, believed = Trajectory(joints=2, harmonics=4, period=8.0), []
    for seed in range(5):
        c = 0.3 * np.random.default_rng(seed).standard_normal((2, 2, 4, 2))
        found = plant.execute(family.roll_out(c, family.times(plant.settings.rate)), seed=0, noise=0.02)
        made = Recording("made", planar.joint_names, found.time, *found[1:3], torque=found.torque)
        checked = check(made)
        near = delay_of(RigidBody(planar), checked.segments)
        assert abs(checked.delay.seconds) < min(1e-3, -near.seconds / 3)  # [s]
        believed.append(near.believed and near.seconds < -2e-3)
    assert any(believed)


@pytest.mark.parametrize("delay", [0.0, 0.01])
def test_friction_that_grows_with_the_load_is_not_mistaken_for_a_delay(planar, delay):
    made = late(0.0)
    q, dq = made.position, made.velocity
    load = np.abs(RigidBody(planar).torque(q, dq, np.gradient(dq, 0.005, axis=0)))
    torque = made.torque + 0.3 * load * np.tanh(dq / 0.03)
    later = np.roll(torque, round(200 * delay), axis=0)
    found = check(replace(made, torque=later)).delay
    assert found.seconds == pytest.approx(delay, abs=4 * found.deviation) and found.deviation < 1e-3


def test_torques_more_than_a_second_late_are_left_as_they_are():
    lost = check(late(1.3, seconds=15), delay=None)
    assert not lost.corrected and "more than 1 s later" in lost.late


def test_a_delay_that_noise_drowns_is_not_corrected():
    drowned = check(late(0.0, noise=30.0, seconds=10), delay=None)
    assert not drowned.corrected and not drowned.delay.believed


def test_a_delay_in_noise_has_its_deviation(planar):
    """Whose square is that of the error, in the mean, though the noise is in the torque's derivative too."""
    errors = []
    for seed in range(20):
        found = delay_of(RigidBody(planar), check(at_200_hz(seed, noise=0.3)).segments)
        errors.append(found.seconds / found.deviation)
    assert np.square(errors).mean() < 2


def test_torques_of_another_motion_seldom_have_a_delay():
    """Some motions are so alike that one looks like the other at another time."""
    undetermined, corrected = [], []
    for seed in range(12):
        checked = check(replace(at_200_hz(seed), torque=at_200_hz(100 + seed).torque), delay=None)
        corrected.append(checked.corrected)
        undetermined.append(math.isinf(checked.delay.deviation))
        json.dumps(checked.as_json(), allow_nan=False)
    assert sum(undetermined) >= 6 and sum(corrected) <= 3


def test_a_delay_is_left_measured_and_removed_or_removed_as_given(planar):
    left, better, given, wrong = (check(late(0.018), delay=delay) for delay in (0.0, None, 0.018, -0.071))
    assert "recording.delay=null" in left.statements[-1] and not left.corrected
    assert better.corrected and better.delay.believed
    assert given.delay == Delay(0.018, given=True) and not given.warnings
    assert "71 ms earlier" in wrong.statements[-1] and re.search("(88|89|90) ± .* later", wrong.warnings[-1])
    off = [abs(delay_of(RigidBody(planar), checked.segments).seconds) for checked in (left, better, given)]
    assert off[0] > 0.015 and max(off[1:]) < 1e-3  # half of what is worth taking off


def test_delays_of_several_recordings_are_pooled():
    """The mean by how much each tells; none where they differ, or there is nothing to pool."""
    common = pool_delays([Delay(0.004, 1e-4), Delay(0.006, 2e-4)])
    assert common.seconds == pytest.approx(0.0044) and common.deviation == pytest.approx(1e-4 * 0.8**0.5)
    for other in ([], [Delay(0.03, 1e-4)], [Delay(0.0, float("inf"))]):
        assert pool_delays([Delay(0.004, 1e-4), *other]) is None
    # at a second the search was stopped: the torques are not late by just that
    believed = [Delay(seconds, 1e-4).believed for seconds in (0.999, 4e-4, 1.0, -1.0, 2e-4)]
    assert believed == [True, True, False, False, False]


@given(seed=st.integers(0, 10**6))
@settings(max_examples=20)
def test_gravity_and_torque_scales_are_recovered_in_any_unit(arm, seed):
    random = np.random.default_rng(seed)
    q, v, a = random_states(arm, 400, seed)
    direction = random.standard_normal(3)
    gravity = np.linalg.norm(arm.gravity) * direction / np.linalg.norm(direction)
    assume(gravity @ arm.gravity < 90)  # a direction of its own, and not the described one
    torque = RigidBody(replace(arm, gravity=gravity)).torque(q, v, a)
    share = np.full_like(torque[0], 1e-3)
    share[1] = 0.3  # of a joint that is to count less
    noise = share * torque.std(0) * random.standard_normal(torque.shape)
    units = 10 ** (4 * random.random(arm.joints) - 2)
    found = fit_gravity(RigidBody(arm), q, v, a, units * (torque + noise))
    angle = math.acos(min(1.0, float(found.gravity @ gravity / np.linalg.norm(gravity) ** 2)))
    assert angle < 3e-4 and np.linalg.norm(found.gravity) == pytest.approx(np.linalg.norm(gravity))
    assert (np.abs(found.scale / units - 1) < share).all()


def test_torques_to_the_last_digit_as_described_have_the_described_gravity():
    motion, body = states(np.arange(60) / 50), RigidBody(PLANAR)
    np.testing.assert_array_equal(fit_gravity(body, *motion, body.torque(*motion)).gravity, PLANAR.gravity)


@pytest.mark.parametrize("tilt", [0.0, 4e-6], ids=["exact", "a right angle of four digits"])
def test_a_description_that_rotors_and_friction_make_up_for_says_nothing(planar, tilt):
    """That of a gantry: what is left of its torques is rounding, in which other positions could be found."""
    axes = np.array([[1, 0, 0], [tilt, 1, tilt]])
    gantry = RigidBody(replace(planar, prismatic=np.array([True, True]), axis=axes))
    motion, random = states(np.arange(500) / 50), np.random.default_rng(0)
    assert misfit(gantry, *motion, random.standard_normal(motion[0].shape)) == 0


def test_a_load_that_is_to_be_identified_is_no_contradiction(planar, recording, tmp_path):
    """Torques three times those described are questioned only in a run without the load."""
    heavy = replace(recording, torque=3 * recording.torque)
    frame(heavy).to_csv(tmp_path / "a.csv", index=False)
    path = str(tmp_path / "a.csv")
    plain, loaded = read_and_check([(path, "training"), (path, "loaded")], planar, of_file())
    assert any("times those expected" in warning for warning in plain.warnings)
    assert not any("times those expected" in warning for warning in loaded.warnings)


def test_a_delay_of_all_recordings_is_warned_about_once(planar, tmp_path):
    files = []
    for seed in (1, 2):
        made = moved(planar, np.arange(3000) / 100, 2.0, 1.0, np.random.default_rng(seed))
        late = replace(made, torque=np.roll(made.torque, 3, 0))
        frame(late).to_csv(tmp_path / f"{seed}.csv", index=False)
        files.append((str(tmp_path / f"{seed}.csv"), "training"))
    first, second = read_and_check(files, planar, of_file())
    assert first.late and first.late == second.late and first.warnings == second.warnings
    assert not any("later" in text for checked in (first, second) for text in checked.statements)


@pytest.mark.parametrize(("set_before", "advised"), [("elbow", "[shoulder, elbow]"), ("shoulder", "[]")])
def test_advice_to_reverse_a_torque_adds_to_what_is_set_or_takes_it_back(planar, set_before, advised):
    assert advised in to_reverse(planar, np.array([True, False]), [set_before])
