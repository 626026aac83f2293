"""The growth curves: what is varied in each, at which points, and what is shown of it."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Curve:
    """One curve.

    Attributes:
        title: of its section.
        about: what is varied and what was measured, for the page.
        varied: what ``at`` counts, with its unit.
        unit: of what is shown.
        shown: column of the table → what it is called.
        points: values of ``at``.
        small: two of them that take a moment, to see whether everything runs.
        once: points that are measured once, being long enough to be medians of themselves.
        share: columns are per unit of what is varied, so that the total grows by one power more.
        memory: the peak of memory is shown beside.
    """

    title: str
    about: str
    varied: str
    unit: str
    shown: Mapping[str, str]
    points: tuple[int, ...]
    small: tuple[int, ...]
    once: tuple[int, ...] = ()
    share: bool = False
    memory: bool = False


_GRAM, _GRADIENT = "YᵀY", "gradient of cond(YᵀY) with penalties"
_PER_TRAJECTORY = {"gram_ms": _GRAM, "gradient_ms": _GRADIENT, "validity_ms": "validity, proven"}

CURVES = {
    "joints": Curve(
        "Joints",
        "Chains of 2 to 14 joints, made of the LWR's own joints and links over and over; 6 harmonics, 60 "
        "samples. Everything per joint grows with the chain, the base parameters and the pairs of links "
        "too.",
        "joints",
        "CPU ms per trajectory",
        _PER_TRAJECTORY,
        tuple(range(2, 15)),
        (2, 9),
    ),
    "samples": Curve(
        "Samples",
        "Time points of a trajectory of the LWR. The check of validity is not among these: it has its own.",
        "samples per trajectory",
        "CPU ms per trajectory",
        {"gram_ms": _GRAM, "gradient_ms": _GRADIENT},
        (20, 40, 80, 160, 320, 640, 1280),
        (20, 40),
    ),
    "harmonics": Curve(
        "Harmonics",
        "Harmonics per joint of the LWR's trajectories of 16 s, at 60 samples, or four per harmonic where "
        "that is more (from 24 on): harmonics alone cost next to nothing, the samples that they need do. "
        "The check of validity needs finer steps the faster the motion changes.",
        "harmonics per joint",
        "CPU ms per trajectory",
        _PER_TRAJECTORY,
        (1, 2, 3, 6, 12, 24, 48),
        (1, 6),
    ),
    "seeds": Curve(
        "Seeds",
        "Seeds of the LWR that are optimised side by side in one task, 200 evaluations each, failures and "
        "the proof of validity counted. A batch spreads what each call costs.",
        "seeds in a batch",
        "CPU s per valid seed",
        {"cpu_s_per_seed": "seeds, everything counted"},
        (1, 2, 5, 10, 20, 50, 100, 200),
        (1, 3),
        share=True,
    ),
    "library": Curve(
        "Library",
        "From a thousand to a million trajectories: drawn from an untrained generator of the default size, "
        "checked, measured (spectrum and diagonal), written to one Parquet file part by part, 35 selected "
        "from that file, and those read from it. Parts of 2000 are all that is in memory; of the rest, the "
        "selection keeps two numbers per trajectory.",
        "trajectories in the library",
        "CPU µs per trajectory",
        {
            "generation_us": "generation",
            "filter_us": "filter",
            "excitation_us": "excitation",
            "write_us": "Parquet write",
            "selection_us": "selection of 35",
            "read_us": "reading those",
        },
        (1_000, 10_000, 100_000, 1_000_000),
        (100, 1_000),
        once=(100_000, 1_000_000),
        share=True,
        memory=True,
    ),
    "rls": Curve(
        "Data of the identification",
        "Recursive least squares over a stream of trajectories of 1600 samples of seven joints, regressors "
        "included. What is kept are sums of a fixed size.",
        "trajectories of 1600 samples",
        "CPU µs per sample of seven joints",
        {"cpu_us_per_sample": "regressor and sums"},
        (10, 30, 100, 300, 1000, 6000),
        (2, 5),
        once=(1000, 6000),
        share=True,
        memory=True,
    ),
    "long": Curve(
        "One long trajectory, or many short ones",
        "One trajectory of n · 16 s with as many harmonics per second as short ones have (12 coefficients "
        "per joint and period, 60 samples), beside n short ones. An optimisation is 200 evaluations of "
        "ours, with the gradient, whose cost was measured; the short ones go as one batch. A sweep is what "
        "an optimiser without gradients must evaluate before it may refine its step (the paper's compass "
        "search: each coefficient up and down). One evaluation, the condition number and all constraints at "
        "each sample, was measured and multiplied with their number.",
        "length in periods of 16 s",
        "CPU s",
        {
            "sweep_long_s": "sweep, one long",
            "sweep_short_s": "sweep, many short",
            "one_long_s": "optimisation, one long",
            "many_short_s": "optimisation, many short",
            "evaluation_s": "evaluation, one long",
        },
        (1, 2, 4, 8, 16, 35),
        (1, 2),
        once=(35,),
    ),
}
