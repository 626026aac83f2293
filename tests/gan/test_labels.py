import torch

from sidegan.design.excitation import excite
from sidegan.gan.labels import blend, label, scaled_margins
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, Plane, check
from tests.gan.conftest import STEPS, normal, random


def test_margins_are_the_constraints_in_shares_of_their_limits(arm):
    constraints, steps = Constraints(arm, [Plane((0, 0, 1), 0.1)]), 9
    family = Trajectory(7, 3, 12.0)
    c = normal(family, 0, 0.7, 4).double()
    found = scaled_margins(constraints, family, c, steps)
    assert found.shape == (4, len(constraints.labels), steps) and found.dtype == torch.float32
    motion = family.roll_out(c, family.grid(steps))
    scales = {
        "position": (arm.position_upper - arm.position_lower) / 2,
        "velocity": arm.velocity_limit,
        "torque": arm.torque_limit,
    }
    exact = constraints.margins(*(x.flatten(0, 1) for x in motion[1:]))
    for g, name in enumerate(constraints.labels):
        worst = (exact[name] / scales.get(name, 0.1)).amin(1).clamp(-1, 1)
        torch.testing.assert_close(found[:, g].flatten().double(), worst, rtol=0, atol=1e-5)


def test_the_first_half_of_a_blend_are_seeds_of_about_their_own_size(seeds, wild):
    c, again = (blend(seeds, wild, 403, random()) for _ in range(2))
    assert torch.equal(c, again) and len(c) == 403 and torch.isfinite(c).all()
    rows, known = c[:201].flatten(1), seeds.flatten(1)
    cosine = (rows / rows.norm(dim=1, keepdim=True)) @ (known / known.norm(dim=1, keepdim=True)).T
    best, which = cosine.max(1)
    torch.testing.assert_close(best, torch.ones_like(best))
    size = rows.norm(dim=1) / known[which].norm(dim=1)
    assert 0.8 <= size.min() < 0.84 and 1.16 < size.max() <= 1.2


def test_labels_are_exact(constraints, family, seeds, wild):
    c = torch.cat([seeds[:150], wild[:150]])  # more than one batch
    made = label(constraints, family, c, STEPS, lambda *_: None)
    torch.testing.assert_close(made.valid, check(constraints, family, c).valid)
    excitation = excite(constraints.body, family, c)
    torch.testing.assert_close(made.spectrum, excitation.spectrum)
    torch.testing.assert_close(made.diagonal, excitation.diagonal)
    torch.testing.assert_close(made.margins, scaled_margins(constraints, family, c, STEPS))
    assert made.energies.shape == (300, 0)
    logs = label(constraints, family, c, STEPS, lambda *_: None, lambda x: x.flatten(1)).energies
    torch.testing.assert_close(logs, c.flatten(1))
    seen = made.margins.amin((1, 2)) < -1e-6
    assert seen.any() and not made.valid[seen].any()
