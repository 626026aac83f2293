"""Pictures of what the benchmarks found, in the style of the report's figures."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullFormatter, NullLocator, StrMethodFormatter

from sidegan.base.storage import replacing
from sidegan.report.canvas import blank, legend, tidy

_WIDTH, _HEIGHT = 5.5, 3.7  # [inch] of a panel
_RESOLUTION = 130  # [1/inch]
_APART = 1.3  # least ratio of two ticks that are named
_FEW = 2.2  # decades that have room for names between them
_LEAST = 8.0  # times from the lowest to the highest cost shown, so that what is flat looks flat


@contextmanager
def picture(path: Path, x: str, *y: str) -> Iterator[list[Axes]]:
    """Axes beside each other, one for each label ``y``, to draw into; then ``path`` is written."""
    figure = blank(_WIDTH * len(y), _HEIGHT)
    panels = list(figure.subplots(1, len(y), squeeze=False)[0])
    yield panels
    for axes, label in zip(panels, y):
        axes.set_xlabel(x, fontsize=9)
        axes.set_ylabel(label, fontsize=9)
        tidy(axes)
    lines, names = panels[0].get_legend_handles_labels()
    if len(names) > 1:
        legend(figure, dict(zip(names, lines)))
    with replacing(path) as draft:
        figure.savefig(draft, format="png", dpi=_RESOLUTION, metadata={"Software": None})


def logarithmic(axes: Axes, places: Sequence[int]) -> None:
    """Make both axes logarithmic, with the places below and plain numbers on the left."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xticks(named := _apart(places), [f"{x:,}" for x in named])
    low, high = axes.get_ylim()
    wider = max(1.0, (_LEAST * low / high) ** 0.5)
    axes.set_ylim(low / wider, high * wider)
    decades = np.ptp(np.log10(axes.get_ylim()))
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5) if decades < _FEW else (1,)))
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_minor_formatter(NullFormatter())


def _apart(places: Sequence[int]) -> list[int]:
    """Some of the places, far enough apart for their numbers, the last one always."""
    chosen: list[int] = []
    for place in sorted(places, reverse=True):
        if not chosen or chosen[-1] >= _APART * place:
            chosen.append(place)
    return chosen[::-1]
