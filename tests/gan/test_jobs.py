import io
from dataclasses import replace

import pytest
import torch

from sidegan.errors import ArtifactError
from sidegan.gan import jobs
from sidegan.gan.shallow import ShallowConverter, ShallowPredictor
from sidegan.motion.trajectory import Trajectory
from tests.tiny import tiny


@pytest.fixture(scope="module")
def pretraining(constraints, family, seeds, wild, tmp_path_factory):
    """Small surrogates, with their labelled samples."""
    sizes = {"samples": 160, "epochs": 2, "width": 16, "margin_steps": 8, "feature_steps": 8}
    settings, work = replace(tiny().surrogates, **sizes), tmp_path_factory.mktemp("work")
    negatives = torch.cat([wild, wild, wild])
    made = jobs.Pretraining(constraints, family, settings, "broad", seeds, negatives, work)
    for i in range(jobs.SHARES):
        made.label(i, i, ignore)
    return made


@pytest.fixture(scope="module")
def reports(pretraining):
    """What the trainings tell, whose surrogates are left in the folder of the samples."""
    report = pretraining.train_success(pretraining.work, 0, ignore)
    for features in ("spectrum", "diagonal"):
        report |= pretraining.train_features(features, pretraining.work, 0, ignore)
    return report


def ignore(done, total):
    pass


def test_a_share_is_made_once_and_again_when_damaged(pretraining):
    path = pretraining.work / "labels-0.pt"
    whole, calls = path.read_bytes(), []
    pretraining.label(0, 0, lambda *x: calls.append(x))
    assert not calls
    path.write_bytes(whole[:100])
    pretraining.label(0, 0, lambda *x: calls.append(x))
    assert calls
    before, after = torch.load(io.BytesIO(whole)), torch.load(path)
    torch.testing.assert_close(after, before)


def test_seeds_are_held_out(seeds):
    training, held = jobs.training_seeds(seeds)
    torch.testing.assert_close(torch.cat([training, held]), seeds)
    assert 0.1 < len(held) / len(seeds) < 0.2
    assert [len(x) for x in jobs.training_seeds(seeds[:2])] == [1, 1]


def test_the_surrogates_are_measured_on_what_was_held_out(reports):
    assert all(0 <= reports[name] <= 1 for name in ("accuracy_paper", "accuracy_broad"))
    assert reports["near_samples"] >= 0


@pytest.mark.parametrize("features", ["spectrum", "diagonal"])
def test_trained_surrogates_are_loaded_as_they_were(
    pretraining, reports, arm, planar, family, seeds, features
):
    folders, c = {"predictor": pretraining.work, "converter": pretraining.work}, seeds[:5].float()
    surrogates, again = (jobs.load_surrogates(folders, features, planar, family) for _ in range(2))
    for network, twin in ((surrogates.predictor, again.predictor), (surrogates.converter, again.converter)):
        assert not any(p.requires_grad for p in network.parameters()) and not network.training
        torch.testing.assert_close(network(c), twin(c))
        assert torch.isfinite(network(c)).all()
    r2, mean = reports[f"r2_{features}"], surrogates.converter.mean
    assert len(r2) == len(mean)
    assert reports[f"r2_{features}_mean"] == pytest.approx(sum(r2) / len(r2), rel=1e-5)
    files = [pretraining.work / f"labels-{i}.pt" for i in range(jobs.SHARES)]
    truth = torch.cat([torch.load(path)[features] for path in files]).log()
    assert (mean.double() - truth.mean(0)).abs().max() < 3 * truth.std(0).max()
    with pytest.raises(ArtifactError, match="does not fit this arm"):
        jobs.load_surrogates(folders, features, arm, Trajectory(7, 3, 8.0))


def test_only_what_is_asked_for_is_loaded(pretraining, reports, planar, family):
    only = jobs.load_surrogates({"predictor": pretraining.work}, "none", planar, family)
    assert only.predictor is not None and only.converter is None
    assert jobs.load_surrogates({}, "none", planar, family) == jobs.Surrogates()


def test_a_missing_surrogate_is_named(pretraining, reports, planar, family, tmp_path):
    with pytest.raises(ArtifactError, match=r"there is no file .*success\.pt"):
        jobs.load_surrogates({"predictor": tmp_path}, "none", planar, family)
    folders = {"predictor": pretraining.work, "converter": tmp_path}
    with pytest.raises(ArtifactError, match=r"there is no file .*spectrum\.pt"):
        jobs.load_surrogates(folders, "spectrum", planar, family)


@pytest.fixture(scope="module")
def papers(constraints, family, seeds, wild, tmp_path_factory):
    """The paper's surrogates, their labelled samples, and what their trainings tell."""
    shallow = replace(tiny().surrogates.shallow, epochs=3, width=8)
    settings, work = replace(tiny().surrogates, shallow=shallow), tmp_path_factory.mktemp("paper")
    count = jobs.negatives_count("paper", settings.samples, len(seeds))
    negatives = wild.repeat(-(-count // len(wild)), 1, 1, 1)[:count]
    made = jobs.Pretraining(constraints, family, settings, "paper", seeds, negatives, work)
    for i in range(jobs.SHARES):
        made.label(i, i, ignore)
    return made, made.train_success(work, 0, ignore) | made.train_features("diagonal", work, 0, ignore)


def test_the_papers_surrogates_learn_from_the_seeds_and_as_many_others(papers, seeds):
    made, _ = papers
    c = torch.cat([torch.load(made.work / f"labels-{i}.pt")["c"] for i in range(jobs.SHARES)])
    learnt, held = (x.float().flatten(1) for x in jobs.training_seeds(seeds))
    rows = {tuple(row) for row in c.flatten(1).tolist()}
    assert {tuple(row) for row in learnt.tolist()} <= rows
    assert not {tuple(row) for row in held.tolist()} & rows
    assert len(c) == made.samples == 2 * len(learnt)


def test_the_papers_surrogates_are_shallow_and_loaded_as_they_were(papers, planar, family, seeds):
    made, report = papers
    folders = {"predictor": made.work, "converter": made.work}
    surrogates = jobs.load_surrogates(folders, "diagonal", planar, family)
    assert isinstance(surrogates.predictor, ShallowPredictor)
    assert isinstance(surrogates.converter, ShallowConverter)
    assert surrogates.converter.floor > 1e-12  # of the samples, not the smallest there is
    scale = jobs.training_seeds(seeds)[0].abs().amax(0).float()
    torch.testing.assert_close(surrogates.predictor.layers.scale, scale)
    assert 0 <= report["accuracy_paper"] <= 1 and len(report["r2_diagonal"]) == len(surrogates.converter.mean)
