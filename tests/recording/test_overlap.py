"""The same samples are found in two recordings wherever they are; other motions are not taken for them."""

from dataclasses import replace

import numpy as np
import pytest

from sidegan.errors import RecordingError
from sidegan.recording.overlap import digests_of, refuse_shared
from tests.recording.conftest import moved, part_of


def made(planar, seed):
    still = np.zeros(2)
    return moved(planar, np.arange(3000) / 200, still, still, np.random.default_rng(seed))


@pytest.fixture(scope="module")
def one(planar):
    return made(planar, 0)


def refused(first, second):
    try:
        refuse_shared([("a", digests_of(first)), ("b", digests_of(second))])
    except RecordingError as error:
        return str(error)
    return ""


def test_a_stretch_with_another_clock_is_found_and_reported(one, planar):
    assert refused(one, one).startswith("b holds samples of a, from 0")
    middle = part_of(one, slice(1000, 1200))
    other = part_of(made(planar, 1), slice(0, 1500))
    columns = {name: np.concatenate([x, middle.signals()[name]]) for name, x in other.signals().items()}
    both = replace(other, time=np.concatenate([other.time, 7 + middle.time]), **columns)
    words = refused(one, both)
    assert words.startswith("b holds samples of a, from 12 s to 12.995 s")


def test_a_file_with_fewer_signals_or_in_single_precision_is_found(one):
    single = {name: x.astype(np.float32).astype(float) for name, x in one.signals().items()}
    assert refused(one, replace(one, **{**single, "velocity": None, "acceleration": None}))


def test_torques_of_another_motion_are_found(one, planar):
    other = made(planar, 1)
    words = refused(one, replace(other, torque=np.concatenate([other.torque[:1000], one.torque[1000:]])))
    assert words.startswith("b has the same torques as a, from 5") and "to 14.9" in words
    coarse = [replace(x, torque=(x.torque / 2).round()) for x in (one, other)]
    assert not refused(*coarse)


def test_another_motion_other_noise_or_rest_in_one_place_is_not_the_same(one, planar):
    noise = np.random.default_rng(3).standard_normal(one.torque.shape)
    rest = {name: np.broadcast_to(x[:1], (500, x.shape[1])) for name, x in one.signals().items()}
    resting = replace(one, time=np.arange(500.0), **rest)
    for other in (made(planar, 1), replace(one, torque=one.torque + 1e-3 * noise), resting):
        assert not refused(one, other)
    assert not refused(resting, resting)
