from dataclasses import replace

import numpy as np

from sidegan.identification import estimate
from sidegan.identification.consistent import fit_with_pull
from sidegan.identification.model import scales
from sidegan.robot import pseudo_inertia
from tests.identification.recordings import model_of, recorded, truth_of


def least_eigenvalues(links, arm):
    """Least eigenvalue of each link's pseudo-inertia in units of its typical mass and length, (J,)."""
    mass, length = scales(arm)
    unit = np.sqrt(mass)[:, None] * np.stack([length, length, length, np.ones_like(length)], 1)
    return np.linalg.eigvalsh(pseudo_inertia(links) / unit[:, None] / unit[:, :, None])[:, 0]


class TestFit:
    def test_every_link_is_physical_despite_short_and_noisy_data(self, arm, model):
        found = estimate("consistent", model, recorded(model, 150, noise=3.0))
        assert (least_eigenvalues(model.links_of(found.standard), arm) > 0.9e-4).all()
        for name in ("rotor_inertia", "viscous", "coulomb"):
            assert (found.standard[model.standard_slice(name)] > -1e-6).all()
        np.testing.assert_allclose(model.mapping @ found.standard, found.parameters)

    def test_an_undescribed_tool_is_found_with_the_other_links_regularised(self, arm, model):
        links = arm.inertial_parameters.copy()
        links[-1] += [1.3, 0, 0, 0.104, 0.0113, 0, 0.0113, 0, 0, 0.002]
        other = model_of(replace(arm, inertial_parameters=links))
        data, truth = recorded(other, 600, noise=0.05), truth_of(other)
        plain = estimate("weighted", model, data)
        _, pull = fit_with_pull(model, *plain.sums.weighted(plain.weights))
        assert float(pull.strength[-1]) < 0.1 < 1.5 < float(pull.strength[1:-1].min())
        worst = {}
        for setting in (None, 1.0):
            found = estimate("consistent", model, data, strength=setting)
            worst[setting] = float(np.abs((found.parameters - truth) / found.deviation).max())
        assert worst[None] < 4 < worst[1.0]

    def test_confidence_intervals_contain_the_truth_and_use_the_description(self, arm, model):
        shares, ratios = [], []
        for seed in range(3):
            random = np.random.default_rng(seed)
            factors = random.uniform(0.7, 1.3, (arm.joints, 1))
            other = model_of(replace(arm, inertial_parameters=factors * arm.inertial_parameters))
            data = recorded(other, 400, noise=0.3, seed=seed)
            found, plain = estimate("consistent", model, data), estimate("weighted", model, data)
            error = np.abs(found.parameters - truth_of(other))
            shares.append((error < 1.96 * found.deviation).mean())
            ratios.append(found.deviation / plain.deviation)
        assert 0.9 < np.mean(shares) < 1
        ratio = np.concatenate(ratios)
        assert float(ratio.max()) < 1.1 and (ratio < 0.5).mean() > 0.1

    def test_gradients_of_misfit_and_regularisation_balance_at_the_optimum(self, planar):
        """Where no bound is active the two gradients cancel, each with the weight that the objective has."""
        model = model_of(planar, rotor_inertia=False, viscous=False, coulomb=False, offset=False)
        plain, strength = estimate("weighted", model, recorded(model, 200, noise=1.0)), 2.0
        information, moment = plain.sums.weighted(plain.weights)
        standard, _ = fit_with_pull(model, information, moment, strength)
        links = standard.reshape(-1, 10)
        assert (least_eigenvalues(links, planar) > 2e-4).all(), "a bound is active"
        misfit = model.mapping.T @ (information @ model.mapping @ standard - moment)
        # the regularisation's gradient: that of tr(P₀⁻¹ P) − log det P along each parameter of each link
        inverses = np.linalg.inv(pseudo_inertia(np.stack([planar.inertial_parameters, links])))
        pull = strength * np.einsum("jxy,kyx->jk", inverses[0] - inverses[1], pseudo_inertia(np.eye(10)))
        misfit, pull = np.abs(standard) * [misfit, pull.ravel()]  # per relative change of a parameter
        assert np.linalg.norm(misfit + pull) < 0.02 * np.linalg.norm(misfit)
