"""Tables of other readings, from results whose answer is known."""

from itertools import product

import pandas as pd
import pytest

from experiments import readings
from experiments.claims_identification import CRITERIA, OF_WHOLE_SETS
from experiments.finding import named
from experiments.verdicts import HOLDS, NOT, PART
from experiments.words import PAPER
from tests.tiny import tiny

RATIO = {"vanilla": 0.8, "eigen": 0.5, "diagonal": 0.6}  # of the seeds' error, in a reading that favours them
JOINTS = ("a", "b")


@pytest.fixture
def config(tmp_path):
    return tiny(f"outputs={tmp_path}", "replication.replicas=[1,4]", experiment="reproduction")


def errors(seeds, ratios):
    """Unweighted errors of two seed sets, three trainings and two draws; the seeds ×4 are as good as ×1."""
    rows = []
    for column, repeat, joint in product(("one", "two"), range(2), JOINTS):
        wobble = 1 + 0.01 * repeat
        rows += [(f"seeds ×{k}", 0, column, repeat, joint, seeds) for k in (1, 4)]
        for (name, ratio), training in product(ratios.items(), range(3)):
            error = seeds * ratio * wobble * (1 + 0.01 * training)
            rows.append((name, training, column, repeat, joint, error))
    columns = ["set", "training", "column", "repeat", "joint", "nmse"]
    return pd.DataFrame(rows, columns=columns).assign(weighted=False)


def both(factor):
    """One reading in which generated ones are better, and one in which they are ``factor`` times worse."""
    worse = {name: factor for name in RATIO}
    parts = {"good": errors(2.0, RATIO), "bad": errors(2.0, worse)}
    return pd.concat([part.assign(reading=name) for name, part in parts.items()], ignore_index=True)


def test_improvements_stand_by_reading_and_variant(config):
    table = readings.improvements(both(3.0), config)
    variant = table.columns[0]
    shown = {(reading, row[variant]): row["×1"] for reading, row in table.iterrows()}
    assert shown["paper", "seeds + eigen"] == PAPER["table2"]["eigen"][1]
    gain = 100 * (1 - RATIO["eigen"] * 1.005 * 1.01)
    assert float(shown["good", "seeds + eigen"].split()[0]) == pytest.approx(gain, rel=1e-2)
    assert shown["bad", "seeds + vanilla"].startswith("-")
    assert len(table) == 3 * len(RATIO) and list(table.columns) == [variant, "×1", "×4"]


def test_verdicts_move_with_the_reading(config):
    table = readings.verdicts(both(3.0), config)
    improve, replaced = (PAPER["claims"][key]["claim"] for key in ("generated_improve", "not_replaced"))
    assert table.loc[improve].to_dict() == {"good": HOLDS, "bad": NOT}
    assert table.loc[replaced].to_dict() == {"good": HOLDS, "bad": NOT}
    assert table.loc[PAPER["claims"]["more_than_vanilla"]["claim"], "good"] == HOLDS


def test_the_claims_are_judged_by_the_same_function(config):
    assert set(OF_WHOLE_SETS) < set(CRITERIA)

    class Group:
        first = type("First", (), {"cfg": config})

        @staticmethod
        def frame(name):
            frames = {"whole_errors": both(3.0).query("reading == 'good'"), "readings": both(3.0)}
            return frames[name]

    for key, judge in OF_WHOLE_SETS.items():
        found, own = CRITERIA[key](Group), judge(Group.frame("whole_errors"), config)
        assert found.verdict == own.verdict
        other = judge(both(3.0).query("reading == 'bad'"), config).verdict
        assert found.ours.startswith(own.ours) and found.ours.endswith(f"bad: {other}")
    assert CRITERIA["generated_improve"](Group).ours.endswith(f"bad: {NOT}")


def norms(recursions):
    """Covariance norms whose ratios to the seeds measured once are those given, by recursion."""
    rows = [
        (name, training, *recursion, 7.0 * ratio)
        for recursion, ratios in recursions.items()
        for name, ratio in ratios.items()
        for training in range(2)
    ]
    return pd.DataFrame(rows, columns=["set", "training", "prior", "forgetting", "covariance_norm"])


def test_the_nearest_recursion_is_the_one_with_the_papers_ratios():
    paper = {name: float(x) / float(PAPER["table3"]["seeds ×1"]) for name, x in PAPER["table3"].items()}
    twice = {name: x if name == "seeds ×1" else 2 * x for name, x in paper.items()}
    frame = norms({(1e6, 1.0): twice, (1.0, 0.9): paper})
    apart = readings.distances(frame)
    assert list(apart) == [named(1.0, 0.9), named(1e6, 1.0)]
    assert list(apart.values()) == pytest.approx([1.0, 2.0])
    same = readings.distances(norms({(1.0, 1.0): dict.fromkeys(paper, 1.0)}))
    assert next(iter(same.values())) == pytest.approx(readings.unchanged()) and readings.unchanged() > 1
    table = readings.recursions(frame)
    assert table.loc["seeds + eigen", named(1.0, 0.9)] == table.loc["seeds + eigen", "paper"]
    assert float(table.loc["seeds + eigen", named(1e6, 1.0)]) == pytest.approx(2 * paper["eigen"], rel=0.01)


def of_norms(config, recursions, samples):
    """A group with covariance norms by recursion, those of the first in Table III."""
    first = norms({key: recursions[key] for key in list(recursions)[:1]})
    first = first.assign(column="ours", samples=[samples[name] for name in first["set"]])
    facts = pd.concat([first.assign(repeat=k) for k in range(2)])
    frames = {"whole_facts": facts, "covariances": norms(recursions).assign(column="ours")}
    wobbly = {
        k: x.assign(covariance_norm=x.covariance_norm * (1 + 1e-3 * x.training)) for k, x in frames.items()
    }
    return type("Group", (), {"first": type("First", (), {"cfg": config}), "frame": staticmethod(wobbly.get)})


def test_the_smallest_norm_is_told_under_every_recursion_and_per_sample(config):
    usual = (config.identification.prior, config.identification.forgetting)
    large = {"seeds ×1": 1.0, "seeds ×4": 0.25, "vanilla": 0.3, "diagonal": 0.3, "eigen": 0.2}
    forgets = {"seeds ×1": 1.0, "seeds ×4": 0.95, "vanilla": 0.8, "diagonal": 0.8, "eigen": 0.9}
    samples = {"seeds ×1": 1, "seeds ×4": 4, "vanilla": 3, "diagonal": 3, "eigen": 10}
    found = CRITERIA["smallest_norm"](of_norms(config, {usual: large, (1e6, 0.9): forgets}, samples))
    assert found.verdict == HOLDS
    assert f"‖diag P‖ × samples: {NOT}" in found.ours and f"λ = 0.9: {PART}" in found.ours
    assert named(*usual) not in found.ours
    assert found.numbers["steady"] == f"{named(1e6, 0.9)}: only what forgets"
    alone = CRITERIA["smallest_norm"](of_norms(config, {usual: large}, samples))
    assert alone.numbers["steady"] == "no recursion that was tried"


def test_errors_elsewhere_stand_by_kind_of_test():
    rows = [
        (kind, name, 0, repeat, weighted, joint, nmse * (1 + weighted), 0.01 * nmse)
        for kind, nmse in (("slow", 1.0), ("fast", 2.0))
        for name, repeat, weighted, joint in product(("seeds", "long-3"), range(2), (False, True), JOINTS)
    ]
    columns = ["test", "set", "training", "repeat", "weighted", "joint", "nmse", "share"]
    table = readings.elsewhere(pd.DataFrame(rows, columns=columns), weighted=True)
    assert list(table.index) == ["slow", "slow", "fast", "fast"]
    assert list(table.columns) == ["error", "single long, 3 harmonics", "seeds"]
    assert table.seeds.str.split().str[0].astype(float).tolist() == pytest.approx([2.0, 1.0, 4.0, 2.0])
