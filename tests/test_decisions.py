"""Numbers of `conf/` that docs/decisions.md quotes are those that `conf/` has."""

from pathlib import Path

import pytest
from omegaconf import OmegaConf

from sidegan.pipeline.places import CONF

TEXT = " ".join((Path(__file__).parents[1] / "docs" / "decisions.md").read_text(encoding="utf-8").split())
QUOTED = [  # words of the page, file, setting, value
    ("Seeds keep a reserve of 0.2 of every limit", "seeds/gradient", "reserve", 0.2),
    ("which nothing imitates, keeps 0.03", "experiment/excite", "search.reserve", 0.03),
    ("`goal.objective=prediction` is the default", "experiment/excite", "goal.objective", "prediction"),
    ("the 35 strongest eigenvalues", "seeds/paper", "seeds.strongest", 35),
    ("seeds have a box (±0.2 rad/s)", "seeds/paper", "seeds.box", 0.2),
    ("random draws of 35", "selection/greedy", "count", 35),
    ("6 (a slow crawl), or 210", "base/sets", "long.harmonics", [6, 210]),
    ("the best of eight starts", "scale/paper", "long_starts", 8),
    ("two generator steps per discriminator step", "gan/_base", "generator_steps", 2),
    ("50 epochs are the paper's", "scale/paper", "gan_epochs", 50),
    ("falls to a fiftieth along half a cosine", "gan/_base", "last_rate", 0.02),
    ("success 150, reserve 0.03", "gan/_side", "reserve", 0.03),
    ("success 150, reserve 0.03", "gan/_side", "weights.success", 150),
    ("what stands | 0.990 |", "gan/_side", "weights.distance", 250),
    ("and distance 250, rank 200, offset 600", "gan/_side", "weights.rank", 200),
    ("and distance 250, rank 200, offset 600", "gan/_side", "weights.offset", 600),
    ("links up to 20 % off the description", "base/sets", "plants.plant.parameters", 0.2),
]


@pytest.mark.parametrize(("words", "file", "setting", "value"), QUOTED)
def test_decisions_quote_the_current_settings(words, file, setting, value):
    assert words in TEXT
    assert OmegaConf.select(OmegaConf.load(CONF / f"{file}.yaml"), setting) == value
