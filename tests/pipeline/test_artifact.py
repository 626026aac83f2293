"""Parameters and digests of artifacts, and what they depend on."""

import dataclasses
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sidegan.base.names import folder_name
from sidegan.errors import ArtifactError
from sidegan.pipeline.artifact import Artifact, difference, stage_of, versions
from sidegan.pipeline.stages import STAGES
from tests.refusals import refused


def artifact(settings, maker="gan", label="eigen", inputs=None, seed=3):
    made = {"settings": settings, "inputs": inputs or {}, "seed": seed}
    return Artifact(maker=maker, label=label, title="title", **made, make=print, metrics=print)


SETTINGS = {"epochs": 50, "weights": {"fitness": 0.1}}
EIGEN = artifact(SETTINGS, inputs={"seeds": "ab"})
CHANGES = [{"maker": "seeds"}, {"label": "vanilla"}, {"seed": 4}, {"seed": None}]
CHANGES += [{"inputs": {"seeds": "ac"}}, {"inputs": {}}, {"inputs": {"seeds": artifact({}, "seeds")}}]
CHANGES += [{"settings": {"epochs": 51, "weights": {"fitness": 0.1}}}]


@pytest.mark.parametrize("change", CHANGES)
def test_every_dependency_changes_the_digest(change):
    assert dataclasses.replace(EIGEN, **change).digest != EIGEN.digest


def test_a_raised_version_changes_its_maker_and_dependents(monkeypatch):
    def digests():
        seeds, random = artifact({}, "seeds"), artifact({}, "random")
        return [made.digest for made in (seeds, random, artifact(SETTINGS, inputs={"seeds": seeds}))]

    before, raised = digests(), versions() | {"seeds": versions()["seeds"] + 1}
    monkeypatch.setattr("sidegan.pipeline.artifact.versions", lambda: raised)
    after = digests()
    assert [one != other for one, other in zip(before, after)] == [True, False, True]


def test_a_maker_without_a_version_is_refused():
    with refused(ArtifactError, "params.yaml", "'sedes'"):
        artifact({}, "sedes").digest  # noqa: B018


def test_every_maker_is_in_a_stage_that_can_be_run():
    assert {stage_of(maker) for maker in versions()} <= STAGES.keys()


def test_the_digest_ignores_order_and_titles():
    turned = dict(reversed(SETTINGS.items()))
    assert dataclasses.replace(EIGEN, settings=turned, title="other", alone=True).digest == EIGEN.digest


def test_a_difference_names_the_key_and_both_values():
    other = artifact({"epochs": 20, "weights": {"fitness": 0.1}}, inputs={"seeds": "ab"}, seed=None)
    expected = ["settings.epochs is 20, not 50", "seed is not set, not 3"]
    assert difference(EIGEN.params, other.params) == expected


@given(st.text(max_size=400))
def test_no_label_escapes_the_outputs_folder(label):
    path = Path("/outputs", artifact({}, label=label).folder)
    assert path.parent.parent == Path("/outputs") and ".." not in path.parts and "\0" not in str(path)
    name = folder_name(label)
    assert 0 < len(name.encode()) <= 100 and not name.startswith(".") and folder_name(name) == name
