"""The same samples are found in two recordings wherever they are; other motions are not taken for them."""

import dataclasses

import numpy as np
import pytest
import torch

from sidegan.errors import RecordingError
from sidegan.recording.overlap import joined, refuse_shared, rows_of
from tests.recording.conftest import part_of
from tests.recording.made import moved

NONE = torch.zeros(2)


@pytest.fixture(scope="module")
def one(planar):
    return made(planar, 0)


def made(planar, seed):
    time = np.arange(3000) / 200
    return moved(planar, time, NONE, NONE, torch.Generator().manual_seed(seed))


def refused(first, second):
    try:
        refuse_shared([("a", rows_of(first)), ("b", rows_of(second))])
    except RecordingError as error:
        return str(error)
    return ""


def test_the_same_samples_are_found(one):
    assert refused(one, one).startswith("b holds samples of a, from 0")


def test_a_stretch_with_another_clock_is_found_and_told(one, planar):
    middle = part_of(one, slice(1000, 1200))
    other = part_of(made(planar, 1), slice(0, 1500))
    columns = {name: torch.cat([x, middle.signals()[name]]) for name, x in other.signals().items()}
    both = dataclasses.replace(other, time=torch.cat([other.time, 7 + middle.time]), **columns)
    words = refused(one, both)
    assert words.startswith("b holds samples of a, from 12.0") and "to 12.9" in words


def test_a_file_with_fewer_signals_or_in_single_precision_is_found(one):
    single = {name: x.float().double() for name, x in one.signals().items()}
    assert refused(one, dataclasses.replace(one, **{**single, "velocity": None, "acceleration": None}))


def test_pieces_are_joined(one):
    pieces = [rows_of(part_of(one, slice(k, k + 500))) for k in range(0, 3000, 500)]
    whole, again = rows_of(one), joined(pieces)
    assert set(whole.time.tolist()) <= set(again.time.tolist())
    with pytest.raises(RecordingError, match="count twice"):
        refuse_shared([("a", whole), ("b", again)])


def test_another_motion_or_other_noise_is_not_the_same(one, planar):
    assert not refused(one, made(planar, 1))
    noise = torch.randn(one.torque.shape, generator=torch.Generator().manual_seed(3), dtype=torch.float64)
    assert not refused(one, dataclasses.replace(one, torque=one.torque + 1e-3 * noise))


def test_arms_at_rest_in_one_place_are_not_the_same(one):
    still = part_of(one, slice(0, 1))
    rest = {name: x.expand(500, -1) for name, x in still.signals().items()}
    resting = dataclasses.replace(one, time=torch.arange(500.0).double(), **rest)
    assert not refused(one, resting) and not refused(resting, resting)
