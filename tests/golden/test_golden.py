"""Numbers of fixed inputs are what they were when the goldens were made.

To 10⁻⁹ of the largest entry of each array: another processor rounds and cancels otherwise. Identification is
held to 10⁻¹⁰, which other kernels of BLAS keep six times over, but for what a conic solver ends with: the
consistent model's errors, which differ by 2·10⁻⁶ then, to 10⁻⁴. Means over stages are held
to 10⁻⁶; stages that search or train are not watched, since where a search ends differs between processors.
"""

import json

import numpy as np
import pytest

from tests.golden import make


@pytest.fixture(scope="module")
def stored():
    with np.load(make.NUMBERS) as file:
        paths = [path.split("/") for path in file.files]
        return {arm: {key: file[f"{arm}/{key}"] for name, key in paths if name == arm} for arm in make.ARMS}


def apart(found, before):
    """Largest difference, as a share of the largest entry; infinite where shapes or what is finite differ."""
    found, before = np.asarray(found, dtype=float), np.asarray(before, dtype=float)
    finite = np.isfinite(before)
    if found.shape != before.shape or not np.array_equal(finite, np.isfinite(found)):
        return np.inf
    largest = np.abs(before[finite]).max(initial=0.0)
    return np.abs(found - before)[finite].max(initial=0.0) / (largest or 1.0)


@pytest.mark.parametrize("name", make.ARMS)
def test_numbers_of_an_arm_are_unchanged(stored, name):
    own = stored[name]
    found = make.numbers(make.problem_of(name, own["home"]), own["c"])
    differences = {key: apart(x, own[key]) for key, x in found.items()}
    assert {key: x for key, x in differences.items() if not x <= 1e-9} == {}


@pytest.mark.parametrize("name", make.JUDGED)
def test_verdicts_on_trajectories_are_unchanged(stored, name):
    own = stored[name]
    problem, c = make.problem_of(name, own["home"]), make.candidates(name, own)
    valid = make.check(problem.constraints, problem.trajectory, c).valid
    was, clear = (np.unpackbits(own[key])[: len(c)].astype(bool) for key in ("valid", "clear"))
    assert np.flatnonzero(clear & (valid != was)).tolist() == []


def test_picks_from_a_pool_are_unchanged(stored):
    own = stored["kuka_lwr4"]
    found = make.picks(make.problem_of("kuka_lwr4", own["home"]), own["gain"])
    assert {key: x.tolist() for key, x in found.items()} == {key: own[key].tolist() for key in found}


@pytest.mark.parametrize("name", make.RECORDED)
def test_identification_of_recordings_is_unchanged(name):
    if not (make.DATA / make.RECORDED[name][4]).exists():
        pytest.skip(f"its recordings are not in {make.DATA}")
    found, before = make.identified(name), json.loads(make.IDENTIFIED.read_text())[name]
    for path, x in before.items():
        own = path.split(".")[1:]
        conic = "consistent" in own or (before["use"] == "consistent" and len(own) == 1)
        if path in make.WORDS:
            assert found[path] == x, path
        else:
            assert apart(found[path], x) <= (1e-4 if conic else 1e-10), path


def test_results_of_stages_change_only_with_their_makers_versions():
    found, before = make.stages(), json.loads(make.STAGES.read_text())
    assert {maker: list(x) for maker, x in found.items()} == {maker: list(x) for maker, x in before.items()}
    for maker, recorded in before.items():
        moved = {key: x for key, x in found[maker].items() if not apart(x, recorded[key]) <= 1e-6}
        assert not moved, f"raise the version of {maker} in params.yaml, and make the goldens anew"
