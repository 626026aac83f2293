"""Schedule of an adversarial training: how long, how fast, and what grows meanwhile."""

from dataclasses import dataclass

_EASED = 0.67  # share of a training over which an eased weight grows


@dataclass(frozen=True)
class Schedule:
    """Schedule of one training."""

    epochs: int  # after each of which the training is measured and saved
    steps: int  # per epoch; one discriminator step each, where there are discriminators
    batch: int  # trajectories per step
    learning_rate: float  # of Adam
    generator_steps: int = 1  # generator steps per discriminator step
    betas: tuple[float, float] = (0.9, 0.99)  # Adam's decay of the gradient's mean and of its square's

    def eased(self, step: int) -> float:
        """Share of the growth of an eased weight that is over after so many steps."""
        return min(1.0, step / (_EASED * (self.epochs * self.steps)))
