from tests.tiny import tiny


def configured(experiment, small):
    """How to configure a tiny run of an experiment: from the folder of its results and further changes."""
    return lambda root, *overrides: tiny(*small, f"outputs={root}", *overrides, experiment=experiment)
