"""A library that grows part by part is the one that is made in memory."""

import pytest
import torch

from sidegan.errors import InfeasibleError
from sidegan.library import Library
from sidegan.library import grow as growing
from sidegan.library.draw import Expansion, draw_valid
from sidegan.library.grow import Growth, grow, sample_of, summary_of
from sidegan.library.measure import measured, summary
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, check

FAMILY = Trajectory(2, 3, 8.0)


def sampler(size=0.6):
    random = torch.Generator().manual_seed(0)
    return lambda count: size * torch.randn(count, 2, 3, 2, generator=random, dtype=torch.float64)


def expansion(**changes):
    usual = {"count": 300, "batch": 40, "draws": 10_000, "least": 1, "polish": 0, "reserve": 0.0}
    return Expansion(**usual | changes)


@pytest.fixture(scope="module")
def constraints(planar):
    return Constraints(planar)


def test_part_by_part_gives_the_same_trajectories(constraints, tmp_path, monkeypatch):
    monkeypatch.setattr(growing, "_PART", 70)
    settings, reported = expansion(), []
    draws = grow(
        tmp_path / "l.parquet",
        Growth(sampler(), constraints, FAMILY, "made"),
        settings,
        lambda done, total: reported.append((done, total)),
    )
    whole = draw_valid(sampler(), lambda c: check(constraints, FAMILY, c), 300, 40, 10_000)
    expected = measured(constraints, FAMILY, whole.coefficients, "made")
    loaded = Library.load(tmp_path / "l.parquet")
    for name, x in expected.columns().items():  # processors differ in how they sum batches of another size
        exact = {"rtol": 0, "atol": 0} if name == "coefficients" else {"rtol": 1e-10, "atol": 1e-12}
        torch.testing.assert_close(loaded.columns()[name], x, **exact)
    assert (draws.drawn, draws.valid) == (whole.drawn, whole.valid) and reported[-1] == (300, 300)
    facts, known = summary_of(tmp_path / "l.parquet", sample_of(tmp_path / "l.parquet")), summary(expected)
    for key in ("count", "valid", "condition", "diagonal_ratio", "rank", "nearest"):
        assert facts[key] == pytest.approx(known[key], rel=1e-9), key
    assert facts["distance"] == pytest.approx(known["distance"], rel=0.05)


def test_too_few_are_kept_and_none_is_refused(constraints, tmp_path):
    growth = Growth(sampler(), constraints, FAMILY, "made")
    draws = grow(tmp_path / "few.parquet", growth, expansion(draws=80))
    assert len(Library.load(tmp_path / "few.parquet")) == draws.valid < 300
    with pytest.raises(InfeasibleError, match="none of 80 trajectories drawn from made is valid"):
        grow(
            tmp_path / "none.parquet",
            Growth(sampler(100.0), constraints, FAMILY, "made"),
            expansion(draws=80),
        )
    assert not (tmp_path / "none.parquet").exists()


def test_the_stage_grows_what_is_large(tmp_path, monkeypatch):
    from sidegan.pipeline.run import run_stages
    from sidegan.pipeline.stages import library as stage
    from tests.tiny import tiny

    reports, grown = [], []
    really = stage.grow
    monkeypatch.setattr(stage, "grow", lambda *arguments: grown.append(really(*arguments)) or grown[-1])
    for name, most in (("whole", 50_000), ("parts", 10)):
        monkeypatch.setattr(stage, "WHOLE", most)
        stages = "stages=[seeds,surrogates,gan,library]"
        config = tiny(f"outputs={tmp_path / name}", stages, "gan=[exact]", "trainings=[0]")
        run_stages(config, tmp_path / name / "run", name)
        (path,) = (tmp_path / name).glob("library/*/library.parquet")
        reports.append((Library.load(path), (path.parent / "report.json").read_text()))
    (whole, _), (parts, report) = reports
    torch.testing.assert_close(parts.coefficients, whole.coefficients, rtol=0, atol=0)
    assert len(grown) == 1 and "nearest" in report and "valid_share" in report
