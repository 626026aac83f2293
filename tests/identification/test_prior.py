"""What is believed of an arm before anything is measured, against draws of that belief."""

import pytest
import torch

from sidegan.identification.prior import belief, information, typical
from tests.identification.recordings import model_of


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
