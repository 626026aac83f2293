import dataclasses
import json
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from sidegan.errors import ArtifactError, ShapeError, StorageError
from sidegan.library import Library

MARGINS = ("position", "velocity", "collision")
ARM = SimpleNamespace(name="planar2", digest="d1")


def library(count=6, joints=2, harmonics=3, parameters=4, seed=0, **changes):
    random = torch.Generator().manual_seed(seed)

    def draw(*shape):
        return torch.randn(*shape, generator=random, dtype=torch.float64)

    fields = {
        "coefficients": draw(count, joints, harmonics, 2),
        "valid": draw(count) > 0,
        "margins": {name: draw(count) for name in MARGINS},
        "fitness": draw(count).exp(),
        "diagonal_fitness": draw(count).exp(),
        "spectrum": draw(count, parameters).exp(),
        "diagonal": draw(count, parameters).exp(),
        "source": (["seeds", "eigen"] * count)[:count],
        "robot": "planar2",
        "digest": "d1",
        "period": 16.0,
        "home": tuple(0.1 * i for i in range(joints)),
    }
    return Library(**{**fields, **changes})


def assert_same(one, other):
    assert one.columns().keys() == other.columns().keys()
    for name, x in one.columns().items():
        # The bits, so that −0.0, denormals and infinities count too.
        assert x.dtype == other.columns()[name].dtype
        assert x.numpy().tobytes() == other.columns()[name].contiguous().numpy().tobytes(), name
    assert one.source == other.source and one.family() == other.family()


@pytest.fixture
def path(tmp_path):
    return tmp_path / "folder" / "library.parquet"


def rewrite(path, change_table=None, **stamp):
    """Store the same file with another table or metadata, as a foreign tool might."""
    table = pq.read_table(path)
    metadata = {**json.loads(table.schema.metadata[b"sidegan"]), **stamp}
    table = change_table(table) if change_table else table
    pq.write_table(table.replace_schema_metadata({b"sidegan": json.dumps(metadata)}), path)


class TestFile:
    def test_every_bit_comes_back(self, path):
        extreme = torch.tensor([-0.0, 5e-324, 1e308, 0.1 + 0.2, -1e-17, np.pi], dtype=torch.float64)
        one = library(coefficients=extreme.reshape(6, 1, 1, 1).expand(6, 2, 3, 2), home=(0.1 + 0.2, -1e-300))
        one.save(path)
        assert_same(one, Library.load(path))

    def test_infinite_fitness_and_margin_come_back(self, path):
        infinite = torch.full((6,), torch.inf, dtype=torch.float64)
        one = library(fitness=infinite, margins={"torque": infinite})
        one.save(path)
        assert_same(one, Library.load(path))

    @given(st.integers(1, 5), st.integers(1, 4), st.integers(1, 3), st.integers(1, 5), st.integers(0, 9))
    def test_any_size_comes_back(self, tmp_path_factory, count, joints, harmonics, parameters, seed):
        path = tmp_path_factory.mktemp("library") / "file"
        one = library(count, joints, harmonics, parameters, seed)
        one.save(path)
        assert_same(one, Library.load(path))

    def test_single_precision_and_views_are_kept_as_double(self, path):
        one = library(6)
        other = library(6, coefficients=one.coefficients.float(), spectrum=one.spectrum.T.contiguous().T)
        assert other.coefficients.dtype == torch.float64
        other.save(path)
        assert_same(other, Library.load(path))

    def test_saving_again_replaces_and_leaves_nothing_else(self, path):
        library(6).save(path)
        library(4).save(path)
        assert len(Library.load(path)) == 4
        assert list(path.parent.iterdir()) == [path]

    def test_pandas_reads_it(self, path):
        one = library(6)
        one.save(path)
        frame = pd.read_parquet(path)
        assert list(frame.columns) == [*one.columns(), "source"]
        np.testing.assert_array_equal(np.stack(frame["coefficients"]).reshape(6, 2, 3, 2), one.coefficients)
        np.testing.assert_array_equal(frame["margin_velocity"], one.margins["velocity"])
        assert frame["valid"].dtype == bool and list(frame["source"]) == one.source

    def test_the_metadata_say_what_it_is(self, path):
        library(6).save(path)
        stored = json.loads(pq.read_schema(path).metadata[b"sidegan"])
        expected = {"format": 1, "robot": "planar2", "digest": "d1", "period": 16.0, "home": [0.0, 0.1]}
        assert expected.items() <= stored.items()
        assert (stored["joints"], stored["harmonics"], stored["parameters"]) == (2, 3, 4)

    def test_twenty_thousand_trajectories_survive_their_file(self, path):
        one = library(20_000, joints=7, harmonics=6, parameters=43)
        one.save(path)
        other = Library.load(path)
        assert torch.equal(one.spectrum, other.spectrum)

    def test_lists_without_a_fixed_size_are_read_too(self, path):
        one = library(6)
        one.save(path)

        def as_lists(table):
            lists = pa.array([row.tolist() for row in one.spectrum], pa.list_(pa.float64()))
            return table.set_column(table.column_names.index("spectrum"), "spectrum", lists)

        rewrite(path, as_lists)
        assert_same(one, Library.load(path))

    def test_the_robot_is_checked_where_one_is_given(self, path):
        library(6).save(path)
        assert len(Library.load(path, ARM)) == 6
        with pytest.raises(
            ArtifactError, match=r"made for planar2 \(digest d1\), not for kuka \(digest d2\)"
        ):
            Library.load(path, SimpleNamespace(name="kuka", digest="d2"))


class TestBadFile:
    @pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.99])
    def test_truncated(self, path, share):
        library(50).save(path)
        content = path.read_bytes()
        path.write_bytes(content[: int(share * len(content))])
        with pytest.raises(ArtifactError, match="not a whole Parquet file"):
            Library.load(path)

    def test_missing_or_not_parquet(self, path):
        with pytest.raises(ArtifactError, match="no file"):
            Library.load(path)
        path.parent.mkdir()
        path.write_text("t,q1\n0,1\n")
        with pytest.raises(ArtifactError, match="not a whole Parquet file"):
            Library.load(path)

    def test_a_flipped_bit_in_the_numbers(self, path):
        library(500).save(path)
        content = bytearray(path.read_bytes())
        content[len(content) // 2] ^= 4
        path.write_bytes(content)
        with pytest.raises(ArtifactError, match="Parquet"):
            Library.load(path)

    def test_somebody_elses_parquet(self, tmp_path):
        pd.DataFrame({"x": [1, 2]}).to_parquet(tmp_path / "file")
        with pytest.raises(ArtifactError, match="not a library"):
            Library.load(tmp_path / "file")

    @pytest.mark.parametrize("column", [*library(2).columns(), "source"])
    def test_missing_column(self, path, column):
        library(6).save(path)
        rewrite(path, lambda table: table.drop_columns([column]))
        with pytest.raises(ArtifactError, match=f"column {column}"):
            Library.load(path)

    @pytest.mark.parametrize("version", [0, 2, "1", None])
    def test_unknown_format(self, path, version):
        library(6).save(path)
        rewrite(path, format=version)
        with pytest.raises(ArtifactError, match=f"format {version}"):
            Library.load(path)

    @pytest.mark.parametrize(
        ("key", "value"),
        [
            ("robot", 1),
            ("period", "16"),
            ("home", [None, 0.0]),
            ("home", 3),
            ("margins", [1]),
            ("joints", None),
        ],
    )
    def test_metadata_of_the_wrong_type(self, path, key, value):
        library(6).save(path)
        rewrite(path, **{key: value})
        with pytest.raises(ArtifactError, match=key):
            Library.load(path)

    def test_metadata_that_are_not_json(self, path):
        library(6).save(path)
        pq.write_table(pq.read_table(path).replace_schema_metadata({b"sidegan": b"{"}), path)
        with pytest.raises(ArtifactError, match="not JSON"):
            Library.load(path)

    @pytest.mark.parametrize(("key", "value"), [("joints", 3), ("harmonics", 2), ("parameters", 5)])
    def test_lists_of_another_length_than_the_metadata_say(self, path, key, value):
        library(6).save(path)
        rewrite(path, **{key: value})
        with pytest.raises(ArtifactError, match="lists of"):
            Library.load(path)

    @pytest.mark.parametrize(("key", "value"), [("home", [0.0]), ("period", -1.0)])
    def test_metadata_that_contradict_the_columns(self, path, key, value):
        library(6).save(path)
        rewrite(path, **{key: value})
        with pytest.raises(ArtifactError, match="contradicts itself"):
            Library.load(path)

    @pytest.mark.parametrize(
        ("column", "values", "found"),
        [
            ("fitness", pa.array([1.0, None, 1, 1, 1, 1]), "empty cells"),
            ("fitness", pa.array(["a"] * 6), "string"),
            ("valid", pa.array([1] * 6), "int64"),
            ("spectrum", pa.array([1.0] * 6), "lists of 4"),
            ("spectrum", pa.array([[1.0] * 4] * 5 + [[1.0] * 3]), "lists of"),
            ("spectrum", pa.array([[1.0] * 4] * 5 + [[1.0, 1.0, 1.0, None]]), "empty cells"),
            ("source", pa.array(["a"] * 5 + [None]), "text"),
            ("diagonal", pa.array([[1.0, 1.0, 1.0, float("nan")]] * 6), "not finite"),
        ],
    )
    def test_a_column_of_another_kind(self, path, column, values, found):
        library(6).save(path)
        rewrite(path, lambda table: table.set_column(table.column_names.index(column), column, values))
        with pytest.raises(ArtifactError, match=f"{column}.*{found}"):
            Library.load(path)

    def test_unwritable_folder(self, tmp_path):
        (tmp_path / "file").write_text("")
        with pytest.raises(StorageError, match="cannot write"):
            library(6).save(tmp_path / "file" / "library.parquet")


class TestChoosing:
    def test_take_keeps_the_order_and_every_column(self):
        one = library(6)
        other = one.take([4, 0, 4])
        assert len(other) == 3 and other.source == [one.source[i] for i in (4, 0, 4)]
        for name, x in other.columns().items():
            assert torch.equal(x, one.columns()[name][[4, 0, 4]])
        assert_same(one.take(torch.tensor([4, 0, 4])), other)

    def test_nothing_may_be_left(self):
        assert len(library(6).take([])) == 0

    @pytest.mark.parametrize("indices", [[6], [-1], [0.5], [[0]], torch.ones(6, dtype=torch.bool)])
    def test_an_index_that_is_none_is_refused(self, indices):
        with pytest.raises(ShapeError, match="ind"):
            library(6).take(indices)


class TestMerging:
    def test_merge_and_take_undo_each_other(self):
        one, other = library(4, seed=1), library(5, seed=2)
        both = one.merge(other)
        assert_same(both.take(range(4)), one)
        assert_same(both.take(range(4, 9)), other)

    def test_the_order_of_the_margins_does_not_matter(self):
        one = library(4)
        other = library(4, margins={name: one.margins[name] for name in reversed(MARGINS)})
        assert_same(one, other)
        assert len(one.merge(other)) == 8

    def test_an_empty_one_changes_nothing(self):
        one = library(4)
        assert_same(one.merge(one.take([])), one)

    @pytest.mark.parametrize(
        ("changes", "named"),
        [
            ({"digest": "d2"}, "digest d1 and d2"),
            ({"robot": "kuka"}, "robot planar2 and kuka"),
            ({"period": 8.0}, "period 16.0 and 8.0"),
            ({"home": (0.0, 0.0)}, "home"),
            ({"harmonics": 2}, "harmonics 3 and 2"),
            ({"joints": 3}, "joints 2 and 3"),
            ({"parameters": 5}, "parameters 4 and 5"),
            ({"margins": {}}, "margins"),
        ],
    )
    def test_what_does_not_belong_together_is_refused(self, changes, named):
        with pytest.raises(ShapeError, match=named):
            library(4).merge(library(4, **changes))


def test_an_empty_library_comes_back_empty(path):
    none = library(4).take([])
    none.save(path)
    assert_same(none, Library.load(path))


class TestDoor:
    @pytest.mark.parametrize(
        ("changes", "named"),
        [
            ({"coefficients": torch.ones(4, 2, 3)}, "coefficients"),
            ({"coefficients": torch.ones(4, 2, 3, 1)}, "coefficients"),
            ({"coefficients": torch.full((4, 2, 3, 2), torch.nan)}, "coefficients of trajectory 0"),
            ({"coefficients": torch.full((4, 2, 3, 2), torch.inf)}, "coefficients of trajectory 0"),
            ({"diagonal": torch.ones(4)}, "diagonal"),
            ({"spectrum": torch.ones(4, 5)}, "spectrum"),
            ({"spectrum": torch.tensor([[1.0] * 4, [torch.inf] * 4] * 2)}, "spectrum of trajectory 1"),
            ({"fitness": torch.ones(3)}, "fitness"),
            ({"fitness": torch.tensor([1, 1, torch.nan, 1])}, "fitness of trajectory 2"),
            ({"fitness": torch.ones(4) > 0}, "fitness"),
            ({"margins": {"velocity": torch.ones(4, 1)}}, "margin_velocity"),
            ({"valid": torch.ones(4)}, "valid"),
            ({"source": ["seeds"]}, "1 sources"),
            ({"home": (0.0,)}, "1 home"),
            ({"home": (0.0, float("nan"))}, "home"),
            ({"period": 0.0}, "period"),
        ],
    )
    def test_what_does_not_fit_is_refused(self, changes, named):
        with pytest.raises(ShapeError, match=named):
            library(4, **changes)

    def test_a_library_does_not_change(self):
        with pytest.raises(dataclasses.FrozenInstanceError):
            library(4).robot = "kuka"
