import numpy as np
import pytest
import torch

from sidegan.identification.model import formula, states_within
from sidegan.identification.prior import belief, information, typical
from sidegan.robot import load_robot
from tests.chains import random_chain
from tests.identification.recordings import model_of, multisine, white


@pytest.fixture(scope="module", params=["kuka_lwr4", "planar2", (4, 1), (5, 3), (3, 2)], ids=str)
def model(request):
    """A model with every term, of a built-in arm or of a random chain."""
    built_in = isinstance(request.param, str)
    one = load_robot(request.param) if built_in else random_chain(*request.param)[0]
    return model_of(one, [0.2] * one.joints)


class TestRegressor:
    def test_gives_the_torque_of_all_standard_parameters(self, model):
        q, dq, ddq = states_within(model.arm, 40, seed=5)
        full = white(model.mapping.shape[1:], 0)
        sign = torch.tanh(dq / 0.01)
        signals = [ddq, dq, sign, torch.ones_like(dq), sign * torch.exp(-((dq / 0.2) ** 2))]
        terms = full[10 * model.joints :].reshape(5, model.joints)
        expected = model.body.regressor(q, dq, ddq) @ full[: 10 * model.joints]
        expected = expected + sum(x * term for x, term in zip(signals, terms))
        found = model.torque(model.mapping @ full, q, dq, ddq)
        assert (found - expected).abs().max() < 1e-9 * expected.abs().max()

    def test_columns_are_independent_and_rigid_ones_come_first(self, model):
        states = states_within(model.arm, 60 * model.joints, seed=9)
        y = model.regressor(*states)
        torch.testing.assert_close(y[..., : model.rigid], model.body.base_regressor(*states))
        rows = y.reshape(-1, model.count)
        assert torch.linalg.matrix_rank(rows / rows.norm(dim=0), rtol=1e-9) == model.count
        assert tuple(model.names[: model.rigid]) == model.body.base.names

    def test_friction_follows_the_sign_where_one_is_given(self, planar):
        model = model_of(planar)
        q, dq, ddq = multisine(2, 30)
        y = model.regressor(q, dq, ddq, 0.5 * torch.ones_like(q))
        assert (y[:, 1, model.names.index("fc2")] == 0.5).all()
        followed = model.regressor(q, dq, ddq, torch.tanh(dq / 0.01))
        torch.testing.assert_close(followed, model.regressor(q, dq, ddq))


class TestGroupings:
    def test_the_first_rotor_acts_like_the_first_link(self, arm):
        model = model_of(arm)
        assert "Ia1" not in model.names
        assert model.formulas[model.names.index("Izz1")].endswith("Ia1")
        assert [n for n in model.names if n.startswith("Ia")] == [f"Ia{i}" for i in range(3, 8)]

    def test_formulas_add_up_to_the_parameters(self, arm):
        model = model_of(arm, [0.1] * 7)
        full = torch.from_numpy(np.random.default_rng(1).uniform(1, 2, len(model.standard_names)))
        values = dict(zip(model.standard_names, full.tolist()))
        for own, text, expected in zip(model.names, model.formulas, (model.mapping @ full).tolist()):
            assert own in text.split()
            words = text.replace("- ", "-").replace("+ ", "").split()
            total, factor = 0.0, 1.0
            for word in words:
                name = word.lstrip("-")
                if name in values:
                    total += (-1 if word.startswith("-") else 1) * factor * values[name]
                    factor = 1.0
                else:
                    factor = float(word)
            assert total == pytest.approx(expected, rel=1e-3)

    def test_reads_as_people_write(self):
        shares = torch.tensor([0.0, -1.0, 0.0780001, 1.0], dtype=torch.float64)
        assert formula(shares, ["a", "b", "m7", "m6"]) == "m6 - b + 0.078 m7"

    def test_the_nominal_parameters_are_those_of_the_description(self, arm):
        model = model_of(arm)
        torch.testing.assert_close(model.nominal[: model.rigid], model.body.base.values)
        assert not model.nominal[model.rigid :].any()


@pytest.mark.parametrize("relative", [0.1, 0.5])
def test_information_is_that_of_links_drawn_about_their_typical_size(arm, relative):
    model, generator = model_of(arm), torch.Generator().manual_seed(0)
    sizes = typical(arm).reshape(-1)
    draws = torch.randn(20_000, len(sizes), generator=generator, dtype=torch.float64)
    drawn = relative * draws * sizes @ model.body.base.mapping.T
    told = information(model, relative)
    assert not told[model.rigid :].any() and not told[:, model.rigid :].any()
    whitened = drawn @ torch.linalg.cholesky(told[: model.rigid, : model.rigid])
    one = torch.eye(model.rigid, dtype=torch.float64)
    torch.testing.assert_close(whitened.T @ whitened / len(draws), one, rtol=0, atol=0.06)


def test_terms_are_believed_to_be_a_share_of_their_joints_torque(planar):
    model, scale = model_of(planar), torch.tensor([20.0, 5.0], dtype=torch.float64)
    told = belief(model, scale, 0.25)
    deviation = told.diagonal()[model.rigid :].rsqrt()
    terms = dict(zip(model.names[model.rigid :], deviation.tolist()))
    assert set(terms.values()) == {5.0, 1.25}
    assert all(value == (5.0 if name.endswith("1") else 1.25) for name, value in terms.items())
    assert torch.equal(told[: model.rigid], information(model, 0.25)[: model.rigid])
