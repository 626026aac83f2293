import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.linalg import expm

from sidegan.identification.goals import belief
from sidegan.identification.model import states_within, typical
from sidegan.robot import load_robot
from tests.chains import random_chain
from tests.identification.recordings import assert_close, model_of, multisine, white


@pytest.fixture(scope="module", params=["kuka_lwr4", "planar2", (4, 1), (5, 3), (3, 2)], ids=str)
def model(request):
    """A model with every term, of a built-in arm or of a random chain."""
    built_in = isinstance(request.param, str)
    return model_of(load_robot(request.param) if built_in else random_chain(*request.param)[0])


class TestRegressor:
    def test_gives_the_torque_of_the_standard_parameters(self, model):
        q, dq, ddq = states_within(model.arm, 40, seed=5)
        full = white(model.mapping.shape[1:], 0)
        signals = [ddq, dq, np.tanh(dq / 0.01), np.ones_like(dq)]
        terms = full[10 * model.joints :].reshape(4, model.joints)
        expected = model.body.regressor(q, dq, ddq) @ full[: 10 * model.joints]
        expected = expected + sum(x * term for x, term in zip(signals, terms))
        found = model.torque(model.mapping @ full, q, dq, ddq)
        assert np.abs(found - expected).max() < 1e-9 * np.abs(expected).max()

    def test_columns_are_independent_and_rigid_ones_come_first(self, model):
        states = states_within(model.arm, 60 * model.joints, seed=9)
        y = model.regressor(*states)
        np.testing.assert_allclose(y[..., : model.rigid], model.body.base_regressor(*states))
        rows = y.reshape(-1, model.count)
        assert np.linalg.matrix_rank(rows / np.linalg.norm(rows, axis=0), rtol=1e-9) == model.count
        assert tuple(model.names[: model.rigid]) == model.body.base.names

    def test_friction_follows_the_sign_where_one_is_given(self, planar):
        model = model_of(planar)
        q, dq, ddq = multisine(2, 30)
        y = model.regressor(q, dq, ddq, 0.5 * np.ones_like(q))
        assert (y[:, 1, model.names.index("fc2")] == 0.5).all()


class TestGroupings:
    def test_the_first_rotor_acts_like_the_first_link(self, arm):
        model = model_of(arm)
        assert "Ia1" not in model.names
        assert model.formulas[model.names.index("Izz1")].endswith("Ia1")
        assert [n for n in model.names if n.startswith("Ia")] == [f"Ia{i}" for i in range(3, 8)]

    @pytest.mark.parametrize("tilt", [4e-6, 1e-3], ids=["four digits", "calibrated"])
    def test_slightly_tilted_axes_split_no_parameter(self, arm, tilt):
        """What they tell apart are thousandths of a torque, which the grouping neglects."""
        turns = tilt * np.random.default_rng(0).normal(size=(7, 3))
        turns = expm(np.linalg.cross(np.eye(3)[None], turns[:, None]))
        exact, tilted = model_of(arm), model_of(replace(arm, rotation=arm.rotation @ turns))
        terms, more = (model.names[model.rigid :] for model in (exact, tilted))
        assert terms == more
        assert tilted.formulas[tilted.names.index("Iyy2")].count("Ia") == 1
        assert sum("Ia2" in formula for formula in tilted.formulas) == 1
        states, full = states_within(arm, 200, seed=3), np.zeros(len(tilted.standard_names))
        full[tilted.standard_slice("rotor_inertia")] = 1.0
        apart = tilted.torque(tilted.mapping @ full, *states) - states[2]
        assert np.abs(apart).max() < 5 * max(tilt, 1e-9) * 5.0

    def test_the_offset_of_a_rail_is_kept_where_its_rotor_acts_like_the_mass_on_it(self, planar):
        """All but its weight along the rail, of a rounded right angle, which is as constant as the offset."""
        down = planar.rotation[0].T @ planar.gravity / np.linalg.norm(planar.gravity)
        axis = np.cross(down, planar.axis[0]) + 4e-6 * down
        rail = replace(planar, prismatic=np.array([True, False]), axis=np.stack([axis, planar.axis[1]]))
        names = model_of(rail).names
        assert "Ia1" not in names and "fo1" in names

    def test_formulas_add_up_to_the_parameters(self, arm):
        model = model_of(arm)
        full = np.random.default_rng(1).uniform(1, 2, len(model.standard_names))
        values = dict(zip(model.standard_names, full.tolist()))
        for own, text, expected in zip(model.names, model.formulas, (model.mapping @ full).tolist()):
            product = re.sub(r"\b([\d.]+(?:e-\d+)?) ([A-Za-z])", r"\1 * \2", text)
            assert own in text.split()
            assert pd.eval(product, local_dict=values) == pytest.approx(expected, rel=1e-3)


def test_the_prior_has_typical_links_and_friction_of_the_joint_torque(arm):
    model, scale = model_of(arm), np.linspace(5, 20, 7)
    covariance = np.linalg.inv(belief(model, scale))
    links = model.body.base.mapping * typical(arm).ravel()
    assert_close(covariance[: model.rigid, : model.rigid], links @ links.T)
    deviations = zip(model.names[model.rigid :], np.sqrt(covariance.diagonal()[model.rigid :]).tolist())
    assert all(x == pytest.approx(float(scale[int(name[-1]) - 1])) for name, x in deviations)
    assert not covariance[: model.rigid, model.rigid :].any()
