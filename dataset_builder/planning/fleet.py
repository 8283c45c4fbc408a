"""What a build takes on the machines that a user names: hours and money, by arithmetic on an estimate."""

from dataclasses import dataclass

from dataset_builder.planning.cost import CostEstimate

HOUR, GB = 3600.0, 1e9


@dataclass(frozen=True, kw_only=True)
class Fleet:
    """Workers that share a build, and what is paid for them. Prices are in any currency."""

    workers: int
    """Processes that render, each with a core or a GPU to itself."""
    gpu: bool = False
    """Whether workers render on GPUs, for which `Rates` hold nothing."""
    speed: float | None = None
    """Of a worker, over the core that `Rates` were measured on; None for 1, on a GPU for what nobody knows."""
    price: float = 0.0
    """Per worker and hour."""
    egress: float = 0.0
    """Per GB (1e9 bytes) that leaves the place where it was made."""


@dataclass(frozen=True, kw_only=True)
class Bill:
    """What a fleet takes."""

    seconds: float
    """From beginning to end."""
    error: float
    """Standard error of `seconds`."""
    worker_hours: float
    money: float
    """For workers, all of which are paid until the end."""
    egress: float
    """For the dataset, once."""


def bill(estimate: CostEstimate, fleet: Fleet) -> Bill:
    """The bill of an estimate for `cores=fleet.workers`: no worker is lost, and nothing is done twice. Of GPUs whose
    speed is not known, that of as many cores."""
    speed = fleet.speed or 1.0
    seconds = estimate.total.seconds / speed
    hours = fleet.workers * seconds / HOUR
    return Bill(seconds=seconds, error=estimate.error.seconds / speed, worker_hours=hours,
                money=hours * fleet.price, egress=estimate.total.bytes / GB * fleet.egress)
