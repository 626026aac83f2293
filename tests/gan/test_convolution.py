"""Convolutions of small images against torch's own."""

import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import nn

from sidegan.gan.convolution import SmallConv2d, SmallConvTranspose2d

PAIRS = {SmallConv2d: nn.Conv2d, SmallConvTranspose2d: nn.ConvTranspose2d}
sides = st.tuples(st.integers(4, 7), st.integers(4, 7))
kernels = st.tuples(st.integers(1, 4), st.integers(1, 4))


@given(st.sampled_from(list(PAIRS)), sides, kernels, st.integers(1, 2), st.integers(0, 1), st.booleans())
def test_images_and_gradients_are_torchs(ours, size, kernel, stride, padding, bias):
    padding = min(padding, min(kernel) - 1)
    torch.manual_seed(0)
    layer = ours(2, 3, kernel, stride, padding, bias=bias).double()
    other = PAIRS[ours](2, 3, kernel, stride, padding, bias=bias).double()
    other.load_state_dict(layer.state_dict())
    found = []
    for network in (layer, other):
        x = torch.rand(4, 2, *size, generator=torch.Generator().manual_seed(1), dtype=torch.double)
        y = network(x.requires_grad_(True))
        found.append([y, *torch.autograd.grad((y**3).sum(), [x, *network.parameters()])])
    for mine, theirs in zip(*found, strict=True):
        torch.testing.assert_close(mine, theirs)
