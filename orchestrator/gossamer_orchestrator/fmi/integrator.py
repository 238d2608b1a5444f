"""CVode of SUNDIALS around the equations of an FMU for model exchange, through FMPy."""

from __future__ import annotations

import ctypes
from typing import Any

from fmpy.fmi1 import FMICallException
from fmpy.sundials import CV_NORMAL, CV_ROOT_RETURN, CVode, CVodeSolver
from fmpy.sundials.cvode import sundials_cvode

from .slave import DISCARD

_set_stop_time = sundials_cvode["CVodeSetStopTime"]
_set_stop_time.argtypes = [ctypes.c_void_p, ctypes.c_double]
_FATAL, _AGAIN = -1, 1  # what a function that CVode calls returns when it fails, and when a smaller step may help


class _NoInputs:
    """FMPy's solver sets inputs as functions of time with this; ours are constant over a step."""

    def apply(self, _time: float) -> None:
        """Do nothing."""


class Integrator(CVodeSolver):  # type: ignore[misc]
    """Integrate an FMU.

    Parameters
    ----------
    model : fmpy.fmi2.FMU2Model or fmpy.fmi3.FMU3Model
        The FMU, in continuous-time mode.
    description : fmpy.model_description.ModelDescription
        As read by FMPy.
    time : float
        Present time [s].
    tolerance : float
        Relative tolerance; the absolute one is that of the states' nominal values.
    """

    def __init__(self, model: Any, description: Any, time: float, tolerance: float) -> None:  # noqa: ANN401
        three = description.fmiVersion.startswith("3")
        self._model = model
        self._failure: FMICallException | None = None
        states = model.getNumberOfContinuousStates() if three else description.numberOfContinuousStates
        indicators = model.getNumberOfEventIndicators() if three else description.numberOfEventIndicators
        super().__init__(
            nx=states,
            nz=indicators,
            get_x=model.getContinuousStates,
            set_x=model.setContinuousStates,
            get_dx=model.getContinuousStateDerivatives if three else model.getDerivatives,
            get_z=model.getEventIndicators,
            get_nominals=model.getNominalsOfContinuousStates,
            set_time=model.setTime,
            input=_NoInputs(),
            startTime=time,
            relativeTolerance=tolerance,
            maxNumSteps=100_000,
        )

    def advance(self, now: float, target: float, *, anew: bool) -> tuple[float, bool]:
        """Integrate from ``now`` [s] to ``target`` [s] or to the first zero of an event indicator.

        With ``anew`` nothing of the integration so far is used.

        Returns
        -------
        (float, bool)
            Time reached [s], and whether an indicator ends the integration there.

        Raises
        ------
        fmpy.fmi1.FMICallException
            A function of the FMU failed.
        ArithmeticError
            The integrator cannot go on.
        """
        reached, root = ctypes.c_double(now), False
        if target > now and not (self.discrete and not self.nz):
            if anew:
                self.reset(now)
            _set_stop_time(self.cvode_mem, target)
            flag = CVode(self.cvode_mem, target, self.x, ctypes.byref(reached), CV_NORMAL)
            if flag < 0 and self._failure is not None:
                failure, self._failure = self._failure, None
                raise failure
            if flag < 0:
                why = self.error_info[3].rstrip(".") if self.error_info else f"CVode returns {flag}"
                raise ArithmeticError(" ".join(why.split()))
            root = flag == CV_ROOT_RETURN
        else:
            reached.value = target
        self._failure = None
        self.set_time(reached.value)
        if not self.discrete:
            self.set_x(self.px, self.nx)
        return reached.value, root

    def f(self, t: float, y: Any, ydot: Any, user_data: Any) -> int:  # noqa: ANN401
        """Compute the derivatives; CVode calls it."""
        return self._guarded(super().f, t, y, ydot, user_data)

    def g(self, t: float, y: Any, gout: Any, user_data: Any) -> int:  # noqa: ANN401
        """Compute the event indicators; CVode calls it."""
        return self._guarded(super().g, t, y, gout, user_data)

    def _guarded(self, function: Any, *arguments: Any) -> int:  # noqa: ANN401
        """Call a function; no exception may go through CVode."""
        try:
            function(*arguments)
        except FMICallException as failure:
            self._failure = failure
            return _AGAIN if failure.status == DISCARD else _FATAL
        return 0
