"""A library keeps every bit in its file, and refuses what does not fit."""

import json
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import torch

from sidegan.errors import ArtifactError, ShapeError
from sidegan.library import Library

FOUR = pa.list_(pa.float64(), 4)
MARGINS = ("position", "velocity", "collision")


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


def comes_back(one, path):
    one.save(path)
    assert_same(one, Library.load(path))


def test_every_bit_comes_back(path):
    extreme = torch.tensor([-0.0, 5e-324, 1e308, 0.1 + 0.2, -1e-17, np.pi], dtype=torch.float64)
    c = extreme.reshape(6, 1, 1, 1).expand(6, 2, 3, 2)
    comes_back(library(coefficients=c, home=(0.1 + 0.2, -1e-300)), path)
    infinite = torch.full((6,), torch.inf, dtype=torch.float64)
    comes_back(library(fitness=infinite, margins={"torque": infinite}), path)
    one = library()
    views = library(coefficients=one.coefficients.float(), spectrum=one.spectrum.T.contiguous().T)
    assert views.coefficients.dtype == torch.float64
    comes_back(views, path)
    comes_back(one.take([]), path)
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize("sizes", [(1, 1, 1, 1), (5, 4, 3, 2), (1, 7, 6, 45)])
def test_any_size_comes_back(path, sizes):
    comes_back(library(*sizes), path)


def test_pandas_reads_it_and_its_metadata_say_what_it_is(path):
    one = library()
    one.save(path)
    frame = pd.read_parquet(path)
    assert list(frame.columns) == [*one.columns(), "source"]
    np.testing.assert_array_equal(np.stack(frame["coefficients"]).reshape(6, 2, 3, 2), one.coefficients)
    np.testing.assert_array_equal(frame["margin_velocity"], one.margins["velocity"])
    assert frame["valid"].dtype == bool and list(frame["source"]) == one.source
    stored = json.loads(pq.read_schema(path).metadata[b"sidegan"])
    expected = {"format": 1, "robot": "planar2", "digest": "d1", "period": 16.0, "home": [0.0, 0.1]}
    assert (expected | {"joints": 2, "harmonics": 3, "parameters": 4}).items() <= stored.items()


def test_take_keeps_the_order_and_every_column():
    one = library()
    other = one.take([4, 0, 4])
    assert len(other) == 3 and other.source == [one.source[i] for i in (4, 0, 4)]
    for name, x in other.columns().items():
        assert torch.equal(x, one.columns()[name][[4, 0, 4]])
    assert_same(one.take(torch.tensor([4, 0, 4])), other)


def test_merge_and_take_undo_each_other():
    one, other = library(4, seed=1), library(5, seed=2)
    both = one.merge(other)
    assert_same(both.take(range(4)), one)
    assert_same(both.take(range(4, 9)), other)
    assert_same(one.merge(one.take([])), one)
    turned = library(4, seed=1, margins={name: one.margins[name] for name in reversed(MARGINS)})
    assert_same(one, turned)
    assert len(one.merge(turned)) == 8


def rewritten(change=lambda table: table, **stamp):
    """Stores the file with another table or metadata, as a foreign tool might."""

    def rewrite(path):
        table = pq.read_table(path)
        metadata = {**json.loads(table.schema.metadata[b"sidegan"]), **stamp}
        pq.write_table(change(table).replace_schema_metadata({b"sidegan": json.dumps(metadata)}), path)

    return rewrite


def dropped(column):
    return rewritten(lambda table: table.drop_columns([column]))


def replaced(column, values):
    return rewritten(lambda table: table.set_column(table.column_names.index(column), column, values))


def cut(share):
    return lambda path: path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])


def flipped(path):
    library(500).save(path)
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 4
    path.write_bytes(content)


def without_json(path):
    pq.write_table(pq.read_table(path).replace_schema_metadata({b"sidegan": b"{"}), path)


BAD_FILES = [
    *(("not a whole Parquet file", cut(share)) for share in (0.0, 0.5, 0.99)),
    ("not a whole Parquet file", lambda path: path.write_text("t,q1\n0,1\n")),
    ("no file", lambda path: path.unlink()),
    ("Parquet", flipped),
    ("not a library", lambda path: pd.DataFrame({"x": [1, 2]}).to_parquet(path)),
    ("not JSON", without_json),
    *((f"column {column}", dropped(column)) for column in (*library(2).columns(), "source")),
    *((f"format {version}", rewritten(format=version)) for version in (0, 2, "1", None)),
    ("robot", rewritten(robot=1)),
    ("period", rewritten(period="16")),
    ("home", rewritten(home=[None, 0.0])),
    ("home", rewritten(home=3)),
    ("margins", rewritten(margins=[1])),
    ("joints", rewritten(joints=None)),
    ("lists of", rewritten(joints=3)),
    ("lists of", rewritten(harmonics=2)),
    ("lists of", rewritten(parameters=5)),
    ("contradicts itself", rewritten(home=[0.0])),
    ("contradicts itself", rewritten(period=-1.0)),
    ("fitness.*empty cells", replaced("fitness", pa.array([1.0, None, 1, 1, 1, 1]))),
    ("fitness.*string", replaced("fitness", pa.array(["a"] * 6))),
    ("valid.*int64", replaced("valid", pa.array([1] * 6))),
    ("spectrum.*lists of 4", replaced("spectrum", pa.array([1.0] * 6))),
    ("spectrum.*lists of", replaced("spectrum", pa.array([[1.0] * 4] * 5 + [[1.0] * 3]))),
    ("spectrum.*empty cells", replaced("spectrum", pa.array([[1.0, 1.0, 1.0, None]] * 6, FOUR))),
    ("source.*text", replaced("source", pa.array(["a"] * 5 + [None]))),
    ("diagonal.*not finite", replaced("diagonal", pa.array([[1.0, 1.0, 1.0, float("nan")]] * 6, FOUR))),
]


@pytest.mark.parametrize(("words", "spoil"), BAD_FILES)
def test_bad_files_are_refused(path, words, spoil):
    library().save(path)
    spoil(path)
    with pytest.raises(ArtifactError, match=words):
        Library.load(path)


def test_a_library_of_another_robot_is_refused(path):
    library().save(path)
    assert len(Library.load(path, SimpleNamespace(name="planar2", digest="d1"))) == 6
    with pytest.raises(ArtifactError, match=r"made for planar2 \(digest d1\), not for kuka \(digest d2\)"):
        Library.load(path, SimpleNamespace(name="kuka", digest="d2"))


def made(**changes):
    return lambda: library(4, **changes)


def merged(**changes):
    return lambda: library(4).merge(library(4, **changes))


REFUSALS = [
    *(("ind", lambda x=x: library().take(x)) for x in ([6], [-1], [0.5], [[0]], [True] * 6)),
    ("digest d1 and d2", merged(digest="d2")),
    ("robot planar2 and kuka", merged(robot="kuka")),
    ("period 16.0 and 8.0", merged(period=8.0)),
    ("home", merged(home=(0.0, 0.0))),
    ("harmonics 3 and 2", merged(harmonics=2)),
    ("joints 2 and 3", merged(joints=3)),
    ("parameters 4 and 5", merged(parameters=5)),
    ("margins", merged(margins={})),
    ("coefficients", made(coefficients=torch.ones(4, 2, 3))),
    ("coefficients", made(coefficients=torch.ones(4, 2, 3, 1))),
    ("coefficients of trajectory 0", made(coefficients=torch.full((4, 2, 3, 2), torch.nan))),
    ("coefficients of trajectory 0", made(coefficients=torch.full((4, 2, 3, 2), torch.inf))),
    ("diagonal", made(diagonal=torch.ones(4))),
    ("spectrum", made(spectrum=torch.ones(4, 5))),
    ("spectrum of trajectory 1", made(spectrum=torch.tensor([[1.0] * 4, [torch.inf] * 4] * 2))),
    ("fitness", made(fitness=torch.ones(3))),
    ("fitness of trajectory 2", made(fitness=torch.tensor([1, 1, torch.nan, 1]))),
    ("fitness", made(fitness=torch.ones(4) > 0)),
    ("margin_velocity", made(margins={"velocity": torch.ones(4, 1)})),
    ("valid", made(valid=torch.ones(4))),
    ("1 sources", made(source=["seeds"])),
    ("1 home", made(home=(0.0,))),
    ("home", made(home=(0.0, float("nan")))),
    ("period", made(period=0.0)),
]


@pytest.mark.parametrize(("words", "call"), REFUSALS)
def test_what_does_not_fit_is_refused(words, call):
    with pytest.raises(ShapeError, match=words):
        call()
