"""Libraries written and read part by part: the same files, rows and picks as in one piece."""

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.design.greedy import greedy
from sidegan.errors import ArtifactError, ShapeError
from sidegan.library import Library
from sidegan.library.stream import Diagonals, save_parts, take

from .test_library import assert_same, library


@pytest.fixture
def parts():
    return [library(count, seed=seed) for seed, count in enumerate((3, 1, 5))]


@pytest.fixture
def stored(parts, tmp_path):
    path = tmp_path / "library.parquet"
    assert save_parts(path, iter(parts)) == 9
    return path


def test_parts_make_the_same_library_as_one_piece(parts, stored):
    whole = parts[0].merge(*parts[1:])
    assert_same(Library.load(stored), whole)
    assert_same(parts[0].merge(parts[1]).merge(parts[2]), whole)
    assert Library.load(stored).source == whole.source


def test_rows_are_taken_in_the_order_asked_for(parts, stored):
    whole, rows = parts[0].merge(*parts[1:]), [8, 0, 3, 3, 2]
    assert_same(take(stored, rows), whole.take(rows))
    assert take(stored, torch.tensor(rows)).source == whole.take(rows).source


def test_diagonals_come_one_row_group_at_a_time(parts, stored):
    diagonals = Diagonals(stored)
    assert len(diagonals) == 3
    for index, part in enumerate(parts):
        assert torch.equal(diagonals[index], part.diagonal)
    assert [len(x) for x in diagonals] == [3, 1, 5]
    with pytest.raises(IndexError, match="row group 3 of 3"):
        diagonals[3]


def test_the_pick_from_a_file_is_the_pick_from_memory(stored):
    everything = Library.load(stored).diagonal
    assert greedy(Diagonals(stored), 6).tolist() == greedy(everything, 6).tolist()


@settings(max_examples=50, deadline=None)
@given(
    sizes=st.lists(st.integers(0, 6), min_size=1, max_size=5).filter(lambda sizes: sum(sizes) > 0),
    seed=st.integers(0, 1000),
)
def test_the_cut_into_parts_does_not_matter(sizes, seed):
    generator = torch.Generator().manual_seed(seed)
    whole = torch.randint(0, 3, (sum(sizes), 3), generator=generator).double()  # full of ties
    expected = greedy(whole, len(whole))
    assert torch.equal(greedy(list(whole.split(sizes)), len(whole)), expected)


def test_many_random_diagonals_in_parts():
    random = torch.Generator().manual_seed(1)
    whole = torch.randint(0, 10**6, (5000, 43), generator=random).double()  # distances of parts are exact
    assert torch.equal(greedy(whole.split(617), 40), greedy(whole, 40))


@pytest.mark.parametrize(
    ("parts", "count", "message"),
    [
        ([torch.ones(2, 3), torch.ones(3)], 1, r"diagonals are \(3,\)"),
        ([torch.ones(2, 3), torch.tensor([[1.0, -1.0, 0.0]])], 1, "trajectory 2 is not finite and non-neg"),
        ([torch.ones(2, 3)], 3, "cannot choose 3 of 2"),
    ],
)
def test_impossible_parts_are_refused(parts, count, message):
    with pytest.raises(ShapeError, match=message):
        greedy(parts, count)


def test_parts_that_do_not_fit_leave_no_file(parts, tmp_path):
    path = tmp_path / "library.parquet"
    with pytest.raises(ShapeError, match="parts of a library differ"):
        save_parts(path, [parts[0], library(2, robot="other")])
    with pytest.raises(ShapeError, match="an empty library cannot be saved"):
        save_parts(path, [])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("rows", [[9], [12], [0, 10], [-1], []])
def test_rows_that_are_not_there_are_refused(stored, rows):
    with pytest.raises(ShapeError, match="a library of 9 trajectories"):
        take(stored, rows)


def test_foreign_files_are_refused(tmp_path):
    path = tmp_path / "other.parquet"
    pq.write_table(pa.table({"diagonal": [[1.0]]}), path)
    with pytest.raises(ArtifactError, match="is not a library"):
        Diagonals(path)
    path.write_bytes(b"no parquet")
    with pytest.raises(ArtifactError, match="not a whole Parquet file"):
        take(path, [0])
    with pytest.raises(ArtifactError, match="there is no file"):
        Diagonals(tmp_path / "nothing.parquet")
