import dataclasses

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sidegan.errors import ArtifactError
from sidegan.pipeline import stamp as stamps
from sidegan.pipeline.stamp import Stamp, code_digest, flatten, folder_name

STAMP = Stamp("gan", "eigen", {"epochs": 50, "weights": {"fitness": 0.1}}, {"seeds": "ab"}, {"gan": "cd"}, 3)

values = (
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text()
)


@pytest.mark.parametrize(
    "change",
    [
        {"stage": "seeds"},
        {"label": "vanilla"},
        {"config": {"epochs": 51, "weights": {"fitness": 0.1}}},
        {"inputs": {"seeds": "ac"}},
        {"inputs": {}},
        {"code": {"gan": "ce"}},
        {"seed": 4},
        {"seed": None},
    ],
)
def test_whatever_an_artifact_depends_on_changes_its_digest(change):
    assert dataclasses.replace(STAMP, **change).digest != STAMP.digest


def test_the_digest_does_not_depend_on_the_order_of_settings():
    turned = dict(reversed(STAMP.config.items()))
    assert dataclasses.replace(STAMP, config=turned).digest == STAMP.digest


@given(st.dictionaries(st.text(), values | st.lists(values) | st.dictionaries(st.text(), values)))
def test_a_stamp_does_not_differ_from_what_its_file_holds(config):
    stamp = Stamp("stage", "label", config)
    assert stamp.difference(stamp.plain()) == []


def test_a_difference_names_the_key_and_both_values():
    other = dataclasses.replace(STAMP, config={"epochs": 20, "weights": {"fitness": 0.1}}, seed=None)
    assert STAMP.difference(other.plain()) == ["config.epochs is 20, not 50", "seed is not set, not 3"]


def test_settings_may_be_dataclasses_inside():
    @dataclasses.dataclass
    class Settings:
        corner: tuple[float, float]

    stamp = Stamp("stage", "label", {"region": Settings((0.0, 1.0))})
    assert stamp.plain()["config"] == {"region": {"corner": [0.0, 1.0]}}
    assert stamp.difference(stamp.plain()) == []


def test_the_code_digest_follows_the_source_of_a_file_or_a_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(stamps, "_CODE", tmp_path)
    code_digest.cache_clear()
    (tmp_path / "dynamics.py").write_text("x = 1")
    (tmp_path / "seeds").mkdir()
    (tmp_path / "seeds" / "farm.py").write_text("y = 1")
    before = code_digest("dynamics"), code_digest("seeds")
    assert before == (code_digest("dynamics"), code_digest("seeds"))
    (tmp_path / "dynamics.py").write_text("x = 2")
    (tmp_path / "seeds" / "extra.py").write_text("")
    assert before == (code_digest("dynamics"), code_digest("seeds"))  # a run sticks to what it began with
    code_digest.cache_clear()
    assert code_digest("dynamics") != before[0] and code_digest("seeds") != before[1]
    with pytest.raises(ArtifactError, match="no room 'sedes'"):
        code_digest("sedes")
    code_digest.cache_clear()


def test_flatten_keeps_empty_groups():
    assert flatten({"a": {"b": 1, "c": {}}, "d": [1, 2]}) == {"a.b": 1, "a.c": {}, "d": [1, 2]}


@given(st.text(max_size=400))
def test_a_folder_name_is_one_short_folder(text):
    name = folder_name(text)
    assert name and "/" not in name and "\0" not in name and not name.startswith(".") and len(name) <= 100


def test_folder_names_stay_readable_and_long_ones_apart():
    assert folder_name("gan=eigen,seed=1") == "gan=eigen,seed=1"
    assert folder_name("robot.name=/home/me/arm.urdf") == "robot.name=_home_me_arm.urdf"
    assert folder_name("x" * 200 + "a") != folder_name("x" * 200 + "b")
