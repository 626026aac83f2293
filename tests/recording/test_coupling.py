"""Recordings in coupled coordinates, of motors say, are read as those of the joints."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sidegan.errors import ConfigError
from sidegan.recording.commanded import load_commanded
from sidegan.recording.load import load_recording
from sidegan.recording.segments import torque_of
from tests.recording.conftest import of_file, recorded
from tests.recording.files import write_parquet

JOINTS = "1", "2"
COUNTED = np.array([[1.0, 0.0], [-1.0, 1.0]])  # the second angle counts from the horizontal
FACTORS = st.sampled_from([-81.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 0.01])


def rows(matrix):
    return {joint: dict(zip(JOINTS, row)) for joint, row in zip(JOINTS, np.asarray(matrix).tolist())}


def seen(made, matrix, torque=None):
    """The recording as motors see it of which the matrix makes the joints; torques by virtual work."""
    motion = {name: getattr(made, name) @ np.linalg.inv(matrix).T for name in ("position", "velocity")}
    effort = matrix if torque is None else np.linalg.inv(torque).T
    return replace(made, joint_names=JOINTS, torque=made.torque @ effort, **motion)


@given(st.lists(FACTORS, min_size=4, max_size=4))
def test_a_recording_in_coupled_coordinates_reads_back(made, tmp_path_factory, factors):
    matrix = np.array(factors).reshape(2, 2)
    assume(np.linalg.matrix_rank(matrix) == 2)
    path = write_parquet(coupled := seen(made, matrix), tmp_path_factory.mktemp("coupled"))
    settings = of_file(coupling=rows(matrix))
    found = load_recording(path, settings, JOINTS)
    torque = torque_of(found, None, settings)
    close = {"rtol": 0, "atol": 1e-9 * np.abs(matrix).max() / abs(np.linalg.det(matrix))}
    for x, y in ((found.position, made.position), (found.velocity, made.velocity), (torque, made.torque)):
        np.testing.assert_allclose(x, y, **close)
    power = (coupled.torque * coupled.velocity).sum(1)
    np.testing.assert_allclose((torque * found.velocity).sum(1), power, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("torque", [{}, rows([[1.0, -1.0], [0.0, 1.0]])])
def test_motion_and_torques_may_be_coupled_apart(made, tmp_path, torque):
    matrix = np.array([[row[k] for k in JOINTS] for row in torque.values()]) if torque else np.eye(2)
    for motion in (COUNTED, np.eye(2)):
        settings = of_file(coupling=rows(motion), torque_coupling=torque)
        found = load_recording(write_parquet(seen(made, motion, matrix), tmp_path), settings, JOINTS)
        np.testing.assert_allclose(found.position, made.position)
        np.testing.assert_allclose(torque_of(found, None, settings), made.torque)


def test_gains_and_signs_are_those_of_the_motors(planar, clock, recording):
    first, second = planar.joint_names
    currents = recorded(planar, clock, ("position", "velocity", "current"))
    of_motors = replace(currents, current=currents.current @ np.linalg.inv(COUNTED).T * [-1.0, 0.5])
    settings = of_file(torque_coupling={second: {first: -1, second: 1}}, reverse=[first])
    np.testing.assert_allclose(torque_of(of_motors, (2.0, 4.0), settings), recording.torque)


def test_what_was_sent_is_in_the_same_coordinates(tmp_path):
    (tmp_path / "1.csv").write_text("time,q_1,q_2\n0,0.1,0.2\n1,0.3,0.7\n")
    (found,) = load_commanded(tmp_path / "1.csv", JOINTS, COUNTED)
    np.testing.assert_allclose(found.position, [[0.1, 0.1], [0.3, 0.4]])


REFUSED = [
    ({"coupling": {"3": {"1": 1.0}}}, "recording.coupling names 3; the arm has joints 1, 2"),
    ({"coupling": {"1": {"elbow": 1.0}}}, "recording.coupling names elbow; the arm"),
    ({"torque_coupling": {"1": {"3": 1.0}}}, "recording.torque_coupling names 3; the arm"),
    ({"coupling": {"1": {"2": 1.0}}}, "recording.coupling has no inverse"),
    ({"coupling": {"1": {}}}, "recording.coupling has no inverse"),
    ({"torque_coupling": rows([[1e-9, 2e-9], [1.0, 2.0]])}, "recording.torque_coupling has no inverse"),
    ({"coupling": [[1.0, 0.0], [0.0, 1.0]]}, "coupling is .*, expected a group of settings"),
    ({"coupling": {"1": 2.0}}, "coupling.1 is 2.0, expected a group of settings"),
    ({"coupling": {"1": {"1": float("nan")}}}, r"coupling\.1\.1 is nan, expected a number"),
    ({"coupling": {"1": {"1": float("inf")}}}, r"coupling\.1\.1 is inf, expected a number"),
]


@pytest.mark.parametrize(("changes", "words"), REFUSED)
def test_impossible_couplings_are_refused(made, changes, words):
    with pytest.raises(ConfigError, match=words):
        torque_of(replace(made, joint_names=JOINTS), None, of_file(**changes))
