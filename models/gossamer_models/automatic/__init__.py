"""Choice of a sensor and its compensator within the training stretch, and what they must beat."""

from .choice import BUDGET, Chosen, choose
from .compare import HERE, Standing, defeats, standings
from .trials import Trial

__all__ = ["BUDGET", "HERE", "Chosen", "Standing", "Trial", "choose", "defeats", "standings"]
