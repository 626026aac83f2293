"""Samples shared by two recordings are found wherever they are; other motions are not mistaken for them."""

from dataclasses import replace

import numpy as np
import pytest
import scipy

from sidegan.errors import RecordingError
from sidegan.recording.grid import low_pass
from sidegan.recording.overlap import digests_of, refuse_shared, same_run
from tests.recording.conftest import moved
from tests.refusals import refused


def made(planar, seed):
    return moved(planar, np.arange(3000) / 200, 0.0, 0.0, np.random.default_rng(seed))


@pytest.fixture(scope="module")
def original(planar):
    return made(planar, 0)


def compare(first, second):
    """Refuses two recordings with shared samples."""
    refuse_shared([("a", digests_of(first)), ("b", digests_of(second))])


def test_shared_samples_are_found_despite_another_clock(original, planar):
    with refused(RecordingError, "b", "a"):
        compare(original, original)
    middle = original.take(slice(1000, 1200))
    other = made(planar, 1).take(slice(0, 1500))
    columns = {name: np.concatenate([x, middle.signals()[name]]) for name, x in other.signals().items()}
    both = replace(other, time=np.concatenate([other.time, 7 + middle.time]), **columns)
    with refused(RecordingError, "samples", "12 s", "12.995 s"):
        compare(original, both)


def test_shared_samples_are_found_with_fewer_signals_in_single_precision(original):
    single = {name: x.astype(np.float32).astype(float) for name, x in original.signals().items()}
    with refused(RecordingError, "samples"):
        compare(original, replace(original, **{**single, "velocity": None, "acceleration": None}))


def test_shared_torques_are_found_under_another_motion(original, planar):
    other = made(planar, 1)
    half = np.concatenate([other.torque[:1000], original.torque[1000:]])
    with refused(RecordingError, "torques", " 5"):
        compare(original, replace(other, torque=half))
    compare(*(replace(x, torque=(x.torque / 2).round()) for x in (original, other)))


def test_different_motion_noise_or_rest_is_not_reported_as_shared(original, planar):
    noise = np.random.default_rng(3).standard_normal(original.torque.shape)
    rest = {name: np.broadcast_to(x[:1], (500, x.shape[1])) for name, x in original.signals().items()}
    resting = replace(original, time=np.arange(500.0), **rest)
    for other in (made(planar, 1), replace(original, torque=original.torque + 1e-3 * noise), resting):
        compare(original, other)
    compare(resting, resting)


def again(recording, change=lambda x: x, rows=slice(None), decimals=4):
    """Some rows of changed torques, rounded, with a clock from zero."""
    part = replace(recording, torque=change(recording.torque).round(decimals)).take(rows)
    return replace(part, time=part.time - part.time[0])


def resampled(recording):
    time = np.arange(0.0123, 14.9, 1 / 130)
    signals = {
        name: scipy.interpolate.interp1d(recording.time, x, axis=0)(time)
        for name, x in recording.signals().items()
    }
    return replace(recording, time=time, **signals)


def smooth(x):
    return low_pass(x, 8.0, 1 / 200)


EXPORTS = {
    "rounded": again,
    "every second row": lambda x: again(x, rows=slice(1, None, 2)),
    "low-passed": lambda x: again(x, smooth, slice(1, None, 2)),
    "low-passed, cut": lambda x: again(x, smooth, slice(600, 2400)),
    "another filter": lambda x: again(x, lambda y: scipy.ndimage.uniform_filter1d(y, 7, axis=0)),
    "in another unit": lambda x: again(x, lambda y: 100 * smooth(y)),
    "resampled": resampled,
}


@pytest.mark.parametrize("export", EXPORTS.values(), ids=EXPORTS)
def test_a_run_is_known_again_however_it_was_exported(original, export):
    copy = digests_of(export(original))
    assert same_run(digests_of(original), copy) and same_run(copy, digests_of(original))


@pytest.mark.parametrize("noise", [0.02, 1e-3])
@pytest.mark.parametrize("export", EXPORTS.values(), ids=EXPORTS)
def test_a_repetition_is_another_run_however_it_was_exported(planar, export, noise):
    time = np.arange(3000) / 200
    friction = [2.0, 0.8], [1.0, 0.4]
    exact = moved(planar, time, *friction, np.random.default_rng(0), noise=0.0)
    white = noise * exact.torque.std(0) * np.random.default_rng(5).standard_normal((2, *exact.torque.shape))
    first, second = (replace(exact, torque=exact.torque + x) for x in white)
    assert not same_run(digests_of(first), digests_of(export(second)))
    assert not same_run(digests_of(again(first, smooth)), digests_of(export(second)))


def test_another_motion_or_pace_is_another_run(original, planar):
    slower = replace(original, time=1.25 * original.time)
    for other in (made(planar, 1), slower):
        assert not same_run(digests_of(original), digests_of(other))


def test_recordings_too_short_for_filters_are_compared_by_their_samples(original):
    short = original.take(slice(190))
    assert not same_run(digests_of(short), digests_of(again(short)))
    with refused(RecordingError, "samples"):
        compare(short, short)
