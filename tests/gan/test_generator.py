import json
import pickle

import pytest
import torch

from sidegan.errors import ArtifactError, ShapeError
from sidegan.gan import TrajectoryGenerator
from sidegan.gan.networks import BODIES, Generator
from sidegan.gan.scaling import Scaling


@pytest.fixture(params=BODIES)
def generator(request, planar, family, seeds):
    torch.manual_seed(0)
    started = request.param != "dcgan"
    network = Generator(2, 3, 10, request.param, 16, started)
    scaling = Scaling.fit(seeds)
    if started:
        network.start_from(scaling.image(seeds))
    return TrajectoryGenerator(network.eval(), scaling, family, planar.name, planar.digest, "eigen")


def test_a_saved_generator_gives_identical_samples(generator, planar, tmp_path):
    path = tmp_path / "generator.pt"
    generator.save(path)
    loaded = TrajectoryGenerator.load(path, planar)
    torch.testing.assert_close(loaded.sample(20, 5), generator.sample(20, 5), rtol=0, atol=0)
    assert loaded.trajectory == generator.trajectory
    assert (loaded.robot, loaded.digest, loaded.variant) == ("planar2", planar.digest, "eigen")


def test_samples_follow_their_seed(generator):
    a = generator.sample(6, 1)
    assert a.shape == (6, 2, 3, 2) and a.dtype == torch.float64
    torch.testing.assert_close(a, generator.sample(6, 1), rtol=0, atol=0)
    assert (a != generator.sample(6, 2)).any()
    stream = torch.Generator().manual_seed(1)
    torch.testing.assert_close(generator.sample(6, stream), a, rtol=0, atol=0)
    assert (generator.sample(6, stream) != a).any()  # a stream goes on


@pytest.mark.parametrize("count", [0, -3])
def test_no_samples_are_refused(generator, count):
    with pytest.raises(ShapeError, match=f"cannot sample {count} trajectories"):
        generator.sample(count)


def test_another_arms_generator_is_refused_by_both_names(generator, arm, tmp_path):
    generator.save(tmp_path / "g.pt")
    with pytest.raises(ArtifactError, match=r"trained for planar2 .* not for kuka_lwr4"):
        TrajectoryGenerator.load(tmp_path / "g.pt", arm)
    assert TrajectoryGenerator.load(tmp_path / "g.pt").robot == "planar2"


def test_a_truncated_or_missing_file_is_refused(generator, tmp_path):
    path = tmp_path / "g.pt"
    generator.save(path)
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(ArtifactError, match=r"g\.pt"):
        TrajectoryGenerator.load(path)
    with pytest.raises(ArtifactError, match="there is no file"):
        TrajectoryGenerator.load(tmp_path / "none.pt")


class Malice:
    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return (open, (str(self.path), "w"))


@pytest.mark.parametrize("how", ["pickle", "torch"])
def test_code_in_a_file_is_not_run(how, tmp_path):
    trace, path = tmp_path / "trace", tmp_path / "g.pt"
    if how == "pickle":
        path.write_bytes(pickle.dumps({"meta": Malice(trace)}, protocol=2))
    else:
        torch.save({"meta": Malice(trace)}, path)
    with pytest.raises(ArtifactError):
        TrajectoryGenerator.load(path)
    assert not trace.exists()


def broken(content, **meta):
    return {**content, "meta": json.dumps({**json.loads(content["meta"]), **meta})}


def resized(content, **sizes):
    return broken(content, network={**json.loads(content["meta"])["network"], **sizes})


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda c: torch.zeros(3), "does not hold a trajectory generator"),
        (lambda c: [1, 2], "does not hold a trajectory generator"),
        (lambda c: {}, "does not hold a trajectory generator"),
        (lambda c: {**c, "meta": "{"}, "does not hold a trajectory generator"),
        (lambda c: {**c, "meta": "[]"}, "does not hold a trajectory generator"),
        (lambda c: {**c, "weights": {}}, "does not hold a trajectory generator"),
        (lambda c: {**c, "weights": 3}, "does not hold a trajectory generator"),
        (lambda c: {k: v for k, v in c.items() if k != "mean"}, "does not hold a trajectory generator"),
        (lambda c: broken(c, network={"joints": 2, "harmonics": 3, "body": "vit"}), "'vit'"),
        (lambda c: broken(c, trajectory={"joints": 0}), "joints and harmonics must be positive"),
        (lambda c: broken(c, format=99), "has format 99, expected 1"),
        (lambda c: broken(c, trajectory={"joints": 2, "harmonics": 4}), "makes images"),
        (lambda c: resized(c, width=10**7), "fewer than the sizes"),
        (lambda c: {**c, "weights": {k: x * torch.nan for k, x in c["weights"].items()}}, "not finite"),
        (lambda c: {**c, "mean": c["mean"] * torch.inf}, "mean holds a number that is not finite"),
        (lambda c: {**c, "mean": c["mean"][:1]}, "mean .* expected"),
        (lambda c: {**c, "spread": c["spread"][:, :2]}, "spread .* expected"),
        (lambda c: {**c, "spread": 0 * c["spread"]}, "spread is zero"),
    ],
)
def test_a_foreign_file_is_refused(generator, change, expected, tmp_path):
    path = tmp_path / "g.pt"
    generator.save(path)
    torch.save(change(torch.load(path)), path)
    with pytest.raises(ArtifactError, match=expected):
        TrajectoryGenerator.load(path)
