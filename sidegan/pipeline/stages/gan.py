"""Stage gan: the configured variants, each as many times as there are trainings."""

from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.training import generator, generators

STAGE = Stage(lambda task: [generator(task, *one) for one in generators(task)])
