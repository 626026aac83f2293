"""Labels of samples, surrogates that learn from them, and that go on learning during a training."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from sidegan.base.arrays import flatten
from sidegan.design.excitation import measure_excitation
from sidegan.errors import ArtifactError
from sidegan.gan.pretraining import Labelled, Pretraining, label, load_surrogates, scaled_margins
from sidegan.gan.settings import Reward
from sidegan.gan.tensors import numpy_array
from sidegan.gan.training import Refreshed
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, Plane, check
from tests.gan.conftest import REFRESH, STEPS, normal
from tests.refusals import refused
from tests.tiny import tiny


def test_margins_are_the_constraints_in_shares_of_their_limits(arm):
    constraints, steps = Constraints(arm, [Plane((0, 0, 1), 0.1)]), 9
    family = Trajectory(7, 3, 12.0)
    c = numpy_array(normal(family, 0, 0.7, 4))
    found = scaled_margins(constraints, family, c, steps)
    assert found.shape == (4, len(constraints.labels), steps) and found.dtype == np.float32
    motion = family.roll_out(c, family.grid(steps))
    scales = {
        "position": (arm.position_upper - arm.position_lower) / 2,
        "velocity": arm.velocity_limit,
        "torque": arm.torque_limit,
    }
    exact = constraints.margins(*(x.reshape(-1, 7) for x in motion[1:]))
    for g, name in enumerate(constraints.labels):
        worst = (exact[name] / scales.get(name, 0.1)).min(1).clip(-1, 1)
        np.testing.assert_allclose(found[:, g].ravel(), worst, rtol=0, atol=1e-5)


def test_half_of_the_samples_are_rescaled_seeds(constraints, family, seeds, wild):
    settings = replace(tiny().surrogates, samples=8 * 403, margin_steps=STEPS)
    c, again = (
        Pretraining(constraints, family, settings, seeds, wild).label(0, lambda *_: None).c for _ in range(2)
    )
    assert np.array_equal(c, again) and len(c) == 403 and np.isfinite(c).all()
    rows, known = flatten(c[:201], 1), flatten(seeds, 1)
    sizes, own = (np.linalg.norm(x, axis=1) for x in (rows, known))
    cosine = (rows @ known.T) / sizes[:, None] / own
    np.testing.assert_allclose(cosine.max(1), 1, rtol=1e-5)
    size = sizes / own[cosine.argmax(1)]
    assert 0.8 <= size.min() * (1 + 1e-6) < 0.84 and 1.16 < size.max() <= 1.2 * (1 + 1e-6)


def test_labels_equal_the_exact_values(constraints, family, seeds, wild):
    c = np.concatenate([seeds[:150], wild[:150]])  # more than one batch
    made = label(constraints, family, c, STEPS, lambda *_: None)
    np.testing.assert_allclose(made.valid, check(constraints, family, c).valid)
    excitation = measure_excitation(constraints.body, family, c)
    np.testing.assert_allclose(made.spectrum, excitation.spectrum)
    np.testing.assert_allclose(made.diagonal, excitation.diagonal)
    np.testing.assert_allclose(made.margins, scaled_margins(constraints, family, c, STEPS))
    assert made.energies.shape == (300, 0)
    logs = label(constraints, family, c, STEPS, lambda *_: None, lambda x: flatten(x, 1)).energies
    np.testing.assert_allclose(logs, flatten(c, 1))
    seen = made.margins.min((1, 2)) < -1e-6
    assert seen.any() and not made.valid[seen].any()


def test_surrogates_learn_validity_and_features(pretrained):
    _, report, last = pretrained
    assert last == (440, 440)  # 40 epochs of 1020 samples
    assert report["accuracy_broad"] > 0.9 and report["accuracy_paper"] > 0.9
    assert report["r2_diagonal"] > 0.8 and report["r2_energies"] > 0.8


@pytest.mark.parametrize("kind", ["Diagonal", "Predicting"])
def test_trained_surrogates_load_frozen_and_identical(pretrained, planar, family, seeds, full, kind):
    reward = Reward() if kind == "Predicting" else None
    variant = replace(full, _target_=f"sidegan.gan.variants.{kind}", reward=reward)
    c = torch.tensor(seeds[:5]).float()
    loaded, again = (load_surrogates(pretrained[0], variant, planar, family) for _ in range(2))
    for network, twin in zip(loaded, again):
        assert not any(p.requires_grad for p in network.parameters()) and not network.training
        torch.testing.assert_close(network(c), twin(c))
        assert torch.isfinite(network(c)).all()


def test_surrogates_of_another_arm_and_missing_ones_are_refused(
    pretrained, arm, planar, family, full, tmp_path
):
    with refused(ArtifactError, str(pretrained[0] / "success.pt"), "arm"):
        load_surrogates(pretrained[0], full, arm, Trajectory(7, 3))
    with refused(ArtifactError, str(tmp_path / "success.pt")):
        load_surrogates(tmp_path, full, planar, family)


def test_refreshed_surrogates_learn_what_the_generator_makes(made, full, taught):
    """Also where it makes what they have never seen."""
    model = made(full)
    with torch.no_grad():
        model.generator.scaling.spread *= 3  # most of it violates something
    predictor, converter = model.success_predictor, model.converter
    data, c = taught, model.generator.sample(400, 5)
    truth = label(data.constraints, data.trajectory, c, STEPS, lambda *_: None)
    assert truth.valid.mean() < 0.9
    truth = Labelled(*map(torch.tensor, truth))

    def known():
        wrong = predictor.loss(truth.c, truth.margins, truth.valid)
        return float(wrong.detach()), float(converter.explained(truth.c, truth.diagonal).mean())

    before = known()
    refreshed = Refreshed(replace(REFRESH, samples=400, steps=60), 0)
    refreshed.on_train_start(SimpleNamespace(), model)
    for _ in range(3):
        refreshed.on_train_epoch_start(SimpleNamespace(), model)
    after = known()
    assert after[0] < 0.9 * before[0] and after[1] > before[1] + 0.1, (before, after)
    assert len(refreshed.window) == 2 and len(refreshed.window[0].c) == 400
    assert not any(p.requires_grad for p in (*predictor.parameters(), *converter.parameters()))
