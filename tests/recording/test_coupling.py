"""Recordings in coupled coordinates, of motors say, are read as those of the joints."""

import ast
from contextvars import Context
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
from tests.refusals import refused

JOINTS = "1", "2"
COUNTED = np.array([[1.0, 0.0], [-1.0, 1.0]])  # the second angle counts from the horizontal
FACTORS = st.sampled_from([-81.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 0.01])


def rows(matrix):
    return {joint: dict(zip(JOINTS, row)) for joint, row in zip(JOINTS, np.asarray(matrix).tolist())}


def couple(made, motion, torque):
    """The recording in coordinates of which these matrices make those of the joints."""
    back = np.linalg.inv(motion).T
    position, velocity = made.position @ back, made.velocity @ back
    effort = made.torque @ np.linalg.inv(torque).T
    return replace(made, joint_names=JOINTS, position=position, velocity=velocity, torque=effort)


@given(st.lists(FACTORS, min_size=4, max_size=4), st.sampled_from(["work", "none", "belt"]))
def test_a_recording_in_coupled_coordinates_reads_back(made, tmp_path_factory, factors, torques):
    """Torques follow the motion by virtual work, or are coupled apart, or not at all."""
    motion = np.array(factors).reshape(2, 2)
    assume(np.linalg.matrix_rank(motion) == 2)
    torque = {"work": np.linalg.inv(motion).T, "none": np.eye(2), "belt": np.array([[1.0, -1.0], [0.0, 1.0]])}
    given = {"work": None, "none": {}, "belt": rows(torque["belt"])}
    coupled = couple(made, motion, torque[torques])
    path = write_parquet(coupled, tmp_path_factory.mktemp("coupled"))
    settings = of_file(coupling=rows(motion), torque_coupling=given[torques])
    found = load_recording(path, settings, JOINTS)
    torque = torque_of(found, None, settings)
    close = {"rtol": 0, "atol": 1e-9 * np.abs(motion).max() / abs(np.linalg.det(motion))}
    for x, y in ((found.position, made.position), (found.velocity, made.velocity), (torque, made.torque)):
        np.testing.assert_allclose(x, y, **close)
    if torques == "work":
        power = (coupled.torque * coupled.velocity).sum(1)
        np.testing.assert_allclose((torque * found.velocity).sum(1), power, rtol=1e-6, atol=1e-6)


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


def test_a_suggested_coupling_is_one_argument_in_python():
    words = Context().run(of_file().coupled, JOINTS, COUNTED, np.eye(2))
    argument, _, value = words.partition("=")
    found = of_file(**ast.literal_eval(value))
    assert argument == "recording"
    np.testing.assert_array_equal(found.motion_matrix(JOINTS), COUNTED)
    np.testing.assert_array_equal(found.torque_matrix(JOINTS), np.eye(2))


IMPOSSIBLE = [
    ({"coupling": {"3": {"1": 1.0}}}, "recording.coupling 3 1, 2"),
    ({"coupling": {"1": {"elbow": 1.0}}}, "recording.coupling elbow"),
    ({"torque_coupling": {"1": {"3": 1.0}}}, "recording.torque_coupling 3"),
    ({"coupling": {"1": {"2": 1.0}}}, "recording.coupling inverse"),
    ({"coupling": {"1": {}}}, "recording.coupling inverse"),
    ({"torque_coupling": rows([[1e-9, 2e-9], [1.0, 2.0]])}, "recording.torque_coupling inverse"),
    ({"coupling": [[1.0, 0.0], [0.0, 1.0]]}, "coupling"),
    ({"coupling": {"1": 2.0}}, "coupling.1 2.0"),
    ({"coupling": {"1": {"1": float("nan")}}}, "coupling.1.1 nan"),
    ({"coupling": {"1": {"1": float("inf")}}}, "coupling.1.1 inf"),
]


@pytest.mark.parametrize(("changes", "about"), IMPOSSIBLE)
def test_impossible_couplings_are_refused(made, changes, about):
    with refused(ConfigError, *about.split()):
        torque_of(replace(made, joint_names=JOINTS), None, of_file(**changes))
