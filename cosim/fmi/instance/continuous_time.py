"""The functions of continuous-time mode for calls from Python; the loop calls them by address."""

from __future__ import annotations

import ctypes
from typing import Any

from ...result import SimulationError
from .driver import DISCARD, OK, WARNING, Driver


class ContinuousTime:
    """The time, states, derivatives and event indicators of a Model Exchange FMU.

    Vectors are addresses of floats or pointers to them, with n_states or n_indicators values. Every
    method raises SimulationError with the FMU's log if its function fails.
    """

    def __init__(self, driver: Driver, n_states: int, n_indicators: int) -> None:
        self.driver = driver
        self.n_states = n_states
        self.n_indicators = n_indicators
        #: the last time that was set, in s
        self.t = 0.0
        self._set_time = self._function("SetTime", ctypes.c_double)
        vector = (ctypes.c_void_p, ctypes.c_size_t)
        self._set_states = self._function("SetContinuousStates", *vector)
        self._get_states = self._function("GetContinuousStates", *vector)
        self._get_derivatives = self._function(driver.VERSION.get_derivatives, *vector)
        self._get_indicators = self._function("GetEventIndicators", *vector)
        self._get_nominals = self._function("GetNominalsOfContinuousStates", *vector)

    def _function(self, name: str, *kinds: Any) -> Any:
        kind = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, *kinds)
        return kind(self.driver.address(name, in_loop=False))

    def _done(self, status: int, what: str) -> None:
        if status not in (OK, WARNING):
            raise SimulationError(self.driver.logged(self.driver.failure(status, self.t, f" to {what}")))

    def set_time(self, t: float) -> None:
        """Set the time."""
        self.t = t
        self._done(self._set_time(self.driver.api.component, t), "set the time")

    def set_states(self, x: Any) -> None:
        """Set the states, if there are any."""
        if self.n_states:
            self._done(self._set_states(self.driver.api.component, x, self.n_states), "set its states")

    def get_states(self, x: Any) -> None:
        """Get the states, if there are any."""
        if self.n_states:
            self._done(self._get_states(self.driver.api.component, x, self.n_states), "get its states")

    def get_derivatives(self, target: Any) -> bool:
        """Get the derivatives; return False if the model discards the call to request a smaller step."""
        status = self._get_derivatives(self.driver.api.component, target, self.n_states)
        if status == DISCARD:
            return False
        self._done(status, "get its derivatives")
        return True

    def get_indicators(self, target: Any) -> None:
        """Get the event indicators, if there are any."""
        if self.n_indicators:
            status = self._get_indicators(self.driver.api.component, target, self.n_indicators)
            self._done(status, "get its event indicators")

    def get_nominals(self, target: Any) -> bool:
        """Get the nominal values of the states; return False if the model states none."""
        return self._get_nominals(self.driver.api.component, target, self.n_states) in (OK, WARNING)
