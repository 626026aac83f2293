import pytest
import torch

from sidegan.design.excitation import excite
from sidegan.gan.labels import blend, label, narrow, scaled_margins
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, Plane, check
from tests.gan.conftest import STEPS, random


def test_margins_are_the_constraints_in_shares_of_their_limits(arm):
    constraints = Constraints(arm, [Plane((0, 0, 1), 0.1)])
    family = Trajectory(7, 3, 12.0)
    c = 0.7 * torch.randn(4, *family.shape, generator=random(), dtype=torch.float64)
    steps = 9
    found = scaled_margins(constraints, family, c, steps)
    assert found.shape == (4, len(constraints.labels), steps) and found.dtype == torch.float32
    motion = family.roll_out(c, family.grid(steps))
    scales = {
        "position": (arm.position_upper - arm.position_lower) / 2,
        "velocity": arm.velocity_limit,
        "torque": arm.torque_limit,
    }
    for b in range(4):
        for t in range(steps):
            exact = constraints.margins(*(x[b, t][None] for x in motion[1:]))
            for g, name in enumerate(constraints.labels):
                worst = (exact[name][0] / scales.get(name, 0.1)).min().clamp(-1, 1)
                assert float(found[b, g, t]) == pytest.approx(float(worst), abs=1e-5)


@pytest.mark.parametrize("count", [4, 40, 43])
def test_a_blend_has_the_wanted_size_and_follows_its_generator(seeds, wild, count):
    c = blend(seeds, wild, count, random())
    assert c.shape == (count, *seeds.shape[1:]) and torch.isfinite(c).all()
    torch.testing.assert_close(c, blend(seeds, wild, count, random()), rtol=0, atol=0)


def test_the_first_quarter_are_seeds_of_about_their_own_size(seeds, wild):
    c = blend(seeds, wild, 400, random())[:100]
    rows, known = c.flatten(1), seeds.flatten(1)
    cosine = (rows / rows.norm(dim=1, keepdim=True)) @ (known / known.norm(dim=1, keepdim=True)).T
    best, which = cosine.max(1)
    torch.testing.assert_close(best, torch.ones_like(best))
    size = rows.norm(dim=1) / known[which].norm(dim=1)
    assert 0.94 <= size.min() < 0.96 and 1.04 < size.max() <= 1.06


def test_labels_are_exact(constraints, family, seeds, wild):
    c = torch.cat([seeds[:150], wild[:150]])  # more than one batch
    told = []
    made = label(constraints, family, c, STEPS, lambda done, total: told.append((done, total)))
    torch.testing.assert_close(made.valid, check(constraints, family, c).valid)
    excitation = excite(constraints.body, family, c)
    torch.testing.assert_close(made.spectrum, excitation.spectrum)
    torch.testing.assert_close(made.diagonal, excitation.diagonal)
    torch.testing.assert_close(made.margins, scaled_margins(constraints, family, c, STEPS))
    torch.testing.assert_close(made.c, c.float())
    assert told == [(250, 300), (300, 300)]


def test_a_violation_seen_in_the_margins_is_one_of_the_check(constraints, family, wild):
    made = label(constraints, family, wild, STEPS)
    seen = made.margins.amin((1, 2)) < -1e-6
    assert seen.any()
    assert not made.valid[seen].any()


def test_a_part_keeps_the_rows_together(labelled):
    data = labelled[0]
    rows = torch.tensor([5, 2])
    part = data.part(rows)
    for name, value in vars(part).items():
        torch.testing.assert_close(value, getattr(data, name)[rows])


def test_the_narrow_data_is_seeds_and_others_as_they_are(seeds, wild):
    c = narrow(seeds, wild, 61, random())
    known = (
        {tuple(row) for row in seeds.flatten(1).tolist()},
        {tuple(row) for row in wild.flatten(1).tolist()},
    )
    rows = [tuple(row) for row in c.flatten(1).tolist()]
    assert len(rows) == 61 and set(rows[:30]) <= known[0] and set(rows[30:]) <= known[1]
