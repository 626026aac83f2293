"""Generators and surrogates: what a training follows from, and what it leaves alone."""

import shutil
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest
import torch

import sidegan as sg
from sidegan.errors import ArtifactError, SideganError, StorageError
from sidegan.gan.settings import variant_recipe
from tests.refusals import refused
from tests.steps.conftest import FREE

GENERATOR = {"width": 16, "noise": 8, "batch": 20, "corrections": 1}
SMALL = {"epochs": 2, "steps": 2, "generator": GENERATOR}


VANILLA = {"_target_": "sidegan.gan.variants.Vanilla", "weights": {"adversarial": 1}, **SMALL}
NETWORKS = {"width": 16, "margin_steps": 8, "feature_steps": 8, "samples": 200, "epochs": 2}
NETWORKS |= {"negatives": {"vanilla": VANILLA}, "workers": 1}


@pytest.fixture(scope="module")
def surrogates(cell, seeds, tmp_path_factory):
    """Folder of small surrogates, and what ``surrogates`` reports of them."""
    folder = tmp_path_factory.mktemp("surrogates")
    return folder, sg.surrogates(cell, seeds, folder, **NETWORKS)


@pytest.fixture(scope="module")
def generator(cell, seeds, surrogates):
    return sg.train("eigen", cell, seeds=seeds, surrogates=surrogates[0], **SMALL)


def test_surrogates_report_their_accuracies(surrogates):
    accepted = {f"accepted{size}" for size in ("", "_25", "_50", "_75")}
    explained = {f"r2_{name}" for name in ("spectrum", "diagonal", "energies")}
    assert surrogates[1].keys() == {"accuracy_paper", "accuracy_broad", "rejected", *accepted, *explained}


def test_surrogates_of_another_cell_are_refused(seeds, surrogates):
    other = sg.Cell("planar2", period=8, home=[0.1, 0], **FREE)
    with refused(ArtifactError, str(surrogates[0]), "trajectory"):
        sg.train("eigen", other, seeds.coefficients, surrogates=surrogates[0], **SMALL)


def test_surrogates_count_only_once_all_are_there(cell, seeds, surrogates, tmp_path, monkeypatch):
    def interrupted(self, name, *_):
        if name == "energies":
            raise KeyboardInterrupt

    folder = shutil.copytree(surrogates[0], tmp_path / "again")
    monkeypatch.setattr("sidegan.gan.pretraining.Pretraining.train_features", interrupted)
    with pytest.raises(KeyboardInterrupt):
        sg.surrogates(cell, seeds, folder, **NETWORKS)
    with refused(ArtifactError, str(folder)):
        sg.train("eigen", cell, seeds, surrogates=folder, **SMALL)


def test_a_generator_reloads_and_samples_by_its_seed(cell, generator, tmp_path):
    made = generator.sample(20)
    assert made.shape == (20, 2, 3, 2) and len(generator.history) == 2
    generator.save(tmp_path / "eigen.pt")
    again = sg.Generator.load(tmp_path / "eigen.pt", cell)
    assert np.array_equal(again.sample(20, np.int64(0)), made)
    assert not np.array_equal(again.sample(20, seed=1), made)
    with refused(ArtifactError, "eigen.pt", "period=8", "period=4"):
        sg.Generator.load(tmp_path / "eigen.pt", sg.Cell("planar2", period=4, **FREE))


@pytest.mark.parametrize("arguments", [(2, "a"), (2, -1), (True,)])
def test_samples_without_a_seed_or_count_are_refused(generator, arguments):
    with refused(SideganError, f"{arguments[-1]}"):
        generator.sample(*arguments)


def test_a_generator_is_not_written_over_a_folder(generator, tmp_path):
    with refused(StorageError, str(tmp_path)):
        generator.save(tmp_path)


def test_one_weight_can_be_changed_alone(cell, seeds, surrogates, generator):
    def history(weights):
        return sg.train("eigen", cell, seeds, surrogates=surrogates[0], weights=weights, **SMALL).history

    less = history({"rank": 0})
    assert less.equals(history(replace(variant_recipe("eigen").weights, rank=0.0)))
    assert not less.equals(generator.history)


def test_a_training_leaves_random_numbers_alone(cell, seeds):
    before = torch.get_rng_state(), np.random.get_state()[1].copy()
    sg.train("vanilla", cell, seeds, **SMALL)
    assert torch.equal(before[0], torch.get_rng_state()) and (before[1] == np.random.get_state()[1]).all()


def test_a_training_does_not_depend_on_what_torch_is_set_to_or_on_other_threads(cell, seeds):
    def made():
        larger = SMALL | {"generator": GENERATOR | {"width": 128, "batch": 60}}
        return sg.train("vanilla", cell, seeds, **larger).network.state_dict()

    def same(other):
        return all(torch.equal(x, other[name]) for name, x in first.items())

    first = made()
    with ThreadPoolExecutor(2) as threads:
        assert all(map(same, threads.map(lambda _: made(), range(2))))
    before = torch.get_num_threads()
    try:
        torch.set_num_threads(2 if before == 1 else 1)
        torch.set_default_dtype(torch.float64)
        with torch.inference_mode():
            assert same(made())
        assert torch.get_num_threads() != before and torch.get_default_dtype() == torch.float64
    finally:
        torch.set_num_threads(before)
        torch.set_default_dtype(torch.float32)


def test_a_training_shows_its_epochs_and_resumes_in_its_folder(cell, seeds, tmp_path, monkeypatch):
    def made(**options):
        return sg.train("vanilla", cell, seeds, **SMALL | {"epochs": 3} | options).history

    def show(done):
        ends.append(done)
        if len(ends) == 2:
            raise KeyboardInterrupt

    whole, ends = made(), []
    monkeypatch.setattr("sidegan.steps.train.bar", lambda *_: nullcontext(show))
    with pytest.raises(KeyboardInterrupt):
        made(folder=tmp_path)
    assert made(folder=tmp_path).equals(whole) and ends == [1, 2, 2, 3]  # the second had not been saved
    assert made(folder=tmp_path).equals(whole) and len(ends) == 4 and len([*tmp_path.iterdir()]) == 1
    for other in ({"seed": 1}, {"generator": GENERATOR | {"batch": 30}}, {"box": np.float32(30)}):
        assert not made(folder=tmp_path, **other).equals(whole)
