"""Sets of trajectories: their numbers, their files, and their cells."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import sidegan as sg
from sidegan.design.excitation import information_of
from tests.steps.conftest import FREE, SEARCH


def test_a_design_is_valid_and_follows_from_its_seed(cell, excitation):
    assert excitation.coefficients.shape == (3, 2, 3, 2) and excitation.valid.all()
    assert excitation.condition < excitation.conditions.max()  # together at least as evenly as the worst
    same = sg.excite(cell, count=3, seed=0, search=SEARCH)
    assert np.array_equal(same.coefficients, excitation.coefficients)


def test_a_set_is_sampled_from_rest_to_rest(excitation):
    motion, frame = excitation.motion(rate=50), excitation.to_frame(rate=50)
    assert motion.position.shape == (3, 401, 2) and not motion.velocity[:, [0, -1]].any()
    assert len(frame) == 3 * 401 and [*frame][:3] == ["trajectory", "time", "q_shoulder"]


def test_a_set_is_indexed_like_a_list(excitation):
    assert np.array_equal(excitation[[2, 0]].coefficients, excitation.coefficients[[2, 0]])
    assert len(excitation[-1]) == 1 and len(excitation[1:]) == 2 and len([*excitation]) == 3


def test_a_saved_set_reloads_with_files_for_controllers(cell, excitation, tmp_path):
    assert excitation.save(tmp_path, {"formats": ["csv"]}) == {"1": 8.0, "2": 8.0, "3": 8.0}
    written = pd.read_csv(tmp_path / "trajectories" / "1.csv")
    np.testing.assert_allclose(written.q_elbow, excitation.motion().position[0, :, 1], atol=1e-6)
    again = sg.TrajectorySet.load(tmp_path, cell)
    assert np.array_equal(again.coefficients, excitation.coefficients)
    anew = sg.TrajectorySet.of(cell, again.coefficients)
    np.testing.assert_allclose(anew.conditions, again.conditions, rtol=1e-9)


def test_a_saved_set_replaces_a_longer_one_and_no_file_of_the_user(excitation, tmp_path):
    folder = tmp_path / "trajectories"
    excitation.save(tmp_path)
    for name in ("2024.csv", "log.csv", "1.parquet"):
        (folder / name).write_text("mine")
    excitation[:2].save(tmp_path, {"formats": ["csv"]})
    assert {path.name for path in folder.iterdir()} == {
        *("1.csv", "2.csv", "all.csv"),
        *("2024.csv", "log.csv", "1.parquet"),
    }


def test_a_slower_set_keeps_its_path_and_its_own_family(excitation):
    slow = excitation.at_speed(0.5)
    assert slow.family.period == 16 and slow.valid.all() and len(slow.demands()) == 3
    np.testing.assert_allclose(slow.motion(5).position, excitation.motion(10).position, atol=1e-9)
    own = sg.Cell("planar2", period=16, **FREE)
    assert slow.warnings == sg.TrajectorySet.of(own, slow.coefficients).warnings


def test_a_slower_set_keeps_the_origin_of_each_trajectory(cell, excitation):
    drawn = sg.TrajectorySet.of(cell, 0.1 * excitation.coefficients[:1], "drawn")
    both = replace(excitation, library=excitation.library.merge(drawn.library))
    assert both.at_speed(0.5).library.source == [*3 * ["excite"], "drawn"]


def test_a_reloaded_set_keeps_its_family_and_is_checked_in_its_new_cell(excitation, tmp_path):
    slow = excitation.at_speed(0.5)
    slow.save(tmp_path)
    elsewhere = sg.Cell("planar2", **FREE | {"harmonics": 4}, period=9, home=[0.1, 0])
    again = sg.TrajectorySet.load(tmp_path, elsewhere)
    assert again.family == slow.family and np.array_equal(again.motion().position, slow.motion().position)
    near = {"sphere": {"centre": [0, 0, 1.3], "radius": 0.2}}  # where the set begins
    blocked = sg.Cell("planar2", harmonics=3, home=[1.5, 0], workspace={"desk": None, "regions": [near]})
    assert not sg.TrajectorySet.load(tmp_path, blocked).valid.any()


def test_a_selection_takes_the_most_informative_of_the_valid(cell, excitation):
    c = excitation.coefficients
    pool = sg.TrajectorySet.of(cell, np.concatenate([100 * c[:1], c]))  # the first is far too fast
    assert pool.valid.tolist() == [False, True, True, True] and len(pool.select(3)) == 3
    for noise in (None, [0.1, 100]):  # on which the choice depends
        information = information_of(cell.body, cell.trajectory, c[:2], noise)
        first = c[np.linalg.slogdet(information)[1].argmax()]
        assert np.array_equal(pool[:3].select(1, "d_optimal", noise).coefficients, first[None])


def test_a_set_is_an_array_as_numpy_asks_for_it(excitation):
    c = excitation.coefficients
    for same in (np.asarray(excitation), np.array(excitation, copy=False), np.asarray(excitation, float)):
        assert np.shares_memory(same, c) and not same.flags.writeable
    for other in (np.array(excitation), np.asarray(excitation, np.float32)):
        assert not np.shares_memory(other, c) and other.flags.writeable
        np.testing.assert_allclose(other, c, rtol=1e-6)
    with pytest.raises(ValueError, match="copy"):
        np.asarray(excitation, np.float32, copy=False)


def test_a_set_keeps_its_numbers(cell, excitation):
    c = excitation.coefficients.copy()
    kept = sg.TrajectorySet.of(cell, c)
    c[:] = 30
    with pytest.raises(ValueError, match="read-only"):
        kept.coefficients[0] *= 30
    assert np.array_equal(kept.coefficients, excitation.coefficients)
