"""Choice of a sensor and its compensator within the training stretch, and what they must beat."""

from .choice import BUDGET, choose
from .compare import HERE, Standing, defeats, standings
from .trials import Trial

__all__ = ["BUDGET", "HERE", "Standing", "Trial", "choose", "defeats", "standings"]
