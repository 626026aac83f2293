from types import SimpleNamespace

import pandas as pd
import pytest

from experiments import exp1
from sidegan.base.storage import write_parquet
from sidegan.pipeline.tracking import Tracker
from sidegan.report import tables
from tests.tiny import tiny


def results(nmse, repeats=2, weighted=(False, True)):
    """An nMSE whose mean over joints is ``nmse(set, repeat)``, four times that when weighted."""
    rows = [
        (name, repeat, w, joint, nmse(name, repeat) * (4 if w else 1) * factor)
        for name in ("eigen", "long-6", "seeds")
        for repeat in range(repeats)
        for w in weighted
        for joint, factor in (("shoulder", 0.5), ("elbow", 1.5))
    ]
    columns = ["set", "repeat", "weighted", "joint", "nmse"]
    return pd.DataFrame(rows, columns=columns).assign(training=0)


def facts(repeats=2):
    rows = [(n, r, 2.0, 50.0, 16.0, 321) for n in ("eigen", "long-6", "seeds") for r in range(repeats)]
    return pd.DataFrame(
        rows, columns=["set", "repeat", "covariance_norm", "condition", "duration", "samples"]
    )


def test_table_1_is_mean_and_deviation_over_repeats_of_the_joints_mean():
    base = {"eigen": 1.0, "long-6": 3.0, "seeds": 2.0}
    raw = results(lambda name, repeat: base[name] + 2 * repeat)
    table = exp1.table1(raw, raw.assign(nmse=raw.nmse * 10), ["repeat"])
    assert list(table.columns) == ["single long, 6 harmonics", "seeds", "seeds + eigen"]
    assert table.loc[exp1.SIMULATOR].tolist() == ["4 ± 1.4", "3 ± 1.4", "2 ± 1.4"]
    assert table.loc[exp1.WEIGHTED].tolist() == ["16 ± 5.7", "12 ± 5.7", "8 ± 5.7"]
    assert table.loc[exp1.PLANT].tolist() == ["40 ± 14", "30 ± 14", "20 ± 14"]
    assert table.loc["Paper, simulator"].tolist() == ["0.2248 ± 0.056", "0.0063 ± 0.002", "0.0028 ± 0.001"]
    assert table.loc["Paper, real robot"].tolist() == ["8.509 ± 9.906", "0.0239 ± 0.017", "0.0210 ± 0.016"]
    assert list(table.index)[:3] == [exp1.SIMULATOR, exp1.WEIGHTED, exp1.PLANT]


def test_expected_errors_stand_below_those_of_some_draws():
    raw = results(lambda name, repeat: 1.0 + repeat)
    sure = results(lambda name, repeat: 7.0, repeats=1).drop(columns="repeat")
    both = pd.concat([sure, sure.assign(training=1, nmse=3 * sure.nmse)])
    table = exp1.table1(raw, raw, ["training", "repeat"], both)
    assert list(table.index)[:4] == [exp1.SIMULATOR, exp1.WEIGHTED, exp1.EXPECTED, exp1.EXPECTED_WEIGHTED]
    assert table.loc[exp1.EXPECTED].tolist() == ["14 ± 9.9"] * 3
    assert exp1.EXPECTED not in exp1.table1(raw, raw, ["training", "repeat"], both.iloc[:0]).index


def test_what_was_not_identified_with_weights_shows_no_number():
    raw = results(lambda name, repeat: 1.0, weighted=(False,))
    table = exp1.table1(raw, raw, ["repeat"])
    assert table.loc[exp1.SIMULATOR].tolist() == ["1 ± 0"] * 3
    assert table.loc[exp1.WEIGHTED].tolist() == ["—"] * 3


def test_a_sweep_is_mean_and_deviation_over_seeds(tmp_path, capsys):
    folders = []
    for seed, size in ((0, 1.0), (1, 3.0)):
        folder = tmp_path / f"job{seed}"
        raw = results(lambda name, repeat, size=size: size + repeat)  # means: 1.5 and 3.5
        write_parquet(folder / exp1.RAW, tables.arrow(raw.assign(seed=seed).merge(facts())))
        write_parquet(folder / exp1.RAW_PLANT, tables.arrow(raw.assign(seed=seed)))
        folders.append(folder)
    table = exp1.aggregate([*folders, folders[0], tmp_path / "failed"], tmp_path / "sweep")
    assert table.loc[exp1.SIMULATOR].tolist() == ["2.5 ± 1.4"] * 3
    written = pd.read_csv(tmp_path / "sweep" / "table1.csv", index_col=0)
    assert written.loc[exp1.SIMULATOR].tolist() == ["2.5 ± 1.4"] * 3
    assert "over 2 seeds" in (tmp_path / "sweep" / "table1.md").read_text(encoding="utf-8")
    assert "2.5 ± 1.4" in capsys.readouterr().out


def test_a_sweep_without_results_has_no_table(tmp_path):
    assert exp1.aggregate([tmp_path], tmp_path / "sweep") is None
    assert not (tmp_path / "sweep").exists()


@pytest.fixture
def artifacts():
    row = {"success": 0.5, "condition": 9.0, "condition_valid": 8.0, "distance": 1.0, "nearest": 0.5}
    row |= {"rank": 4.0, "distance_diagonal": 2.0}
    rows = [{"name": "seeds", "valid": 1.0, **row}, {"name": "eigen", "valid_share": 0.6, **row}]
    return SimpleNamespace(
        errors=results(lambda name, repeat: 1.0 + repeat).merge(facts()).assign(seed=5),
        plant=results(lambda name, repeat: 2.0).assign(seed=5),
        expected=results(lambda name, repeat: 1.4, repeats=1).drop(columns="repeat"),
        few_seeds={"valid": 1.0, **row},
        histories=pd.DataFrame([{"variant": "eigen", "training": 0, "epoch": n, **row} for n in (1, 2)]),
        generators=pd.DataFrame(rows),
        cfg=tiny("seed=5"),
    )


def test_everything_is_printed_written_and_recorded(artifacts, tmp_path, capsys):
    recorded = []

    class Recorder(Tracker):
        def __init__(self):
            pass

        def log_table(self, table, name):
            recorded.append(name)

        def log_note(self, text):
            assert text.startswith("**") and "| ---" in text

        def log_artifact(self, path, folder=None):
            assert path.is_file()
            recorded.append(f"{folder}/{path.name}")

    exp1.present(artifacts, tmp_path, Recorder())
    names = ["table1", "joints", "sets", "generators"]
    expected = {f"{name}{end}" for name in names for end in (".csv", ".md")}
    expected |= {"training.png", "nmse.png"}
    expected |= {exp1.RAW, exp1.RAW_PLANT}
    assert {path.name for path in tmp_path.iterdir()} == expected
    assert set(names) <= set(recorded)
    assert {name.split("/")[1] for name in recorded if "/" in name} == expected - {exp1.RAW, exp1.RAW_PLANT}
    out = capsys.readouterr().out
    for text in (
        "Table I",
        "seed 5",
        "seeds + eigen",
        "1.5 ± 0.71",
        exp1.EXPECTED,
        "0.2248 ± 0.056",
        "duration [s]",
    ):
        assert text in out, text
    raw = pd.read_parquet(tmp_path / exp1.RAW)
    assert set(raw.seed) == {5} and len(raw) == len(artifacts.errors)
    pd.testing.assert_frame_equal(
        exp1.aggregate([tmp_path], tmp_path), exp1.table1(raw, artifacts.plant, ["seed"])
    )
