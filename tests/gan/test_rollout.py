import torch

from sidegan.gan.rollout import RollOut
from sidegan.motion.trajectory import Trajectory


def test_channels_are_those_of_the_exact_motion(arm):
    family = Trajectory(7, 5, 10.0, [0.1, -0.2, 0.3, -0.4, 0.5, -0.6, 0.7])
    steps, fine = 30, 4
    network = RollOut(arm, family, steps)
    c = torch.randn(6, *family.shape, generator=torch.Generator().manual_seed(0))
    channels = network(c)
    assert channels.shape == (6, network.channels, steps)

    motion = family.roll_out(c.double(), family.grid(steps * fine))
    middle = (arm.position_lower + arm.position_upper) / 2
    used = (motion.position - middle) / (arm.position_upper - middle)
    rate = motion.velocity / arm.velocity_limit
    expected = torch.cat(
        [
            motion.position[:, ::fine].sin(),
            motion.position[:, ::fine].cos(),
            used[:, ::fine],
            rate[:, ::fine],
            motion.acceleration[:, ::fine] / 5,
            used.abs().reshape(6, steps, -1).amax(2, keepdim=True),
            rate.abs().reshape(6, steps, -1).amax(2, keepdim=True),
        ],
        2,
    )
    torch.testing.assert_close(channels.double(), expected.transpose(1, 2), rtol=1e-4, atol=1e-4)


def test_it_has_nothing_to_learn_and_passes_gradients(planar, family):
    network = RollOut(planar, family, 10)
    c = torch.randn(2, *family.shape, requires_grad=True)
    network(c).sum().backward()
    assert not list(network.parameters()) and not network.state_dict()
    assert torch.isfinite(c.grad).all() and c.grad.abs().min() > 0
