import numpy as np

from sidegan.base.arrays import flatten
from sidegan.design.excitation import excite
from sidegan.gan.labels import blend, label, scaled_margins
from sidegan.gan.tensors import array
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, Plane, check
from tests.gan.conftest import STEPS, normal


def test_margins_are_the_constraints_in_shares_of_their_limits(arm):
    constraints, steps = Constraints(arm, [Plane((0, 0, 1), 0.1)]), 9
    family = Trajectory(7, 3, 12.0)
    c = array(normal(family, 0, 0.7, 4))
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


def test_half_of_a_blend_are_rescaled_seeds(seeds, wild):
    c, again = (blend(seeds, wild, 403, 0) for _ in range(2))
    assert np.array_equal(c, again) and len(c) == 403 and np.isfinite(c).all()
    rows, known = flatten(c[:201], 1), flatten(seeds, 1)
    sizes, own = (np.linalg.norm(x, axis=1) for x in (rows, known))
    cosine = (rows @ known.T) / sizes[:, None] / own
    np.testing.assert_allclose(cosine.max(1), 1)
    size = sizes / own[cosine.argmax(1)]
    assert 0.8 <= size.min() < 0.84 and 1.16 < size.max() <= 1.2


def test_labels_equal_the_exact_values(constraints, family, seeds, wild):
    c = np.concatenate([seeds[:150], wild[:150]])  # more than one batch
    made = label(constraints, family, c, STEPS, lambda *_: None)
    np.testing.assert_allclose(made.valid, check(constraints, family, c).valid)
    excitation = excite(constraints.body, family, c)
    np.testing.assert_allclose(made.spectrum, excitation.spectrum)
    np.testing.assert_allclose(made.diagonal, excitation.diagonal)
    np.testing.assert_allclose(made.margins, scaled_margins(constraints, family, c, STEPS))
    assert made.energies.shape == (300, 0)
    logs = label(constraints, family, c, STEPS, lambda *_: None, lambda x: flatten(x, 1)).energies
    np.testing.assert_allclose(logs, flatten(c, 1))
    seen = made.margins.min((1, 2)) < -1e-6
    assert seen.any() and not made.valid[seen].any()
