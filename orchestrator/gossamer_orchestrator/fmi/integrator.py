"""CVode of SUNDIALS around the equations of one or more FMUs for model exchange, through FMPy."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable, Sequence
from typing import Any, Protocol

from fmpy.fmi1 import FMICallException
from fmpy.sundials import CV_ROOT_RETURN, CVode, CVodeSolver
from fmpy.sundials.cvode import sundials_cvode
from fmpy.sundials.libraries import sundials_core
from fmpy.sundials.sundials_context import SUNContext_PushErrHandler
from fmpy.sundials.sundials_types import SUNContext

from ..errors import SimulationError
from .slave import DISCARD

_set_stop_time = sundials_cvode["CVodeSetStopTime"]
_set_stop_time.argtypes = [ctypes.c_void_p, ctypes.c_double]
_clear_handlers = sundials_core["SUNContext_ClearErrHandlers"]
_clear_handlers.argtypes = [SUNContext]
_ONE_STEP = 2  # CV_ONE_STEP, which FMPy lacks
_FATAL, _AGAIN = -1, 1  # what a function that CVode calls returns when it fails, and when a smaller step may help


class System(Protocol):
    """What is integrated as one: FMUs whose states stand one after another."""

    def enter(self, part: int) -> Any:  # noqa: ANN401
        """Note that an FMU is about to be called, and return FMPy's instance of it."""

    @property
    def exchange(self) -> Callable[[], object]:
        """Brings the inputs to what the FMUs send each other at the time and the states that were set."""


class _NoInputs:
    """FMPy's solver sets inputs as functions of time with this; ours come from ``System.exchange``."""

    def apply(self, _time: float) -> None:
        """Do nothing."""


class Integrator(CVodeSolver):  # type: ignore[misc]
    """Integrate FMUs.

    Parameters
    ----------
    system : System
        FMUs in continuous-time mode.
    descriptions : sequence of fmpy.model_description.ModelDescription
        Of each, as read by FMPy.
    time : float
        Present time [s].
    tolerance : float
        Relative tolerance; the absolute one is that of the states' nominal values.
    """

    def __init__(self, system: System, descriptions: Sequence[Any], time: float, tolerance: float) -> None:
        self._system = system
        self._failure: BaseException | None = None
        self._states, self._indicators, self._derivatives = [], [], []
        for i, description in enumerate(descriptions):
            model, three = system.enter(i), description.fmiVersion.startswith("3")
            self._states.append(model.getNumberOfContinuousStates() if three else description.numberOfContinuousStates)
            self._indicators.append(model.getNumberOfEventIndicators() if three else description.numberOfEventIndicators)
            self._derivatives.append("getContinuousStateDerivatives" if three else "getDerivatives")
        super().__init__(
            nx=sum(self._states),
            nz=sum(self._indicators),
            get_x=lambda x, _: self._each("getContinuousStates", self._states, x),
            set_x=lambda x, _: self._each("setContinuousStates", self._states, x),
            get_dx=self._get_derivatives,
            get_z=self._get_indicators,
            get_nominals=lambda x, _: self._each("getNominalsOfContinuousStates", self._states, x),
            set_time=self._set_time,
            input=_NoInputs(),
            startTime=time,
            relativeTolerance=tolerance,
            maxNumSteps=100_000,
        )
        _clear_handlers(self.sunctx)  # the first of them prints
        SUNContext_PushErrHandler(self.sunctx, self.ehfun_, None)

    def _each(self, methods: str | Sequence[str], sizes: Sequence[int], values: Any) -> None:  # noqa: ANN401
        """Call a method of every FMU that has any of the values, with the place of its own."""
        first = 0
        for i, size in enumerate(sizes):
            if size:
                method = methods if isinstance(methods, str) else methods[i]
                getattr(self._system.enter(i), method)(ctypes.byref(values.contents, 8 * first), size)
            first += size

    def _get_derivatives(self, dx: Any, _: int) -> None:  # noqa: ANN401
        self._system.exchange()
        self._each(self._derivatives, self._states, dx)

    def _get_indicators(self, z: Any, _: int) -> None:  # noqa: ANN401
        self._system.exchange()
        self._each("getEventIndicators", self._indicators, z)

    def _set_time(self, time: float) -> None:
        for i in range(len(self._states)):
            self._system.enter(i).setTime(time)

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
        SimulationError
            An exchange failed.
        ArithmeticError
            The integrator cannot go on.
        """
        if anew:
            self.reset(now)
        nearest = 4.0 * sys.float_info.epsilon * max(abs(now), abs(target))
        if target - now <= nearest or (self.discrete and not self.nz):
            self.set_time(max(now, target))
            return max(now, target), False
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
            discarded = isinstance(failure, SimulationError) and failure.discarded  # by an exchange
            discarded |= isinstance(failure, FMICallException) and failure.status == DISCARD
            return _AGAIN if discarded else _FATAL
        self._failure = None
        return 0
