import numpy as np
import torch
from scipy.optimize import minimize

from sidegan.design.lbfgs import BatchedLbfgs


def rosenbrock(x):
    x = x.detach().requires_grad_(True)
    value = (100 * (x[:, 1:] - x[:, :-1] ** 2) ** 2 + (1 - x[:, :-1]) ** 2).sum(1)
    (gradient,) = torch.autograd.grad(value.sum(), x)
    return value.detach(), gradient


def test_quadratics_are_solved_exactly():
    random = torch.Generator().manual_seed(0)
    root = torch.randn(6, 8, 8, generator=random, dtype=torch.float64)
    matrix = root @ root.transpose(1, 2) + torch.eye(8, dtype=torch.float64)
    target = torch.randn(6, 8, generator=random, dtype=torch.float64)

    def quadratic(x):
        gap = x - target
        pull = torch.einsum("bij,bj->bi", matrix, gap)
        return 0.5 * (gap * pull).sum(1), pull

    search = BatchedLbfgs(quadratic, torch.zeros(6, 8, dtype=torch.float64), memory=10, step=1.0)
    for _ in range(120):
        search.iterate()
    torch.testing.assert_close(search.x, target, atol=1e-6, rtol=0)


def test_rosenbrock_from_many_starts_like_scipy_and_no_value_ever_rises():
    starts = torch.randn(12, 4, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    search = BatchedLbfgs(rosenbrock, starts.clone(), memory=10, step=1.0)
    before = search.value
    for _ in range(400):
        search.iterate()
        assert (search.value <= before).all()
        before = search.value

    def one(x):
        value, gradient = rosenbrock(torch.from_numpy(x)[None])
        return float(value[0]), gradient[0].numpy()

    theirs = [minimize(one, start, jac=True, method="L-BFGS-B").fun for start in starts.numpy()]
    np.testing.assert_allclose(search.value, theirs, atol=1e-5)


def test_a_trial_that_is_not_a_number_is_not_accepted():
    def wall(x):
        value = torch.where(x[:, 0] > 0.5, torch.nan, (x[:, 0] - 0.4) ** 2)
        return value, 2 * (x - 0.4)

    search = BatchedLbfgs(wall, torch.zeros(1, 1, dtype=torch.float64), step=2.0)
    for _ in range(40):
        search.iterate()
    assert abs(float(search.x) - 0.4) < 1e-6


def test_problems_do_not_touch_each_other():
    starts = torch.randn(5, 4, generator=torch.Generator().manual_seed(2), dtype=torch.float64)
    together = BatchedLbfgs(rosenbrock, starts.clone())
    alone = [BatchedLbfgs(rosenbrock, start[None].clone()) for start in starts]
    for _ in range(50):
        together.iterate()
        for one in alone:
            one.iterate()
    torch.testing.assert_close(together.x, torch.cat([one.x for one in alone]))
