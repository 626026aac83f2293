"""One generator whose trajectories depend on a condition: region, effort, home, links to learn about."""

from sidegan.conditional.condition import Condition
from sidegan.conditional.generator import ConditionalGenerator
from sidegan.conditional.settings import Obstacles, Ranges, Request

__all__ = ["Condition", "ConditionalGenerator", "Obstacles", "Ranges", "Request"]
