"""A library keeps every bit in its file, and refuses what does not fit."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from sidegan.errors import ArtifactError, ShapeError
from sidegan.library import Library, collection
from tests.refusals import refused

FOUR = pa.list_(pa.float64(), 4)
MARGINS = ("position", "velocity", "collision")
COLUMNS = ("coefficients", "valid", "margin_velocity", "fitness", "spectrum", "diagonal", "source")


def library(count=6, joints=2, harmonics=3, parameters=4, seed=0, **changes):
    random = np.random.default_rng(seed)

    def draw(*shape):
        return random.standard_normal(shape)

    fields = {
        "coefficients": draw(count, joints, harmonics, 2),
        "valid": draw(count) > 0,
        "margins": {name: draw(count) for name in MARGINS},
        "fitness": np.exp(draw(count)),
        "diagonal_fitness": np.exp(draw(count)),
        "spectrum": np.exp(draw(count, parameters)),
        "diagonal": np.exp(draw(count, parameters)),
        "source": (["seeds", "eigen"] * count)[:count],
        "robot": "planar2",
        "digest": "d1",
        "period": 16.0,
        "home": tuple(0.1 * i for i in range(joints)),
    }
    return Library(**{**fields, **changes})


def assert_same(original, other):
    assert original.columns().keys() == other.columns().keys()
    for name, x in original.columns().items():
        # The bits, so that −0.0, denormals and infinities count too.
        assert x.dtype == other.columns()[name].dtype
        assert x.tobytes() == other.columns()[name].tobytes(), name
    assert original.source == other.source and original.family() == other.family()


@pytest.fixture
def path(tmp_path):
    return tmp_path / "folder" / "library.parquet"


def comes_back(original, path):
    original.save(path)
    assert_same(original, Library.load(path))


def test_a_library_round_trips_bit_for_bit(path):
    extreme = np.array([-0.0, 5e-324, 1e308, 0.1 + 0.2, -1e-17, np.pi])
    c = np.broadcast_to(extreme[:, None, None, None], (6, 2, 3, 2))
    comes_back(library(coefficients=c, home=(0.1 + 0.2, -1e-300)), path)
    infinite = np.full(6, np.inf)
    comes_back(library(fitness=infinite, margins={"torque": infinite}), path)
    whole = library()
    comes_back(library(spectrum=np.asfortranarray(whole.spectrum)), path)
    comes_back(whole.take([]), path)
    comes_back(library(1, 7, 6, 45), path)
    assert list(path.parent.iterdir()) == [path]


def test_pandas_reads_a_library_and_its_metadata(path):
    saved = library()
    saved.save(path)
    frame = pd.read_parquet(path)
    assert list(frame.columns) == [*saved.columns(), "source"]
    np.testing.assert_array_equal(np.stack(frame["coefficients"]).reshape(6, 2, 3, 2), saved.coefficients)
    np.testing.assert_array_equal(frame["margin_velocity"], saved.margins["velocity"])
    assert frame["valid"].dtype == bool and list(frame["source"]) == saved.source
    stored = json.loads(pq.read_schema(path).metadata[b"sidegan"])
    expected = {"format": 1, "robot": "planar2", "digest": "d1", "period": 16.0, "home": [0.0, 0.1]}
    assert expected.items() <= stored.items()


def test_merge_and_take_are_inverse(tmp_path, monkeypatch):
    first, other = library(4, seed=1), library(5, seed=2)
    both = first.merge(other)
    assert_same(both.take(range(4)), first)
    assert_same(both.take(np.arange(4, 9)), other)
    assert_same(both.take(np.arange(9) >= 4), other)
    assert_same(first.merge(first.take([])), first)
    monkeypatch.setitem(collection.OPTIONS, "row_group_size", 2)
    for name, part in (("one", first), ("other", other), ("none", first.take([]))):
        part.save(tmp_path / name)
    assert_same(Library.load(tmp_path / "one", None, tmp_path / "other", tmp_path / "none"), both)
    with refused(ShapeError, "period"):
        library(period=8.0).save(tmp_path / "slow")
        Library.load(tmp_path / "one", None, tmp_path / "slow")
    assert_same(first.take([3, 0, 3]), first.take([3]).merge(first.take([0]), first.take([3])))
    turned = library(4, seed=1, margins={name: first.margins[name] for name in reversed(MARGINS)})
    assert_same(first, turned)
    assert len(first.merge(turned)) == 8


def rewritten(change=lambda table: table, **stamp):
    """Stores the file with another table or metadata, as a foreign tool might."""

    def rewrite(path):
        table = pq.read_table(path)
        metadata = {**json.loads(table.schema.metadata[b"sidegan"]), **stamp}
        pq.write_table(change(table).replace_schema_metadata({b"sidegan": json.dumps(metadata)}), path)

    return rewrite


def replaced(column, values):
    return rewritten(lambda table: table.set_column(table.column_names.index(column), column, values))


def flipped(path):
    library(500).save(path)
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 4
    path.write_bytes(content)


def replaced_metadata(metadata):
    return lambda path: pq.write_table(pq.read_table(path).replace_schema_metadata(metadata), path)


def lacking(column):
    return rewritten(lambda table: table.drop_columns([column]))


BAD_FILES = {  # each is refused by a message that names this
    "": [
        flipped,
        replaced_metadata(None),
        replaced_metadata({b"sidegan": b"{"}),
        *(rewritten(**{name: 5}) for name in ("harmonics", "parameters")),
    ],
    **{name: [lacking(name)] for name in COLUMNS},
    "format": [rewritten(format=version) for version in (0, 2, "1", None)],
    "robot": [rewritten(robot=3)],
    "home": [rewritten(home=3), rewritten(home=[0.0])],
    "period": [rewritten(period=-1.0)],
    "fitness": [replaced("fitness", pa.array(x)) for x in ([1.0, None, 1, 1, 1, 1], ["a"] * 6)],
    "valid": [replaced("valid", pa.array([1] * 6))],
    "spectrum": [
        replaced("spectrum", pa.array([1.0] * 6)),
        replaced("spectrum", pa.array([[1.0] * 4] * 5 + [[1.0] * 3])),
        replaced("spectrum", pa.array([[1.0, 1.0, 1.0, None]] * 6, FOUR)),
    ],
    "source": [replaced("source", pa.array(["a"] * 5 + [None]))],
}


@pytest.mark.parametrize(("name", "spoil"), [(name, x) for name, all_ in BAD_FILES.items() for x in all_])
def test_bad_files_are_refused(path, name, spoil):
    library().save(path)
    spoil(path)
    with refused(ArtifactError, str(path), name):
        Library.load(path)


def test_a_library_of_another_robot_is_refused(path, planar):
    library().save(path)
    assert len(Library.load(path, replace(planar, digest="d1"))) == 6
    with refused(ArtifactError, "planar2", "d1", "kuka", "d2"):
        Library.load(path, replace(planar, name="kuka", digest="d2"))


OTHERS = {"digest": "d2", "period": 8.0, "home": (0.0, 0.0), "harmonics": 2, "margins": {}}


@pytest.mark.parametrize("count", [0, 4])
@pytest.mark.parametrize("name", OTHERS)
def test_libraries_of_other_families_are_not_merged(name, count):
    with refused(ShapeError, name):
        library(count).merge(library(4, **{name: OTHERS[name]}))
