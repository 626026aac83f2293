from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from experiments import generality, verdicts
from experiments.artifacts import Artifacts
from experiments.claims_training import CRITERIA, other_bases
from experiments.training import LATE
from experiments.verdicts import (
    HOLDS,
    NOT,
    OPEN,
    UNDECIDED,
    UNKNOWN,
    above,
    below,
    interval,
    lies_below,
    log_odds,
    not_below,
    ratios,
    shares,
    tally,
    together,
    within,
)
from sidegan.motion.dynamics import RigidBody


def effect(mean, spread=0.1, trainings=10):
    values = mean + spread * np.random.default_rng(0).standard_normal(trainings)
    return pd.Series(values, pd.Index(range(trainings), name="training"))


def test_an_interval_over_trainings_alone_is_students_and_log_odds_end_at_half_a_draw():
    odds = log_odds(pd.Series([0.0, 0.5, 1.0]), 100)
    assert odds.tolist() == pytest.approx([-np.log(199), 0.0, np.log(199)])
    values = effect(1.0)
    expected = stats.t.interval(0.95, len(values) - 1, values.mean(), stats.sem(values))
    assert (interval(values).low, interval(values).high) == pytest.approx(expected)


def test_intervals_cover_the_truth_as_often_as_they_say():
    hits = 0
    for seed in range(400):
        rng = np.random.default_rng(seed)
        index = pd.MultiIndex.from_product([range(5), range(10)], names=["training", "repeat"])
        training, draw = rng.standard_normal(5)[:, None], rng.standard_normal(10)[None]
        values = pd.Series((training + draw + rng.standard_normal((5, 10))).ravel(), index)
        low, _, high = interval(values)
        hits += low < 0 < high
    assert hits >= 0.94 * 400


def test_a_verdict_needs_the_whole_interval():
    """A wide interval about zero or a bound, or one training, shows nothing."""
    one, wide = effect(0.0, trainings=1), effect(0.0, 1.0)
    assert above(effect(1.0)) == below(effect(-1.0)) == HOLDS and above(effect(-1.0)) == NOT
    assert above(effect(0.0)) == above(effect(1.0, trainings=1)) == UNDECIDED
    assert above(effect(0.8), 0.8) == below(effect(0.8), 0.8) == OPEN
    assert above(effect(1.0), 0.8) == HOLDS and below(effect(1.0), 0.8) == NOT
    assert not_below(effect(0.0, 0.01)) == not_below(effect(-0.02, 0.001)) == HOLDS  # a narrow one: no loss
    assert not_below(wide) == not_below(one) == UNDECIDED and not_below(effect(-1.0)) == NOT
    assert within(effect(0.1, 0.01), 0.2) == HOLDS and within(effect(-1.0), 0.2) == NOT
    assert within(effect(0.1, 1.0), 0.2) == within(one, 0.2) == OPEN


def test_a_share_of_draws_has_an_exact_interval():
    none = verdicts.proportion(0.0, 4000)
    assert none.low == 0 and none.high == pytest.approx(1 - 0.025 ** (1 / 4000))
    assert lies_below(none, 0.001) == HOLDS and lies_below(verdicts.proportion(0.5, 100), 0.001) == NOT
    assert lies_below(verdicts.proportion(0.5, 10), 0.5) == OPEN


def test_a_claim_about_several_holds_if_it_holds_of_each():
    assert together([HOLDS, HOLDS]) == HOLDS and together([]) == together([HOLDS, UNKNOWN]) == UNKNOWN
    assert together([HOLDS, NOT]) == together([NOT, UNDECIDED]) == together([OPEN, NOT]) == NOT
    assert together([HOLDS, UNDECIDED]) == together([OPEN, HOLDS]) == together([OPEN, UNDECIDED]) == OPEN
    assert together([UNDECIDED, UNDECIDED]) == UNDECIDED and together([OPEN, OPEN]) == OPEN
    assert tally([HOLDS, NOT, UNDECIDED]) == "1 of 3 hold, 1 do not: " and tally([NOT, NOT]) == ""


def test_what_has_no_interval_says_so_as_a_ratio_and_as_a_share():
    alone = pd.Series([0.5], pd.Index([0], name="training"))
    assert ratios({"eigen": alone}) == "eigen 1.65 (no interval: one value) ×"
    assert shares({"eigen": alone}) == "eigen 62% (no interval: one value)"


def test_a_verdict_says_where_the_valid_alone_would_give_another():
    def judged(valid):
        rows = [
            {"variant": name, "training": k, "epoch": LATE, "condition": every + k, "condition_valid": alone}
            for name, every, alone in (("vanilla", 1e3, 2e3), ("eigen", 10, valid), ("diagonal", 10, valid))
            for k in range(3)
        ]
        return CRITERIA["fitter"](SimpleNamespace(histories=pd.DataFrame(rows)))

    one, torn, nothing = judged(1e3), judged(1e4), judged(np.nan)
    assert one.verdict == torn.verdict == nothing.verdict == HOLDS and "for which" not in one.ours
    assert torn.ours.endswith(f"for which the verdict would be: {NOT}")
    assert nothing.ours.endswith(UNKNOWN) and "nothing to measure" in nothing.ours


@pytest.mark.parametrize(
    ("epochs", "early", "late"), [(9, UNKNOWN, UNKNOWN), (39, NOT, UNKNOWN), (50, NOT, NOT)]
)
def test_epochs_that_a_training_did_not_reach_are_not_measured(epochs, early, late):
    rows = [
        {"variant": name, "training": k, "epoch": epoch, "success": 0.1, "condition": 1.0 + (name == "eigen")}
        | {"distance": 1.0, "condition_valid": 1.0}
        for name in ("vanilla", "eigen", "diagonal")
        for k in range(3)
        for epoch in range(1, epochs + 1)
    ]
    made = SimpleNamespace(
        histories=pd.DataFrame(rows),
        cfg=SimpleNamespace(evaluation=500),
        surrogates={"accepted": 0.999, "rejected": 0.995, "accepted_50": 0.9},
    )
    found = {key: CRITERIA[key](made) for key in ("predictor", "reliable", "vanilla_first", "fitter")}
    assert found["reliable"].verdict == early and found["fitter"].verdict == late
    assert (found["vanilla_first"].verdict == UNKNOWN) == (early == UNKNOWN)
    assert ("nothing to measure" in found["fitter"].ours) == (late == UNKNOWN)
    share = found["predictor"].ours.partition("; valid share of all samples of the generators")[2]
    assert ("eigen 10%" in share) == (late != UNKNOWN) and found["predictor"].verdict == HOLDS
    assert "99.9% of held-out seeds and rejects 99.5%" in found["predictor"].ours
    made.surrogates["accepted"] = 0.003
    assert CRITERIA["predictor"](made).verdict == NOT


@pytest.mark.parametrize(("rate", "verdict"), [(1000.0, HOLDS), (0.0, NOT), (np.nan, UNKNOWN)])
def test_a_generator_of_nothing_valid_is_not_faster(rate, verdict):
    cfg = SimpleNamespace(library=SimpleNamespace(count=9), trainings=[0])
    found = {"cfg": cfg, "speed": {"valid_per_second": rate}, "seed_seconds": 1.0}
    made = type("Planted", (Artifacts,), found | {"training_seconds": lambda *_: 1.0})(None)
    assert CRITERIA["trained_too"](made).verdict == verdict


def test_another_basis_gives_the_same_torques_and_only_a_rotation_the_same_trace(arm):
    body, random = RigidBody(arm), np.random.default_rng(0)
    q, dq, ddq = random.standard_normal((3, 20, arm.joints))
    y, torque = body.base_regressor(q, dq, ddq), body.torque(q, dq, ddq)
    for change, same in zip(other_bases(body), (True, False)):
        other = np.linalg.solve(change, body.base.values)
        np.testing.assert_allclose(y @ change @ other, torque)
        assert np.isclose(np.square(y @ change).sum(), np.square(y).sum()) == same


def test_arms_are_judged_by_the_page_on_them(monkeypatch, tmp_path):
    text = "| arm | generator | valid | mean distance | … geometric |\n| --- | --- | --- | --- | --- |\n"
    text += "| a | eigen | 0.9 | 1 | 0.5 |\n| b | eigen | 0.9 | 1 | 2 |\n"
    others = "\n| generated for | a | b |\n| --- | --- | --- |\n| a | 1 | 0.005 |\n| b | — | 1 |\n"
    (tmp_path / "generality.md").write_text(text + others, encoding="utf-8")
    monkeypatch.setattr(generality, "DOCS", tmp_path)

    def verdicts_on(arm, scale):
        cell = SimpleNamespace(arm=SimpleNamespace(name=arm))
        made = SimpleNamespace(run=SimpleNamespace(cfg=SimpleNamespace(scale={"name": scale}), cell=cell))
        return [CRITERIA[key](made).verdict for key in ("other_arms", "no_transfer")]

    assert verdicts_on("a", "paper") == [NOT, HOLDS]
    alone = others.replace("0.005", "—")  # no two arms with as many joints
    (tmp_path / "generality.md").write_text(text + alone, encoding="utf-8")
    assert verdicts_on("a", "paper") == [NOT, UNKNOWN]
    without_eigen = text.replace("eigen", "prediction")
    (tmp_path / "generality.md").write_text(without_eigen + others, encoding="utf-8")
    assert verdicts_on("a", "paper") == [UNKNOWN, HOLDS]
    for other in (("b", "paper"), ("c", "paper"), ("a", "tiny")):  # of which the page says nothing
        assert verdicts_on(*other) == [UNKNOWN, UNKNOWN]
    (tmp_path / "generality.md").unlink()
    assert verdicts_on("a", "paper") == [UNKNOWN, UNKNOWN]
