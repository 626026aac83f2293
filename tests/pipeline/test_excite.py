import json
import re

import pandas as pd
import pytest

from sidegan.errors import ConfigError
from sidegan.library import Library
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.run import run_stages
from sidegan.robot import load_robot
from sidegan.validity import Constraints, check
from tests.tiny import tiny

GENERATED = ("gan=exact", "stages=[gan,library,excite]", "excite=[exact]", "gan.exact.exact.samples=20")


@pytest.fixture(scope="module")
def folder(outputs, tmp_path_factory):
    """Folder of a run that made trajectories to execute."""
    folder = tmp_path_factory.mktemp("excite")
    run_stages(tiny(f"outputs={outputs}", experiment="excite"), folder, "excite")
    return folder


def test_every_trajectory_is_valid_and_is_written_as_it_is(folder):
    arm = load_robot("planar2")
    chosen = Library.load(folder / "library.parquet", arm)
    family = Trajectory(2, 3, 8.0)
    assert len(chosen) == 6 and check(Constraints(arm), family, chosen.coefficients).valid.all()
    motion = family.roll_out(chosen.coefficients, family.times(20))
    for k in range(6):
        frame = pd.read_csv(folder / "trajectories" / f"{k + 1}.csv")
        assert list(frame.columns[:3]) == ["time", "q_shoulder", "q_elbow"]
        for kind, x in zip(("q", "dq", "ddq"), motion[1:]):
            written = frame[[f"{kind}_shoulder", f"{kind}_elbow"]].to_numpy()
            assert abs(written - x[k].numpy()).max() < 1e-7


def test_all_in_a_row_are_one_motion_at_rest_in_between(folder):
    whole = pd.read_csv(folder / "trajectories" / "all.csv")
    assert len(whole) == 6 * 160 + 1 and whole.time.iloc[-1] == pytest.approx(48)
    rest = whole.iloc[::160]
    assert abs(rest[["q_shoulder", "q_elbow", "dq_shoulder", "dq_elbow"]].to_numpy()).max() < 1e-7


def test_the_table_says_what_each_asks_of_the_arm(folder):
    table = pd.read_csv(folder / "set.csv")
    assert list(table.trajectory) == [1, 2, 3, 4, 5, 6]
    assert (table["peak velocity"].str.rstrip("%").astype(float) <= 100).all()
    assert (table["clearance [m]"] >= 0).all() and (table["energy [J]"] > 0).all()


def test_a_page_shows_the_arm_moving_and_is_linked_from_the_table(folder):
    text = (folder / "view.html").read_text()
    titles = [
        f"{k} · cond {x:.3g}" for k, x in enumerate(Library.load(folder / "library.parquet").fitness, 1)
    ]
    head = json.loads(re.search(r'id="data">(.*?)</script>', text)[1])
    assert head["titles"] == titles and head["joints"] == ["shoulder", "elbow"]
    assert (folder / "view.html").resolve().as_uri() in (folder / "set.md").read_text()


def test_a_generator_may_be_the_pool(outputs, tmp_path):
    options = (*GENERATED, "library.draws=5000", "library.polish=5", "library.count=8")
    config = tiny(f"outputs={outputs}", *options, experiment="excite")
    run_stages(config, tmp_path, "excite")
    assert Library.load(tmp_path / "library.parquet").source == ["exact"] * 6
    with pytest.raises(ConfigError, match=r"selection\.count is 9, but exact hold 8 trajectories"):
        many = tiny(f"outputs={outputs}", *options, "selection.count=9", experiment="excite")
        run_stages(many, tmp_path, "excite")


def test_pools_that_are_not_there_are_refused(tmp_path):
    with pytest.raises(ConfigError, match="excite names 'gold', expected some of random, seeds, vanilla"):
        config = tiny(f"outputs={tmp_path}", "excite=[gold]", "stages=[excite]", experiment="excite")
        run_stages(config, tmp_path / "run", "excite")
    with pytest.raises(ConfigError, match="expected one pool or more, each once"):
        tiny("excite=[seeds,seeds]", experiment="excite")


def test_a_careful_first_run_uses_a_share_of_the_limits(tmp_path):
    config = tiny(f"outputs={tmp_path}", "robot.effort=0.4", experiment="excite")
    run_stages(config, tmp_path / "run", "excite")
    table = pd.read_csv(tmp_path / "run" / "set.csv")
    arm = load_robot("planar2")
    for k in range(1, 7):
        frame = pd.read_csv(tmp_path / "run" / "trajectories" / f"{k}.csv")
        speed = frame[["dq_shoulder", "dq_elbow"]].abs().max().to_numpy()
        assert (speed <= 0.4 * arm.velocity_limit.numpy() + 1e-6).all()
    assert (table["peak velocity"].str.rstrip("%").astype(float) <= 100).all()


LIMITED = ("robot.limits.acceleration={shoulder: 2.0, elbow: 3.0}", "robot.limits.jerk={elbow: 9}")


def test_accelerations_and_jerks_keep_their_limits_and_their_peaks_are_told(tmp_path, caplog):
    config = tiny(f"outputs={tmp_path}", *LIMITED, experiment="excite")
    with caplog.at_level("INFO"):
        run_stages(config, tmp_path / "run", "excite")
    assert "acceleration of 2, jerk of 1, torque of 2" in caplog.text
    table = pd.read_csv(tmp_path / "run" / "set.csv")
    peaks = table[["peak acceleration", "peak jerk"]].apply(lambda x: x.str.rstrip("%").astype(float))
    assert (peaks <= 100).all().all() and peaks.max().max() > 60
    library = Library.load(tmp_path / "run" / "library.parquet")
    assert (library.margins["acceleration"] >= 0).all() and (library.margins["jerk"] >= 0).all()
    family = Trajectory(2, 3, 8.0)
    jerk = family.derivative(library.coefficients, family.times(2000.0), 3)[..., 1].abs()
    assert float(jerk.max()) <= 9
    for k in range(1, 7):
        frame = pd.read_csv(tmp_path / "run" / "trajectories" / f"{k}.csv")
        assert frame.ddq_shoulder.abs().max() <= 2 and frame.ddq_elbow.abs().max() <= 3


def test_a_pool_that_is_not_there_is_told_before_any_work(tmp_path):
    config = tiny(f"outputs={tmp_path}", "excite=[nobody]", experiment="excite")
    with pytest.raises(ConfigError, match="excite names 'nobody', expected some of random, seeds"):
        run_stages(config, tmp_path / "run", "run")
    assert not (tmp_path / "seeds").exists()
