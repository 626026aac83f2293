import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import torch

from experiments import beyond, beyond_goals, beyond_tables, beyond_words
from experiments.artifacts_beyond import BeyondArtifacts
from experiments.beyond_even import break_even, optimiser_seconds, worth_from
from experiments.beyond_tables import arrival
from sidegan.errors import ArtifactError, ConfigError
from sidegan.library.measure import effort
from sidegan.pipeline.run import run_stages
from sidegan.pipeline.settings import validate
from sidegan.pipeline.stages import stage, transfer
from sidegan.pipeline.stages.best import GREEDY, OPTIMAL, all_pools, best_sets
from sidegan.pipeline.stages.library import library
from sidegan.pipeline.stages.narrow import NARROW, narrow
from sidegan.pipeline.stages.objectives import with_objectives
from sidegan.pipeline.stages.optimised import OPTIMISED
from sidegan.pipeline.stages.polish import POLISHED, polished
from sidegan.pipeline.stages.pools import SEEDS
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.store import Store
from sidegan.pipeline.task import FACTS, Task
from sidegan.pipeline.tracking import Tracker
from sidegan.pipeline.workspace import Region
from sidegan.validity import Sphere
from tests.tiny import composed, tiny

PAGE = "beyond"


def config(root, *overrides):
    return tiny(f"outputs={root}", *overrides, experiment=PAGE)


def test_the_page_has_its_tables_figures_and_metrics(run, page):
    text, tables = page
    for title in (
        "Goals",
        "What each way makes",
        "Seconds to the first 6",
        "The best 6",
        "Polish",
        "Objectives",
    ):
        assert f"## {title}" in text, title
    assert "Not run" not in text and "| nan" not in text
    assert {
        "goals",
        "pools",
        "first",
        "best_greedy",
        "best_D_optimal",
        "polish",
        "objectives",
        "few",
    } <= tables
    folder = run / "docs" / "beyond" / "metrics"
    exact, seeds = (json.loads((folder / f"{name}.json").read_text()) for name in ("exact", "seeds"))
    assert 0 < exact["success"] <= 1 and seeds["stack"] >= 1


def test_a_second_run_makes_nothing_anew(artifacts, outputs, tmp_path):
    def stamps():
        return {
            folder: folder.stat().st_ino
            for name in names
            for folder in map(artifacts.task.store.require, stage(name).artifacts(artifacts.task))
        }

    names = [name for name in artifacts.cfg.stages if name != "table"]
    before = stamps()
    run_stages(config(outputs, f"stages=[{','.join(names)}]"), tmp_path, "second")
    assert stamps() == before and len(before) > 40


def test_what_was_not_run_is_said(run, outputs, tmp_path):
    """With another schedule the single trainings are not there."""
    other = Task(
        config(outputs, "beyond.epoch=3", "beyond.steps=[4]", "scale.brief_epochs=3"), Store(outputs)
    )
    beyond.present(beyond.collect(other), tmp_path, Tracker(tmp_path, tmp_path, "", "", enabled=False))
    text = (tmp_path / "beyond.md").read_text(encoding="utf-8")
    for name in ("polish", "objectives", "transfer"):
        assert f"Not run for this page: stage `{name}` makes it." in text
        assert not (tmp_path / "beyond" / "tables" / f"{name}.csv").exists()


def test_the_page_needs_the_variant_that_it_is_about(tmp_path):
    task = Task(config(tmp_path, "gan=[vanilla]"), Store(tmp_path))
    with pytest.raises(ConfigError, match=r"beyond\.source is 'exact', expected one of gan: vanilla"):
        beyond.collect(task)


def test_a_page_without_its_sets_names_what_is_missing(tmp_path):
    artifacts = BeyondArtifacts(Task(config(tmp_path), Store(tmp_path)))
    with pytest.raises(ArtifactError, match="run stage best first"):
        _ = artifacts.pools


def test_sets_are_of_one_pool_alone_and_of_their_size(artifacts):
    task = artifacts.task
    assert set(artifacts.best.name) == {pool.name for pool in all_pools(task)}
    for pool in all_pools(task):
        made = pool.load(task)
        own = {"seeds": "gradient", OPTIMISED: OPTIMISED, POLISHED: POLISHED}
        assert set(made.source) == {own.get(pool.name, pool.name)}
        facts = task.frame(best_sets(task, pool), FACTS)
        assert set(facts["pick"]) == {GREEDY, OPTIMAL}


def test_the_determinants_pick_has_the_larger_determinant(artifacts):
    table = artifacts.best.pivot(index=["name", "training"], columns="pick", values="log_det")
    assert (table[OPTIMAL] >= table[GREEDY] - 1e-9).all()


def test_effort_of_a_motion_that_is_known(artifacts):
    task = artifacts.task
    c = task.load(seed_set(task)).coefficients[:3]
    energy, speed = effort(task.body, task.trajectory, c)
    double, faster = effort(task.body, task.trajectory, 1.5 * c)
    torch.testing.assert_close(faster, 1.5 * speed)
    assert (speed > 0).all() and (speed <= 1).all() and (double > energy).all()
    times = task.trajectory.times(2000.0)
    _, q, dq, ddq = task.trajectory.roll_out(c, times)
    power = (task.body.torque(q, dq, ddq) * dq).abs().sum(2)
    torch.testing.assert_close(torch.trapezoid(power, times, dim=1), energy, rtol=1e-3, atol=0)


def test_time_from_nothing_counts_what_a_variant_needs(artifacts):
    frame = artifacts.first_times.groupby("name").mean(numeric_only=True)
    assert frame.seeds["exact"] == 0 and frame.surrogates["exact"] == 0
    assert frame.seeds["exact_adversarial"] > 0 and frame.surrogates["exact_adversarial"] == 0
    assert frame.seeds["eigen"] > 0 and frame.surrogates["eigen"] > 0
    assert frame.cpu["exact"] > 0 and np.isnan(frame.cpu["eigen"])
    assert frame.total[SEEDS] == pytest.approx(frame.drawing[SEEDS])
    runs = artifacts.progress.groupby(["variant", "training"])
    assert len(runs) == 2 * len(artifacts.cfg.gan)
    for (name, _), part in runs:
        assert (part.seconds.diff().dropna() > 0).all()
        assert part.seconds.iloc[0] > frame.seeds[name] + frame.surrogates[name]


def test_goals_follow_from_the_numbers(artifacts, monkeypatch):
    def verdicts():
        return {goal.text: goal.met for goal in beyond_goals.goals_of(artifacts, "exact")}

    pools = artifacts.pools
    for share, met in ((1.0, True), (0.98, False)):
        monkeypatch.setitem(artifacts.__dict__, "pools", pools.assign(success=share))
        assert verdicts()["valid without filtering"] is met
    ours = pools.name == "exact"
    for rank, met in ((100.0, True), (1.0, False)):
        monkeypatch.setitem(artifacts.__dict__, "pools", pools.assign(rank=np.where(ours, rank, 50.0)))
        assert verdicts()["effective rank"] is met
    table = beyond_goals.table(beyond_goals.goals(artifacts))
    assert table["exact: verdict"]["effective rank"] == "**not met**"


def test_choices_follow_from_the_numbers(artifacts):
    measures = beyond_words.summary(artifacts)

    def choices(name, **values):
        return beyond_words.choices(artifacts, measures | {name: measures[name] | values})

    slow = {name: row | {"total": 100.0} for name, row in measures.items()}
    one = beyond_words.choices(artifacts, slow | {SEEDS: slow[SEEDS] | {"total": 1.0}})
    assert (one["quickest"], one["slower"], one["optimiser_is_quickest"]) == (SEEDS, 100.0, True)
    one = beyond_words.choices(artifacts, slow | {"vanilla": slow["vanilla"] | {"total": 1.0}})
    assert (one["quickest"], one["optimiser_is_quickest"]) == ("vanilla", False)
    assert "effective rank" in choices("vanilla", rank=1e6)["wins"]["vanilla"]
    assert "effective rank" not in choices("vanilla", rank=0.0)["wins"]["vanilla"]
    assert choices("exact", each=1e6)["worth"] is None and choices("exact", each=0.0)["worth"] > 0


CURVE = pd.DataFrame(
    {
        "start": ["random"] * 3 + ["exact"] * 2,
        "steps": [10, 20, 40, 0, 10],
        "seconds": [2.0, 4.0, 8.0, 0.1, 1.0],
        "condition": [800.0, 400.0, 100.0, 200.0, 100.0],
    }
)


@pytest.mark.parametrize(
    ("condition", "seconds"), [(400.0, 4.0), (200.0, 32**0.5), (100.0, 8.0), (50.0, 8.0), (1e4, 2.0)]
)
def test_the_optimiser_takes_as_long_as_it_needs_to_the_same_condition_number(condition, seconds):
    assert optimiser_seconds(CURVE, condition) == pytest.approx(seconds)
    assert np.isnan(optimiser_seconds(CURVE[CURVE.start == "exact"], condition))
    assert np.isnan(optimiser_seconds(pd.DataFrame(), condition))


def test_a_training_pays_where_one_more_is_cheaper():
    assert worth_from(100.0, 1.0, 3.0) == 50
    assert worth_from(100.0, 3.0, 3.0) == worth_from(100.0, 4.0, 3.0) == np.inf
    assert np.isnan(worth_from(100.0, 3.0, np.nan))


def test_break_even_is_at_equal_condition_number(artifacts, monkeypatch):
    times = pd.DataFrame(
        {"name": ["exact"] * 2, "each": [0.3, 0.5], "cpu": [90.0, 110.0], "training_seconds": [1.0, 1.0]}
    )
    monkeypatch.setitem(artifacts.__dict__, "polish", CURVE)
    monkeypatch.setitem(artifacts.__dict__, "first_times", times)
    even = break_even(artifacts)
    assert even.steps.tolist() == [0, 10] and even.condition.tolist() == [200.0, 100.0]
    assert even.ours.tolist() == pytest.approx([0.4, 1.3])  # a proof takes 0.3
    assert even.theirs.tolist() == pytest.approx([32**0.5, 8.0])
    assert even.more.tolist() == pytest.approx([100 / (32**0.5 - 0.4), 100 / 6.7])


def test_blurred_seeds_are_a_pool_like_any_other(artifacts):
    task = artifacts.task
    made = task.load(narrow(task))
    assert made.valid.all() and len(made) == task.cfg.library.count
    nearest = torch.cdist(*(x.coefficients.flatten(1) for x in (made, task.load(seed_set(task)))))
    apart = torch.cdist(*[task.load(seed_set(task)).coefficients.flatten(1)] * 2)
    assert 0 < nearest.amin(1).median() < 0.3 * apart.median()
    row = artifacts.first_times.set_index("name").loc[NARROW]
    assert row["each"] > 0 and row.total == pytest.approx(row.seeds + row.drawing) and row.seeds > 0
    assert "seeds, blurred" in beyond_tables.by_pool(artifacts.pools, "pools").index


def test_arrival_is_where_a_training_first_has_both():
    curve = pd.DataFrame(
        {
            "steps": [0, 25, 50, 75],
            "seconds": [0.0, 1.0, 2.0, 3.0],
            "success": [0.99, 0.9, 0.98, 0.99],
            "condition": [900.0, 100.0, 109.0, 90.0],
        }
    )
    assert arrival(curve, 100.0) == (50.0, 2.0)
    assert np.isnan(arrival(curve, 50.0)).all()


def test_a_payload_is_carried_at_the_tip(artifacts, tmp_path):
    task = artifacts.task
    target = task.cfg.beyond.targets["tool"]
    there = transfer.Elsewhere(task, target, tmp_path)
    before, after = (arm.inertial_parameters[:, 0].sum() for arm in (task.arm, there.arm))
    assert float(after - before) == pytest.approx(target.payload)
    zero = torch.zeros(1, 2, dtype=torch.float64)
    moved = torch.tensor([[0.4, 0.3]], dtype=torch.float64)
    lift = there.constraints.body.torque(moved, zero, zero) - task.body.torque(moved, zero, zero)
    step = 1e-6
    height = []
    for joint in range(2):  # the torque of a weight is the slope of its potential energy
        ends = [_tip_height(task.arm, moved + sign * step * torch.eye(2)[joint]) for sign in (1, -1)]
        height.append((ends[0] - ends[1]) / (2 * step) * target.payload)
    torch.testing.assert_close(lift[0], torch.stack(height), atol=1e-6, rtol=1e-6)


def test_elsewhere_as_much_is_kept_clear_as_its_home_has_room_for(artifacts, tmp_path):
    task = artifacts.task
    near = replace(task.cfg.workspace, clearance=None, regions=[Region(sphere=Sphere((0.162, 0, 0.85), 0.1))])
    there = transfer.Elsewhere(
        task.with_settings(workspace=near),
        replace(task.cfg.beyond.targets["tool"], home=[0.0, 0.0]),
        tmp_path,
    )
    assert (there.constraints.clearance, there.constraints.apart) == (0.01, 0.0)


def _tip_height(arm, q):
    """Work against gravity per mass of the tip [m²/s²]."""
    place = arm.tip
    for joint in reversed(range(2)):
        angle, axis = q[0, joint], arm.axis[joint]
        skew = torch.linalg.cross(axis.expand(3, 3), torch.eye(3, dtype=torch.float64), dim=1).T
        place = torch.linalg.matrix_exp(angle * -skew.T) @ place
        place = arm.rotation[joint] @ place + arm.translation[joint]
    return -(arm.gravity @ place)


def test_the_panda_sized_arm_rests_at_its_home_and_can_be_excited():
    cfg = validate(composed("+experiment=beyond", "robot=kuka_lwr4", "workspace=desk"))
    task = Task(cfg, Store.__new__(Store))
    there = transfer.Elsewhere(task, cfg.beyond.targets["another_arm"], None)
    assert there.arm.joints == 7 and there.constraints.body.parameters_count >= 40
    assert there.trajectory.home == tuple(cfg.beyond.targets["another_arm"].home)


def test_a_transfer_starts_where_the_source_ended(artifacts):
    frame = artifacts.transfers
    assert set(frame.way) == set(transfer.WAYS)
    begun = frame[frame.way == transfer.TRANSFER].iloc[0]
    assert begun.steps == 0 and 0 <= begun.success <= 1
    assert (frame[frame.way != transfer.TRANSFER].steps > 0).all()
    table = beyond_tables.transfers(frame)
    assert list(table["way"]) == list(transfer.WAYS) and list(table.index) == ["a tool"] * 3


def test_objectives_and_few_seeds_are_single_trainings(artifacts):
    assert set(artifacts.objectives.name) == {"exact_brief", "exact_set"}
    sizes = artifacts.few.groupby("variant").seeds.apply(set).to_dict()
    assert sizes["exact_adversarial_brief"] == {10, 40} and sizes["eigen"] == {40}


def test_libraries_of_objectives_are_valid(artifacts):
    task = with_objectives(artifacts.task)
    assert task.load(library(task, "exact_set", 0)).valid.all()


def test_polishing_costs_what_it_takes_and_excites_more(artifacts):
    task = artifacts.task
    for training in task.cfg.trainings:
        report = task.report(polished(task, training))
        assert (
            report["count"] == task.cfg.seeds.count and artifacts.costs(polished(task, training))["each"] > 0
        )
        assert report["condition"] < task.report(library(task, "exact", training))["condition"]
