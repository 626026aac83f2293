from dataclasses import replace

import numpy as np
import torch

from sidegan.identification import estimate
from sidegan.identification.consistent import Consistent
from sidegan.identification.prior import scales
from sidegan.robot import pseudo_inertia
from tests.identification.recordings import model_of, recorded, truth_of


def least_eigenvalues(links, arm):
    """Of pseudo-inertias in units of each link's typical mass and length, (J,)."""
    mass, length = scales(arm)
    unit = mass.sqrt()[:, None] * torch.stack([length, length, length, torch.ones_like(length)], 1)
    return torch.linalg.eigvalsh(pseudo_inertia(links) / unit[:, None] / unit[:, :, None])[:, 0]


class TestFit:
    def test_every_link_can_exist_however_short_and_noisy_the_recording_is(self, arm):
        model = model_of(arm)
        found = estimate("consistent", model, recorded(model, 150, noise=3.0))
        assert (least_eigenvalues(model.links_of(found.standard), arm) > 0.9e-4).all()
        for name in ("rotor_inertia", "viscous", "coulomb"):
            assert (found.standard[model.standard_slice(name)] > -1e-6).all()
        torch.testing.assert_close(model.mapping @ found.standard, found.parameters)

    def test_a_tool_that_the_description_lacks_is_found_without_freeing_the_other_links(self, arm):
        links = arm.inertial_parameters.clone()
        links[-1] += torch.tensor([1.3, 0, 0, 0.104, 0.0113, 0, 0.0113, 0, 0, 0.002], dtype=torch.float64)
        other, model = model_of(replace(arm, inertial_parameters=links)), model_of(arm)
        data, truth = recorded(other, 600, noise=0.05), truth_of(other)
        plain = estimate("weighted", model, data)
        _, pull = Consistent().standard(model, *plain.sums.weighted(plain.weights))
        assert float(pull.strength[-1]) < 0.1 < 1.5 < float(pull.strength[1:-1].min())
        worst = {}
        for setting in (None, 1.0):
            found = estimate("consistent", model, data, strength=setting)
            worst[setting] = float(((found.parameters - truth) / found.deviation).abs().max())
        assert worst[None] < 4 < worst[1.0]

    def test_intervals_hold_the_truth_and_know_of_the_description(self, arm):
        model, shares, ratios = model_of(arm), [], []
        for seed in range(3):
            random = np.random.default_rng(seed)
            factors = torch.from_numpy(random.uniform(0.7, 1.3, (7, 1)))
            other = model_of(replace(arm, inertial_parameters=factors * arm.inertial_parameters))
            data = recorded(other, 400, noise=0.3, seed=seed)
            found, plain = estimate("consistent", model, data), estimate("weighted", model, data)
            error = (found.parameters - truth_of(other)).abs()
            shares.append((error < 1.96 * found.deviation).double().mean())
            ratios.append(found.deviation / plain.deviation)
        assert 0.9 < float(torch.stack(shares).mean()) < 1
        ratio = torch.cat(ratios)
        assert float(ratio.max()) < 1.1 and float((ratio < 0.5).double().mean()) > 0.1

    def test_misfit_and_pull_balance_at_the_best_point(self, planar):
        """Where no bound is active the two gradients cancel, each with the weight that the objective has."""
        model = model_of(planar, rotor_inertia=False, viscous=False, coulomb=False, offset=False)
        plain, strength = estimate("weighted", model, recorded(model, 200, noise=1.0)), 2.0
        information, moment = plain.sums.weighted(plain.weights)
        standard = Consistent(strength=strength).standard(model, information, moment)[0].requires_grad_(True)
        links = standard.reshape(-1, 10)
        assert (least_eigenvalues(links.detach(), planar) > 2e-4).all(), "a bound is active"
        x, first = model.mapping @ standard, pseudo_inertia(planar.inertial_parameters)
        now = pseudo_inertia(links)
        misfit = 0.5 * x @ information @ x - moment @ x
        traces = torch.linalg.solve(first, now).diagonal(dim1=1, dim2=2).sum()
        pull = strength * (traces - torch.logdet(now).sum())
        scale = standard.detach().abs()
        slopes = [scale * torch.autograd.grad(x, standard, retain_graph=True)[0] for x in (misfit, pull)]
        assert (slopes[0] + slopes[1]).norm() < 0.02 * slopes[0].norm()
