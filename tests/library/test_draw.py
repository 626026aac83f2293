"""Drawing until enough are valid: which are kept, how many are drawn, and what is said when too few are."""

from collections import Counter
from types import SimpleNamespace

import pytest
import torch

from sidegan.errors import InfeasibleError
from sidegan.library.draw import draw_valid


class Source:
    """Trajectories 0, 1, 2, …, of which every so many-th is valid."""

    def __init__(self, every):
        self.every, self.sizes = every, []

    def sample(self, count):
        start = sum(self.sizes)
        self.sizes.append(count)
        return torch.arange(start, start + count).double()[:, None, None, None].expand(-1, 1, 1, 2)

    def check(self, c):
        valid = c[:, 0, 0, 0] % self.every == self.every - 1
        return SimpleNamespace(valid=valid, faults=lambda: Counter({"torque of wrist": int((~valid).sum())}))

    def draw(self, *sizes, **options):
        return draw_valid(self.sample, self.check, *sizes, **options)


def test_the_first_valid_ones_are_kept_in_order():
    source = Source(3)
    draws = source.draw(4, 5, 100)
    assert draws.coefficients[:, 0, 0, 0].tolist() == [2, 5, 8, 11]
    assert (draws.drawn, draws.valid, source.sizes) == (15, 5, [5, 5, 5])
    assert not draws.faults


def test_no_more_than_the_most_are_drawn_and_their_share_is_reported_where_it_is_larger():
    source, steps = Source(3), []
    draws = source.draw(40, 6, 20, report=lambda *step: steps.append(step))
    assert source.sizes == [6, 6, 6, 2] and draws.drawn == 20
    assert len(draws.coefficients) == draws.valid == 6
    assert draws.faults == {"torque of wrist": 2} and draws.last == 2
    assert steps == [(12, 40), (24, 40), (36, 40), (40, 40)]


def test_too_few_are_refused_or_warned_of(caplog):
    none = Source(1000).draw(4, 20, 60)
    with pytest.raises(InfeasibleError) as error:
        none.require(1, "drawn from eigen")
    assert str(error.value) == (
        "none of 60 trajectories drawn from eigen is valid; of the last 20, 20 violate torque of wrist"
    )
    few = Source(20).draw(4, 20, 60)
    with pytest.raises(InfeasibleError, match="only 3 of 60 trajectories polished are valid"):
        few.require(4, "polished")
    assert few.require(1, "drawn from eigen") is few
    assert "3 valid trajectories in 60 draws, 4 were wanted: drawn from eigen" in caplog.text
    caplog.clear()
    Source(2).draw(4, 20, 60).require(4, "drawn")
    assert not caplog.text
