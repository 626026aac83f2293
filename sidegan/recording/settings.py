"""How a recording is conditioned: what may be chosen, and what follows from the recording."""

from dataclasses import dataclass

from sidegan.errors import ConfigError


@dataclass(frozen=True)
class Settings:
    """What may be chosen.

    Attributes:
        bandwidth: highest frequency of the executed trajectory [Hz]; None: measured from the recording.
        cutoff: of the zero-phase low-pass [Hz]; None: ``headroom`` times the bandwidth.
        headroom: cut-off over bandwidth.
        order: of the low-pass, which is run forwards and backwards.
        oversampling: samples that are kept per period of the cut-off.
        gap: longest time between two samples that is interpolated over [s]; None: five sampling steps.
        still: an arm whose joints are all slower than this is at rest [rad/s or m/s]; 0 keeps all samples.
        pause: samples this close to a motion are kept [s].
        gains: of the drives, motor current to joint torque [N·m/A], one per joint.
        reverse: joints whose torque or current is counted the other way round.
        sign_width: velocity at which the smooth sign is at 76 % [rad/s or m/s].

    Raises:
        ConfigError: when a value is out of range.
    """

    bandwidth: float | None = None
    cutoff: float | None = None
    headroom: float = 12.0
    order: int = 4
    oversampling: float = 10.0
    gap: float | None = None
    still: float = 0.02
    pause: float = 0.1
    gains: tuple[float, ...] | None = None
    reverse: tuple[str, ...] = ()
    sign_width: float = 0.01

    def __post_init__(self) -> None:
        for name in ("bandwidth", "cutoff", "gap", "headroom", "order", "sign_width"):
            value = getattr(self, name)
            if value is not None and not value > 0:
                raise ConfigError(f"{name} is {value}, expected more than 0")
        if not self.oversampling > 2:
            raise ConfigError(f"oversampling is {self.oversampling}, expected more than 2 samples per period")
        for name in ("still", "pause"):
            if getattr(self, name) < 0:
                raise ConfigError(f"{name} is {getattr(self, name)}, expected 0 or more")


@dataclass(frozen=True)
class Grid:
    """What a recording is conditioned with; ``statement`` says it to people.

    Attributes:
        step: of the uniform grid [s].
        gap: longest time that is interpolated over [s].
        bandwidth: of the motion [Hz].
        measured: whether the bandwidth was measured, and not given.
        cutoff: of the low-pass [Hz].
        order: of the low-pass.
        stride: every so manieth sample of the grid is kept.
    """

    step: float
    gap: float
    bandwidth: float
    measured: bool
    cutoff: float
    order: int
    stride: int

    @property
    def rate(self) -> float:
        """Of the samples that are kept [Hz]."""
        return 1 / (self.step * self.stride)

    @property
    def halo(self) -> int:
        """Samples around a block after which the filter has forgotten what came before."""
        return round(10 / (self.cutoff * self.step)) + 4

    @property
    def edge(self) -> int:
        """Samples at either end of a stretch without gaps that the filter could not see around."""
        return round(2 / (self.cutoff * self.step))

    @property
    def statement(self) -> str:
        """In words."""
        how = "measured" if self.measured else "given"
        return (
            f"resampled to {1 / self.step:.4g} Hz (gaps over {self.gap * 1e3:.3g} ms are not crossed), "
            f"zero-phase low-pass of order {self.order} at {self.cutoff:.3g} Hz (bandwidth of the motion "
            f"{self.bandwidth:.3g} Hz, {how}), {self.rate:.4g} samples per second kept"
        )
