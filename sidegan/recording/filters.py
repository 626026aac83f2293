"""Zero-phase low-pass and derivatives of blocks of a grid, as if each run were one block."""

from collections.abc import Iterable, Iterator

import numpy as np
from scipy.signal import butter, sosfiltfilt

from sidegan.errors import RecordingError
from sidegan.recording.grid import Block
from sidegan.recording.tables import Numbers

_HIGHEST = 0.8  # of half the sampling rate: above it there is nothing to filter


def low_pass(x: Numbers, cutoff: float, step: float, order: int) -> Numbers:
    """Signals (S, C) without what is faster than ``cutoff`` [Hz], not shifted in time.

    A Butterworth filter forwards and backwards; a cut-off near half the sampling rate filters nothing.

    Raises:
        RecordingError: when there are too few samples.
    """
    if cutoff >= _HIGHEST / (2 * step):
        return x
    sections = butter(order, cutoff, fs=1 / step, output="sos")
    pad = min(len(x) - 1, round(3 / (cutoff * step)) + 3 * order)
    if pad < 1:
        raise RecordingError(f"{len(x)} samples are too few to filter")
    return np.ascontiguousarray(sosfiltfilt(sections, x, axis=0, padlen=pad))


def derivative(x: Numbers, step: float) -> Numbers:
    """Time derivative of signals (S, C), by five-point differences.

    Outside of the samples the signal goes on point-symmetrically.
    """
    if len(x) < 3:
        return np.gradient(x, step, axis=0) if len(x) > 1 else np.zeros_like(x)
    p = np.pad(x, ((2, 2), (0, 0)), "reflect", reflect_type="odd")
    return (p[:-4] - 8 * p[1:-3] + 8 * p[3:-1] - p[4:]) / (12 * step)


def windows(blocks: Iterable[Block], halo: int, least: int) -> Iterator[tuple[Block, slice, bool]]:
    """Blocks with up to ``halo`` points of the same run on both sides, and the part that is to be kept.

    Args:
        blocks: consecutive, of any number of runs.
        halo: points on each side that a window shares with its neighbours.
        least: points of a window at least, where the run has so many.

    Yields:
        Window, what of it belongs to no other window, and whether it is the last of its run.
    """
    held: Block | None = None
    done = 0  # points of the held window that an earlier one gave
    for block in blocks:
        if held is not None and block.run != held.run:
            yield held, slice(done, None), True
            held, done = None, 0
        held = block if held is None else _appended(held, block)
        ready = len(held.time) - halo
        if ready - done >= least:
            yield held, slice(done, ready), False
            keep = max(0, ready - halo)
            held = Block(held.run, held.first + keep, held.time[keep:], held.signals[keep:])
            done = ready - keep
    if held is not None:
        yield held, slice(done, None), True


def _appended(a: Block, b: Block) -> Block:
    return Block(a.run, a.first, np.concatenate([a.time, b.time]), np.concatenate([a.signals, b.signals]))
