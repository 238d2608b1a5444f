"""CVode of SUNDIALS around the equations of an FMU for model exchange, through FMPy."""

from __future__ import annotations

import ctypes
import sys
from typing import Any

from fmpy.fmi1 import FMICallException
from fmpy.sundials import CV_ROOT_RETURN, CVode, CVodeSolver
from fmpy.sundials.cvode import sundials_cvode
from fmpy.sundials.libraries import sundials_core
from fmpy.sundials.sundials_context import SUNContext_PushErrHandler
from fmpy.sundials.sundials_types import SUNContext

from .slave import DISCARD

_set_stop_time = sundials_cvode["CVodeSetStopTime"]
_set_stop_time.argtypes = [ctypes.c_void_p, ctypes.c_double]
_clear_handlers = sundials_core["SUNContext_ClearErrHandlers"]
_clear_handlers.argtypes = [SUNContext]
_ONE_STEP = 2  # CV_ONE_STEP, which FMPy lacks
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
        self._failure: BaseException | None = None
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
        _clear_handlers(self.sunctx)  # the first of them prints
        SUNContext_PushErrHandler(self.sunctx, self.ehfun_, None)

    def advance(self, now: float, target: float, *, anew: bool) -> tuple[float, bool]:
        """Integrate from ``now`` [s] over one step of the integrator, not beyond ``target`` [s] or a zero of an indicator.

        With ``anew`` nothing of the integration so far is used.

        Returns
        -------
        (float, bool)
            Time reached [s], and whether an indicator ends the step there.

        Raises
        ------
        fmpy.fmi1.FMICallException
            A function of the FMU failed.
        ArithmeticError
            The integrator cannot go on.
        """
        nearest = 4.0 * sys.float_info.epsilon * max(abs(now), abs(target))
        if target - now <= nearest or (self.discrete and not self.nz):
            self.set_time(max(now, target))
            return max(now, target), False
        if anew:
            self.reset(now)
        _set_stop_time(self.cvode_mem, target)
        reached = ctypes.c_double(now)
        flag = CVode(self.cvode_mem, target, self.x, ctypes.byref(reached), _ONE_STEP)
        failure, self._failure = self._failure, None
        if flag < 0:
            if failure is not None:
                raise failure
            why = self.error_info[3].rstrip(".") if self.error_info else f"CVode returns {flag}"
            raise ArithmeticError(" ".join(why.split()))
        self.set_time(reached.value)
        if not self.discrete:
            self.set_x(self.px, self.nx)
        return reached.value, flag == CV_ROOT_RETURN

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
        except BaseException as failure:
            self._failure = failure
            return _AGAIN if isinstance(failure, FMICallException) and failure.status == DISCARD else _FATAL
        self._failure = None
        return 0
