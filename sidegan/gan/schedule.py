"""Schedule of an adversarial training: how long, how fast, and what grows or falls meanwhile."""

import math
from dataclasses import dataclass

_LAST_RATE = 0.05  # of the first learning rate, at the end of a training with decay
_EASED = 0.67  # share of a training over which an eased weight grows


@dataclass(frozen=True)
class Schedule:
    """Schedule of one training."""

    epochs: int  # after each of which the training is measured and saved
    steps: int  # per epoch; one discriminator step each, where there are discriminators
    batch: int  # trajectories per step
    learning_rate: float  # of the generator's Adam, at the beginning
    critic_rate: float = 0.0  # of the discriminators' Adam, at the beginning
    generator_steps: int = 1  # generator steps per discriminator step
    decay: bool = True  # whether both rates fall to nothing over the training, along a cosine
    clip: float | None = None  # largest norm of the generator's gradient; None: any
    betas: tuple[float, float] = (0.9, 0.99)  # Adam's decay of the gradient's mean and of its square's
    average: float | None = (
        None  # decay, per generator step, of the average of weights that is kept; None: the last
    )

    def rate(self, step: int) -> float:
        """Learning rate after so many steps, in that of the beginning."""
        if not self.decay:
            return 1.0
        done = min(1.0, step / (self.epochs * self.steps))
        return _LAST_RATE + (1 - _LAST_RATE) * 0.5 * (1 + math.cos(math.pi * done))

    def eased(self, step: int) -> float:
        """Share of the growth of an eased weight that is over after so many steps."""
        return min(1.0, step / (_EASED * (self.epochs * self.steps)))
