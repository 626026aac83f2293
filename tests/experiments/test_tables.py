"""The paper's tables and the tables of sweeps, of frames made by hand."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from experiments import exp1, exp2, training
from experiments.claims_identification import CRITERIA
from experiments.verdicts import HOLDS, NOT
from tests.tiny import tiny

SETS = ("eigen", "long-6", "seeds")


def results(nmse, repeats=2, sets=SETS):
    """An nMSE whose mean over joints is ``nmse(set, repeat)``, four times that when weighted."""
    rows = [
        (name, repeat, w, joint, nmse(name, repeat) * (4 if w else 1) * factor)
        for name in sets
        for repeat in range(repeats)
        for w in (False, True)
        for joint, factor in (("shoulder", 0.5), ("elbow", 1.5))
    ]
    return pd.DataFrame(rows, columns=["set", "repeat", "weighted", "joint", "nmse"]).assign(training=0)


def test_table_1_is_mean_and_deviation_over_repeats_of_the_joints_mean():
    base = {"eigen": 1.0, "long-6": 3.0, "seeds": 2.0}
    raw = results(lambda name, repeat: base[name] + 2 * repeat)
    table = exp1.table1(raw, raw.assign(nmse=raw.nmse * 10), raw.iloc[:0], raw.iloc[:0])
    assert list(table.columns) == ["single long, 6 harmonics", "seeds", "seeds + eigen"]
    assert table.loc[exp1.SIMULATOR].tolist() == ["4 ± 1.4", "3 ± 1.4", "2 ± 1.4"]
    assert table.loc[exp1.WEIGHTED].tolist() == ["16 ± 5.7", "12 ± 5.7", "8 ± 5.7"]
    assert table.loc[exp1.PLANT].tolist() == ["40 ± 14", "30 ± 14", "20 ± 14"]
    assert table.loc["Paper, simulator"].tolist() == ["0.2248 ± 0.056", "0.0063 ± 0.002", "0.0028 ± 0.001"]
    assert table.loc["Paper, real robot"].tolist() == ["8.509 ± 9.906", "0.0239 ± 0.017", "0.0210 ± 0.016"]


def test_expected_errors_stand_first_by_geometric_means_and_what_was_not_made_has_no_number():
    raw = results(lambda name, repeat: 1.0 + repeat)
    sure = results(lambda name, repeat: 7.0, repeats=1).drop(columns="repeat")
    both = pd.concat([sure, sure.assign(training=1, nmse=3 * sure.nmse)])
    constant = both[both.weighted]
    table = exp1.table1(raw, raw, both, constant)
    geometric = f"{exp1.EXPECTED}, geometric mean"
    expected = [geometric, exp1.EXPECTED, exp1.EXPECTED_WEIGHTED, exp1.CONSTANT]
    assert list(table.index)[:6] == [*expected, exp1.SIMULATOR, exp1.WEIGHTED]
    assert table.loc[exp1.EXPECTED].tolist() == ["14 ± 9.9"] * 3
    root = 0.75**0.5  # of the joints' shares of their mean, 0.5 and 1.5
    assert [float(x.split(" ")[0]) for x in table.loc[geometric]] == pytest.approx([14 * root] * 3, rel=0.02)
    assert table.loc[exp1.CONSTANT].tolist() == ["56 ± 40"] * 3
    plain = raw[~raw.weighted]
    table = exp1.table1(plain, plain, both.iloc[:0], constant)
    assert exp1.EXPECTED not in table.index and table.loc[exp1.WEIGHTED].tolist() == ["—"] * 3


@pytest.mark.parametrize(("weighted", "said"), [(0.8, True), (0.4, False)])
def test_random_draws_have_their_range_and_the_finding_is_reported_where_it_is_one(weighted, said):
    """Of 101 draws of the seeds from 1 to 3, and as many of a generator that has a share of their errors."""
    shares = {"seeds": dict.fromkeys(exp1.NOISES, 1.0)}
    shares["eigen"] = {"error": 0.5, "error_weighted": weighted, "error_constant": 2.0}
    rows = [
        (name, noise, share * (1 + k / 50))
        for name, by_noise in shares.items()
        for noise, share in by_noise.items()
        for k in range(101)
    ]
    frame = pd.DataFrame(rows, columns=["set", "noise", "nmse"]).eval("geometric = nmse / 7")
    table = exp1.draws(frame)
    assert list(table.index) == ["seeds", "eigen"]
    assert table.loc["eigen"].tolist()[::2] == ["1 (0.55 … 1.45)", "4 (2.2 … 5.8)"]
    assert exp1.finding(frame).startswith("; eigen's gain over the seeds") == said
    assert ("is 2.00, and 1.25 with weights:" in exp1.finding(frame)) == said


def test_factors_are_ratios_of_errors_draw_by_draw_with_their_intervals():
    base = {"eigen": 1.0, "long-6": 3.0, "seeds": 2.0}
    raw = results(lambda name, repeat: base[name] * (1 + repeat))
    sure = results(lambda name, repeat: base[name], repeats=1).drop(columns="repeat")
    worse = sure[sure["set"] == "eigen"].assign(training=1)
    both = pd.concat([sure, worse.assign(nmse=4 * worse.nmse)])
    assert exp1.factors(raw, sure, raw, ["eigen"]).loc[exp1.SIMULATOR].item() == "2 (2 … 2)"  # over draws
    raw = pd.concat([raw, raw[raw["set"] == "eigen"].assign(training=1)])
    table = exp1.factors(raw, both, raw, ["eigen"])
    assert list(table.columns) == ["seeds + eigen"] and table.loc[exp1.SIMULATOR].item() == "2 (2 … 2)"
    alone = exp1.factors(raw, sure, raw, ["eigen"]).loc[exp1.EXPECTED].item()
    assert alone == "2"  # no interval
    assert table.loc[exp1.EXPECTED].item().startswith("1 (")  # 2 in one training, 1/2 in the other


def test_plants_are_compared_one_by_one_by_both_means_and_weightings():
    """Of seeds and random trajectories, and of two joints, one of which a generator makes worse."""
    sets = ("eigen", "vanilla", "random", "seeds", "long-6")
    ratio = {"eigen": [1.0, 1.1, 0.9], "vanilla": [2.2, 2.0, 1.8]}
    plants = results(lambda name, k: ratio.get(name, [1.0] * 3)[k] * 10**k, repeats=3, sets=sets)
    worse = (plants["set"] == "eigen") & (plants.joint == "elbow") & plants.weighted
    plants = plants.assign(nmse=plants.nmse * np.where(worse, 4, 1))
    table = exp1.factors(plants, plants.iloc[:0], plants, ["eigen", "vanilla"])
    assert list(table.columns) == ["random valid", "seeds + vanilla", "seeds + eigen"]
    assert table.loc[exp1.PLANT, "random valid"] == "1 (1 … 1)"
    low, mean, high = (
        np.exp(-np.log(ratio["vanilla"]).mean() + k * 0.1 * 4.303 / 3**0.5) for k in (-1, 0, 1)
    )
    told = [float(x.strip("()")) for x in table.loc[exp1.PLANT, "seeds + vanilla"].split(" ") if x != "…"]
    assert told == pytest.approx([mean, low, high], rel=0.01)  # Student's t of three, logarithms 0.1 apart
    keys = [f"{key}{mean}" for key in (exp1.PLANT, exp1.PLANT_WEIGHTED) for mean in ("", ", geometric mean")]
    means = [float(table.loc[key, "seeds + eigen"].split(" ")[0]) for key in keys]
    alone = np.exp(-np.log(ratio["eigen"]).mean())
    assert means == pytest.approx([alone, alone, alone / 3.25, alone / 2], rel=0.01)
    said = exp1.on_plants(plants, ["eigen", "vanilla"]).split(". ")
    words = "{0} of 2 sets with generated trajectories have a larger error than the seeds, {0} significantly"
    assert words.format(1) in said[0] and words.format(2) in said[1] and all("; 0 a" in x for x in said)
    assert said[1].startswith("Weighted per joint: ")


@pytest.fixture
def whole():
    """Errors of experiment 2, and norms in proportion to samples."""
    base = {"seeds ×1": 4.0, "seeds ×4": 2.0, "seeds ×10": 1.0, "eigen": 1.0}
    errors = results(lambda name, repeat: base[name], repeats=1, sets=tuple(base))
    elbow = (errors["set"] == "eigen") & (errors.joint == "elbow")
    samples = {"seeds ×1": 100, "seeds ×4": 400, "seeds ×10": 1000, "eigen": 250}
    facts = pd.DataFrame(samples.items(), columns=["set", "samples"]).assign(training=0, repeat=0)
    return SimpleNamespace(
        whole_errors=errors.assign(nmse=errors.nmse.where(~elbow, 0.5 * errors.nmse)),
        whole_facts=facts.assign(covariance_norm=2 / facts.samples, fitted_norm=1.0),
        cfg=tiny("gan=eigen", experiment="exp2"),
    )


def test_table_2_is_one_minus_the_ratio_of_errors_joint_by_joint(whole):
    plain = whole.whole_errors[~whole.whole_errors.weighted]
    gain = exp2.improvement(plain, "eigen", "seeds ×1").set_index("joint").improvement
    assert gain.to_dict() == {"shoulder": 75.0, "elbow": 87.5}
    table = exp2.table2(plain, whole.cfg).filter(like="seeds + eigen over seeds ×", axis=0)
    assert table["mean over joints"].tolist() == ["81.2 ± 8.8", "62 ± 18", "25 ± 35"]
    geometric = [100 * (1 - (0.25 * 0.125) ** 0.5 * k) for k in (1, 2, 4)]
    assert [float(x.split(" ")[0]) for x in table["geometric mean"]] == pytest.approx(geometric, abs=0.05)
    assert table.iloc[0]["median"] == "81.2" and table.iloc[0]["paper, mean"] == "51 ± 27"
    assert list(exp2.tables2(whole.whole_errors, whole.cfg)) == ["table2", "table2_weighted"]


def test_readings_stand_beside_the_papers_numbers_of_the_same_replications(whole):
    cfg = tiny("gan=eigen", "replication.replicas=[1,2]", experiment="exp2")
    errors = whole.whole_errors.replace({"seeds ×4": "seeds ×2"})
    table = exp2.readings(SimpleNamespace(cfg=cfg, readings={"seeds": errors}))
    assert table["eigen"].tolist() == ["81; 62", "51; —"]


@pytest.mark.parametrize(("less", "verdict"), [(0.9, HOLDS), (0.1, NOT)])
def test_whether_the_improvement_shrinks_is_of_each_variant_in_percentage_points(less, verdict):
    """Of errors that are a share of the seeds', which measuring these again makes ``less`` times as large."""
    shares = {"vanilla": 0.02, "eigen": 0.04, "diagonal": 0.03}
    base = {"seeds ×1": 1.0, "seeds ×4": less, "seeds ×10": less, **shares}
    errors = results(lambda name, repeat: base[name] * (1 + repeat / 10), repeats=3, sets=tuple(base))
    found = CRITERIA["not_less"](SimpleNamespace(whole_errors=errors, cfg=tiny(experiment="exp2")))
    assert found.verdict == verdict and found.numbers == {"negligible": 5, "least": 1, "most": 10}
    for name, share in shares.items():
        assert f"{name} {100 * share * (1 - 1 / less):.3g} (" in found.ours.replace("−", "-")


def test_table_3_is_the_norm_and_what_it_would_be_of_one_sample(whole):
    table = exp2.table3(whole.whole_facts)
    assert table["‖diag P‖"].tolist() == ["0.02", "0.005", "0.002", "0.008"]
    assert table["‖diag P‖ × samples"].tolist() == ["2"] * 4
    assert table.loc["seeds + eigen", "paper"] == "1.89143"


def test_epochs_to_reliability():
    runs = {
        "eigen": ((0.1, 0.85, 0.7), (0.9, 0.2, 0.95)),
        "vanilla": ((0.1, None, 0.1),),
        "diagonal": ((0.9, 0.9, 0.9), (0.8, 0.1, 0.9)),
    }
    rows = [
        {"variant": name, "training": k, "epoch": epoch, "success": share}
        for name, trainings in runs.items()
        for k, run in enumerate(trainings)
        for epoch, share in enumerate(run, 1)
    ]
    frame = pd.DataFrame(rows)
    table = training.speed(frame)
    assert table["first epoch"].tolist() == ["2, 1", "never", "1 (2 ×)"]
    never = ["valid after 10 epochs", "mean from epoch 40 on"]  # of three epochs
    assert table.loc["eigen", ["best", *never]].tolist() == ["0.9 ± 0.071", "—", "—"]
    later = training.speed(frame.assign(epoch=frame.epoch + 38)).loc["eigen"]
    assert later["mean from epoch 40 on"] == "0.67 ± 0.14" and later["last"] == table.loc["eigen", "last"]


def test_a_run_leaves_the_mean_errors_of_every_set_for_the_table_of_a_sweep(whole):
    made = SimpleNamespace(
        errors=results(lambda name, repeat: 1.0 + repeat),
        plant=results(lambda name, repeat: 2.0),
        expected=results(lambda name, repeat: 1.4, repeats=1).drop(columns="repeat"),
    )
    table = exp1.summary(made)
    assert list(table.index) == ["long-6", "seeds", "eigen"]
    expected = {"nMSE": 1.5, "nMSE, weighted": 6.0, "nMSE, expected": 1.4, "nMSE, expected, weighted": 5.6}
    expected |= {"nMSE, MuJoCo plants": 2.0, "nMSE, MuJoCo plants, weighted": 8.0}
    assert table.loc["eigen"].to_dict() == pytest.approx(expected)
    table = exp2.summary(whole)
    assert table.loc["eigen"].tolist() == pytest.approx([0.625, 81.25, 62.5, 25.0, 0.008])
    assert table.loc["seeds ×4", "nMSE"] == 2.0 and table.loc["seeds ×4"].isna().sum() == 3
    row = {"success": 0.5, "condition": 9.0, "gain": 4.0, "norm": 1.0, "valid_share": 0.6, "valid": np.nan}
    generators = pd.DataFrame(row | {"name": "eigen", "condition": x} for x in (9.0, 11.0))
    assert training.summary(generators).loc["eigen"].tolist() == pytest.approx([0.6, 10.0, 4.0, 1.0])
