"""The integrator CVODE (SUNDIALS, from FMPy): variable step and order, for stiff models, with roots."""

from __future__ import annotations

import ctypes
import math
from typing import Any

import numpy as np
from fmpy.sundials import CVodeSolver
from fmpy.sundials.cvode import CV_ROOT_RETURN, CVode, CVodeReInit, sundials_cvode
from fmpy.sundials.libraries import sundials_core
from fmpy.sundials.nvector_serial import NV_DATA_S
from fmpy.sundials.sundials_context import SUNContext_PushErrHandler

from ...result import SimulationError
from .continuous_time import ContinuousTime

#: tolerance of an internal step, as a fraction of the requested tolerance
TIGHTER = 1e-3
_LEAST = 1e-13  # a few hundred times the rounding of floats, the least tolerance of CVODE
_ONE_STEP = 2  # CV_ONE_STEP: return after every internal step

_set_stop_time = sundials_cvode.CVodeSetStopTime
_set_stop_time.argtypes = [ctypes.c_void_p, ctypes.c_double]

_no_warnings = sundials_cvode.CVodeSetMaxHnilWarns
_no_warnings.argtypes = [ctypes.c_void_p, ctypes.c_int]


def _free(function: str, *objects: Any) -> None:
    release = getattr(sundials_core, function)
    release.argtypes, release.restype = [ctypes.c_void_p], None
    for each in objects:
        release(each)


class Cvode(CVodeSolver):
    """The backward differentiation formulas of CVODE for one model, one internal step at a time.

    Errors of the model are kept and raised when CVODE returns, because an exception in a
    callback from C would be printed and ignored.

    CVODE controls the error of an internal step, and starts at order one. Restarted at
    every communication point, it takes many small steps there, whose errors add up over a
    run. So its steps are controlled TIGHTER than `tolerance`, at twice the work. (Van der
    Pol oscillator, 20 s, 2000 restarts, tolerance 1e-6: the error is 2e-5, and 1e-2 otherwise.)
    The absolute tolerance of a state is its nominal value times the relative tolerance.
    """

    def __init__(self, model: ContinuousTime, t: float, tolerance: float) -> None:
        self.model = model
        self.exception: BaseException | None = None
        super().__init__(
            nx=model.n_states,
            nz=model.n_indicators,
            get_x=lambda x, n: model.get_states(x),
            set_x=lambda x, n: model.set_states(x),
            get_dx=None,
            get_z=None,
            get_nominals=self._nominals,
            set_time=model.set_time,
            input=None,
            startTime=t,
            relativeTolerance=max(TIGHTER * tolerance, _LEAST),
        )
        _no_warnings(self.cvode_mem, -1)  # of steps below rounding, which EventSteps detects
        # the error raised here contains the message that SUNDIALS would print
        sundials_core.SUNContext_ClearErrHandlers(self.sunctx)
        SUNContext_PushErrHandler(self.sunctx, self.ehfun_, None)

    def __del__(self) -> None:
        """Free the objects that FMPy leaves, in the order of SUNDIALS: integrator, its parts, context."""
        if not hasattr(self, "LS"):
            return
        super().__del__()
        _free("SUNLinSolFree", self.LS)
        _free("SUNMatDestroy", self.A)
        _free("N_VDestroy", self.x, self.abstol)
        _free("SUNContext_Free", ctypes.byref(self.sunctx))

    def _nominals(self, target: Any, n: int) -> None:
        values = np.ctypeslib.as_array(target, (n,))
        stated = self.model.get_nominals(target)
        values[:] = np.where(stated & np.isfinite(values) & (values > 0.0), values, 1.0)

    def f(self, t: float, y: Any, ydot: Any, user_data: Any) -> int:
        """Evaluate the derivatives; return 0, 1 to request a smaller step, or -1 to stop."""
        try:
            self.model.set_time(t)
            target = NV_DATA_S(ydot)
            if self.discrete:
                target[0] = 0.0
                return 0
            self.model.set_states(NV_DATA_S(y))
            fine = self.model.get_derivatives(target)
            return 0 if fine and all(map(math.isfinite, target[: self.nx])) else 1
        except BaseException as exception:
            self.exception = exception
            return -1

    def g(self, t: float, y: Any, gout: Any, user_data: Any) -> int:
        """Evaluate the event indicators; return 0, or -1 to stop."""
        try:
            self.model.set_time(t)
            self.model.set_states(NV_DATA_S(y))
            self.model.get_indicators(gout)
            return 0
        except BaseException as exception:
            self.exception = exception
            return -1

    def restart(self, t: float) -> None:
        """Restart at t from the states of the model, without memory of earlier steps."""
        self.model.get_states(self.px)
        CVodeReInit(self.cvode_mem, t, self.x)

    def step(self, t: float, until: float) -> tuple[float, bool]:
        """Take one internal step, at most to `until`; return the time reached, and whether it is a root.

        The model is then at that time, with its states set.
        """
        reached = ctypes.c_double(t)
        _set_stop_time(self.cvode_mem, until)
        flag = CVode(self.cvode_mem, until, self.x, ctypes.byref(reached), _ONE_STEP)
        if self.exception is not None:
            raise self.exception
        if flag < 0:
            raise SimulationError(self._failure(flag, reached.value))
        self.model.set_time(reached.value)
        self.model.set_states(self.px)
        return reached.value, flag == CV_ROOT_RETURN

    def _failure(self, flag: int, t: float) -> str:
        text = f": {self.error_info[3]}" if self.error_info else ""
        return (
            f"{self.model.driver.name}: cvode cannot continue from t = {t:g} s (code {flag}{text}); check "
            "the inputs before that time, the model's states for a singularity, and the tolerance"
        )
