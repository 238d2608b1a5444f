"""Banks of exponential modes: rates, the kernels that they represent, responses to a record."""

from .power_law import PowerLawKernels
from .responses import phi_1, phi_2, responses
from .stretched import StretchedKernels, exponential_sum

__all__ = ["PowerLawKernels", "StretchedKernels", "exponential_sum", "phi_1", "phi_2", "responses"]
