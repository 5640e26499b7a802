"""Configuration of an ant colony: its cohorts and the constants of its equations."""

from __future__ import annotations

from dataclasses import dataclass

from fasaco_edge.errors import BadConfiguration

VISIBILITIES = ("neighbour", "distance", "fewest-open")


@dataclass(frozen=True, slots=True)
class Cohort:
    """Ants of one velocity [cells/move]."""

    ants: int
    velocity: int


@dataclass(frozen=True, slots=True)
class ColonyConfig:
    """A colony; the defaults, and the equations, are those of Carr and Wang 2022.

    Attributes:
        ants: number of ants.
        velocities: velocity of each cohort [cells/move], in the order they walk.
        q0: probability of taking the strongest trail, equation (4).
        alpha: weight of new pheromone, equations (7) and (8).
        tau0: pheromone every move starts with, equation (7).
        seed: seed of all random streams.
        visibility: 1 / eta, equation (5). "neighbour": the distance to the neighbour, 1, as in the
            paper; "distance": the distance that an ant goes at its velocity; "fewest-open": the
            number of the neighbour's open neighbours, plus 1.
        beta: weight of eta, equations (4) and (6); no effect for "neighbour".
    """

    ants: int = 1000
    velocities: tuple[int, ...] = (8, 7, 6, 5, 4, 3, 2, 1)
    q0: float = 0.7
    alpha: float = 0.1
    tau0: float = 0.1
    seed: int = 0
    visibility: str = "neighbour"
    beta: float = 2.0

    def __post_init__(self) -> None:
        _require(bool(self.velocities), "velocities", "name at least one", self.velocities)
        for velocity in self.velocities:
            _require(1 <= velocity <= 64, "velocities", "be in 1..64", velocity)
        _require(
            len(self.velocities) <= self.ants <= 1_000_000,
            "ants",
            f"be in {len(self.velocities)}..1000000, one for each cohort at least",
            self.ants,
        )
        _require(0.0 <= self.q0 <= 1.0, "q0", "be in [0, 1]", self.q0)
        _require(0.0 < self.alpha <= 1.0, "alpha", "be in (0, 1]", self.alpha)
        _require(1e-12 <= self.tau0 <= 1e6, "tau0", "be in [1e-12, 1e6]", self.tau0)
        names = ", ".join(VISIBILITIES)
        _require(
            self.visibility in VISIBILITIES, "visibility", f"be one of {names}", self.visibility
        )
        _require(0.0 <= self.beta <= 10.0, "beta", "be in [0, 10]", self.beta)
        _require(0 <= self.seed < 2**63, "seed", "be in 0..2^63 - 1", self.seed)

    def cohorts(self) -> tuple[Cohort, ...]:
        """Return the cohorts in order; sizes differ by at most one ant."""
        share, extra = divmod(self.ants, len(self.velocities))
        return tuple(
            Cohort(share + (index < extra), velocity)
            for index, velocity in enumerate(self.velocities)
        )


def parse_velocities(text: str) -> tuple[int, ...]:
    """Return the cohorts' velocities from ``8:1`` (falling), ``1:8`` (rising), ``4`` or ``8,4,1``.

    Raises:
        BadConfiguration: the text has another form.
    """
    try:
        named = tuple(int(part) for part in text.replace(":", ",", 1).split(","))
    except ValueError:
        named = ()
    if not named or (":" in text and len(named) != 2):
        text = f"must look like 8:1, 1:8, 4 or 8,4,1, got {text!r}"
        raise BadConfiguration(text, key="velocities")
    for velocity in named:
        _require(1 <= velocity <= 64, "velocities", "be in 1..64", velocity)
    if ":" not in text:
        return named
    first, last = named
    step = 1 if last >= first else -1
    return tuple(range(first, last + step, step))


def _require(condition: bool, key: str, expectation: str, value: object) -> None:
    if not condition:
        raise BadConfiguration(f"must {expectation}, got {value!r}", key=key)
