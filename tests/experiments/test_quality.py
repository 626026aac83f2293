import pandas as pd
import pytest

from experiments import quality

PAGE = "quality"


def test_the_page_shows_every_seed_set_from_the_poorest_to_the_best(page, artifacts):
    text, tables = page
    cfg, frame = artifacts
    assert tables == {"added", "made"} and "figures/quality.png" in text
    assert list(frame.seeds.unique()) == ["8 steps", f"{cfg.seeds.steps} steps"]
    assert frame.groupby("seeds").training.apply(list).tolist() == [[0], [0]]
    assert frame.seeds_condition.is_monotonic_decreasing and frame.seeds_condition.nunique() == 2


def test_both_together_are_worth_at_least_the_seeds(artifacts):
    _, frame = artifacts
    assert (frame.information > 0.99).all() and (frame.error > 0).all()
    assert frame.generated.between(0, 6).all()
    unchanged = frame[frame.generated == 0]
    assert unchanged.condition_both.tolist() == pytest.approx(unchanged.condition_seeds.tolist())


@pytest.fixture
def rows():
    errors = {"poor": (0.5, 0.9), "fair": (0.9, 0.97), "good": (0.99, 1.0)}
    rows = [{"seeds": name, "error": error} for name, pair in errors.items() for error in pair]
    return pd.DataFrame(rows).assign(generated=1, condition_seeds=1.0, condition_both=1.0, information=1.0)


def test_what_is_added_counts_from_a_share_of_the_error_on(rows):
    assert quality.adding(rows)["they add"].to_dict() == {
        "poor": "in every training",
        "fair": "in some trainings",
        "good": "no",
    }
    assert quality.adding(rows)["cond of the best seeds"].tolist() == ["1", "1", "1"]  # of no training
    assert quality.stops(rows) == "fair" and quality.stops(rows[rows.seeds == "poor"]) is None
