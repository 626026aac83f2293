"""Drawing until enough are valid: which are kept, how many are drawn, and what is said when too few are."""

from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest

from sidegan.errors import InfeasibleError
from sidegan.library.draw import Expansion, draw_valid


class Source:
    """Trajectories 0, 1, 2, …, of which every so many-th is valid."""

    def __init__(self, every):
        self.every, self.sizes = every, []

    def sample(self, count):
        start = sum(self.sizes)
        self.sizes.append(count)
        return np.arange(start, start + count)[:, None, None, None] * np.ones(2)

    def check(self, c):
        valid = c[:, 0, 0, 0] % self.every == self.every - 1
        return SimpleNamespace(valid=valid, faults=lambda: Counter({"torque of wrist": int((~valid).sum())}))

    def draw(self, count, batch, draws, least=1, origin="drawn from eigen", report=None):
        return draw_valid(
            self.sample,
            self.check,
            Expansion(count=count, batch=batch, draws=draws, least=least),
            origin,
            report,
        )


def test_the_first_valid_ones_are_kept_in_order(caplog):
    source = Source(3)
    draws = source.draw(4, 5, 100, least=4)
    assert draws.coefficients[:, 0, 0, 0].tolist() == [2, 5, 8, 11]
    assert (draws.drawn, draws.valid, source.sizes) == (15, 5, [5, 5, 5])
    assert not caplog.text


def test_draws_are_limited_and_the_valid_share_reported(caplog):
    source, steps = Source(3), []
    draws = source.draw(40, 6, 20, report=lambda *step: steps.append(step))
    assert source.sizes == [6, 6, 6, 2] and draws.drawn == 20
    assert len(draws.coefficients) == draws.valid == 6
    assert steps == [(12, 40), (24, 40), (36, 40), (40, 40)]
    assert "only 6 valid trajectories in 20 draws, expected 40: drawn from eigen" in caplog.text


@pytest.mark.parametrize(
    ("every", "least", "words"),
    [
        (1000, 1, "0 of 60 trajectories polished are valid; of the last 20, 20 violate torque of wrist"),
        (20, 4, "3 of 60 trajectories polished are valid; of the last 20, 19 violate"),
    ],
)
def test_too_few_are_refused(every, least, words):
    with pytest.raises(InfeasibleError, match=words):
        Source(every).draw(4, 20, 60, least, "polished")
