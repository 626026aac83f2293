import pytest

NOWHERE = "http://127.0.0.1:9"  # the discard port: nothing listens there


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    """One database for all tests of a file, since making one takes seconds."""
    return tmp_path_factory.mktemp("outputs")


def client_of(root):
    from mlflow import MlflowClient

    return MlflowClient(f"sqlite:///{root / 'mlflow.db'}")
