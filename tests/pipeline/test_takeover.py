"""Artifacts of version 0.1, as its stamps described them."""

import hashlib
import json

import pytest

from sidegan.pipeline import takeover
from sidegan.pipeline.graph import Artifact
from sidegan.pipeline.store import Store
from sidegan.pipeline.takeover import take_over

FIELDS = ("stage", "label", "config", "inputs", "code", "seed")


@pytest.fixture(autouse=True)
def code(monkeypatch):
    monkeypatch.setattr(takeover, "_CODE", {"seeds": "aa", "gan": "bb"})


@pytest.fixture(params=[False, True])
def store(request, tmp_path):
    return Store(tmp_path, named=request.param)


def settings(maker, **own):
    return {"workspace": {"torque": True}, "trajectory": {"home": None}, maker: own}


SEEDS = Artifact("seeds", "arm-seed0", "seeds", settings("seeds", count=3), {"robot": "r"}, 0, print, print)
GAN = Artifact(
    "gan", "arm-eigen", "gan", settings("gan", width=8), {"robot": "r", "seeds": SEEDS}, 0, print, print
)


def before(store, artifact, inputs=(), report=None, history=None, **changes):
    """Write what version 0.1 left of an artifact; its former digest."""
    config = dict(artifact.settings) | {"trajectory": {"home": [0.0, 0.0], "joints": 2}}
    digests = {"robot": "r", **dict(inputs)}
    code = {artifact.maker: "aa11" if artifact.maker == "seeds" else "bb22"}
    values = (artifact.maker, artifact.label, config, digests, code, 0)
    stamp = dict(zip(FIELDS, values)) | changes
    digest = hashlib.sha256(json.dumps(stamp, sort_keys=True).encode()).hexdigest()
    name = artifact.label if store.named else f"{artifact.label}-{digest[:8]}"
    folder = store.root / artifact.maker / name
    folder.mkdir(parents=True)
    (folder / "data.txt").write_text("1 2 3")
    for file, content in (("report.json", report), ("history.json", history)):
        if content is not None:
            (folder / file).write_text(json.dumps(content))
    files = {path.name: path.stat().st_size for path in folder.iterdir()}
    text = json.dumps(stamp | {"version": "0.1", "seconds": 4.5, "files": files})
    (folder / "stamp.json").write_text(text)
    return digest


def test_a_chain_is_taken_over_and_what_it_took_goes_beside_it(store):
    seeds = before(store, SEEDS, report={"attempts": 3, "cpu_seconds": 1.5})
    before(store, GAN, {"seeds": seeds}, history=[{"loss": 1.0, "seconds": 2.0}])
    taken, refused = take_over(store, [GAN, SEEDS])
    assert taken == [SEEDS, GAN] and not refused
    folder = store.require(SEEDS)
    assert (folder / "data.txt").read_text() == "1 2 3"
    assert json.loads((folder / "report.json").read_text()) == {"attempts": 3}
    assert store.costs(SEEDS) == {"seconds": 4.5, "cpu_seconds": 1.5}
    assert json.loads((store.require(GAN) / "history.json").read_text()) == [{"loss": 1.0}]
    assert store.costs(GAN)["epochs"] == [2.0]
    assert take_over(store, [GAN, SEEDS]) == ([], {})


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"code": {"seeds": "ff"}}, "another code: seeds"),
        ({"seed": 1}, "another arm or seed"),
        ({"inputs": {"robot": "other"}}, "another arm or seed"),
        (
            {"config": settings("seeds", count=4) | {"trajectory": {"home": [0.0]}}},
            "seeds.count was 4, not 3",
        ),
        ({"config": settings("seeds", count=3) | {"trajectory": {"home": [0.5]}}}, "trajectory.home was"),
        ({"inputs": {"robot": "r", "subset": "2"}}, "another number of seeds"),
    ],
)
def test_what_the_former_code_would_not_have_made_of_the_same_is_left(store, changes, reason):
    before(store, SEEDS, report={"cpu_seconds": 1.0}, **changes)
    taken, refused = take_over(store, [SEEDS])
    assert not taken and reason in next(iter(refused.values()))
    assert store.find(SEEDS) is None


def test_what_follows_from_something_that_is_left_is_left_too(store):
    seeds = before(store, SEEDS, report={"cpu_seconds": 1.0}, code={"seeds": "ff"})
    before(store, GAN, {"seeds": seeds})
    taken, refused = take_over(store, [SEEDS, GAN])
    assert not taken and len(refused) == 2


def test_a_damaged_artifact_is_left(store):
    before(store, SEEDS, report={"cpu_seconds": 1.0})
    next(store.root.glob("seeds/*/data.txt")).write_text("1")
    _, refused = take_over(store, [SEEDS])
    assert "data.txt is damaged" in next(iter(refused.values()))
