"""Participants: blocks and continuous systems, and the storage of their variables.

A participant is declared once (variables.py) and its equations are written once, as
kernels: methods that read and write `self`. All variables of an instance lie in one
storage of float64 slots, zone by zone:

    inputs | outputs | states | derivatives | locals | parameters

Called on the instance, a kernel is ordinary Python. In a compiled kernel
(cosim/codegen/kernels.py) `self` is the storage itself. Kernels see the zones as arrays
too: `input_vector`, `state_vector`, `derivative_vector`.
"""

from __future__ import annotations

import contextlib
import copy
import math
from collections.abc import Callable, Mapping
from numbers import Real
from types import NoneType
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ..arrays import Array
from ..errors import DeclarationError, did_you_mean
from .integrators import integrate_ode4, linear_hold
from .port import Direction, Port
from .variables import KINDS, Local, Parameter, Variable
from .whole_number import whole_number

#: the kernels, and how many of (t, h) each takes
KERNEL_TIMES = {"initialize": 0, "derivatives": 1, "outputs": 1, "advance": 2, "step": 2}
VECTORS = {"input_vector": "input", "state_vector": "state", "derivative_vector": "derivative"}
#: attributes that each instance owns and no copy may share
_BOUND = {"memory", "variables", "zones", "_views", *VECTORS}
_RESERVED = {*VECTORS, *KERNEL_TIMES, "every", "sample_period", "variables", "memory", "zones"}
#: names of sizes that a Continuous computes itself
_AUTOMATIC = {"n_states", "n_inputs_and_one", "n_hold"}


def _copied(value: Any) -> Any:
    """Return a copy; an object that cannot be copied, such as an open file, is shared."""
    with contextlib.suppress(TypeError):
        return copy.deepcopy(value)
    return value


def rate(where: str, every: Any, sample_period: Any) -> tuple[int | None, float | None]:
    """Return `every` and `sample_period` of a block, of which at most one may be given."""
    if every is not None and sample_period is not None:
        raise DeclarationError(f"{where}: give every or sample_period, not both")
    if sample_period is not None and not (
        isinstance(sample_period, Real) and math.isfinite(sample_period) and float(sample_period) > 0.0
    ):
        raise DeclarationError(f"{where}: sample_period={sample_period!r} s must be above zero")
    return (
        None if every is None else whole_number(f"{where}: every", every),
        None if sample_period is None else float(sample_period),
    )


class Participant:
    """The base of blocks and continuous systems: declared variables in one storage."""

    #: the names of the methods that are kernels, in the order in which a run uses them
    KERNELS: ClassVar[tuple[str, ...]] = ()
    #: False: the kernels contain Python that Numba cannot compile, and run as callbacks
    compiled: ClassVar[bool] = True
    #: locals that name the step for which matrices are kept; 0 in them makes `advance` compute anew
    CACHE_KEYS: ClassVar[tuple[str, ...]] = ()
    #: sizes by name, for those that neither a keyword nor an array gives
    DEFAULT_SIZES: ClassVar[Mapping[str, int]] = {}
    #: units by name, for those that no keyword gives
    DEFAULT_UNITS: ClassVar[Mapping[str, str]] = {}
    #: the contract of a component, see component.py
    as_block: bool = False
    every: int | None = None
    sample_period: float | None = None
    _declared: ClassVar[dict[str, Variable]] = {}
    #: the keywords that give a unit
    _unit_names: ClassVar[set[str]] = set()

    input_vector: Array
    state_vector: Array

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        declared: dict[str, Variable] = {}
        for base in reversed(cls.__mro__):
            for name, value in vars(base).items():
                if isinstance(value, Variable) and value.kind != "derivative":
                    declared[name] = value
                elif name in declared and not isinstance(value, Variable):
                    del declared[name]
        cls._declared = cls._complete(declared)
        cls._unit_names = set().union(*(v.unit_names for v in cls._declared.values()))
        sizes = {n for v in cls._declared.values() for n in v.shape}
        for name in cls._unit_names & (sizes | cls._declared.keys()):
            raise DeclarationError(f"{cls.__name__}: '{name}' names a unit and something else; rename one")
        for name, variable in cls._declared.items():
            if cls._is_reserved(name):
                raise DeclarationError(f"{cls.__name__}: '{name}' is a name of the base class; rename it")
            if not isinstance(variable.meaning, str):
                raise DeclarationError(
                    f"{cls.__name__}.{name}: its meaning {variable.meaning!r} must be a text; "
                    "write a start value as start="
                )
            if variable.kind == "derivative":
                setattr(cls, name, variable)
        for name in cls.KERNELS:
            kernel = vars(cls).get(name)
            wanted = ("self", "t", "h")[: 1 + KERNEL_TIMES[name]]
            code = getattr(kernel, "__code__", None)
            if kernel is not None and (code is None or code.co_argcount != len(wanted)):
                raise DeclarationError(f"{cls.__name__}.{name}: write it as def {name}({', '.join(wanted)})")

    @classmethod
    def _is_reserved(cls, name: str) -> bool:
        """Tell whether a name is a method or an attribute of the base classes."""
        bases = [base for base in cls.__mro__ if base.__module__ == __name__]
        return name in _RESERVED or any(
            not isinstance(vars(b).get(name, cls._declared[name]), Variable) for b in bases
        )

    @classmethod
    def _complete(cls, declared: dict[str, Variable]) -> dict[str, Variable]:
        """Return the declarations with those that follow from them."""
        return declared

    def __init__(self, **values: Any) -> None:
        sizes = self._sizes(values)
        units = {name: values.get(name, self.DEFAULT_UNITS.get(name)) for name in self._unit_names}
        for name, unit in units.items():
            if not isinstance(unit, (str, NoneType)):
                raise DeclarationError(f"{type(self).__name__}: {name}={unit!r} must be a unit, such as 'N'")
        self._layout(sizes, units)
        for name, variable in self.variables.items():
            self._assign(variable, values.get(name, variable.start))

    # ------------------------------------------------------------------ layout

    @classmethod
    def _sizes(cls, values: Mapping[str, Any]) -> dict[str, int]:
        """Resolve the names of sizes from given arrays and keywords; refuse unknown names."""
        where = cls.__name__
        symbols = {n for v in cls._declared.values() for n in v.shape if isinstance(n, str)} - _AUTOMATIC
        settable = [n for n, v in cls._declared.items() if v.kind not in ("derivative", "local")]
        sizes: dict[str, int] = {}
        for name, value in values.items():
            if name in cls._unit_names or (name in symbols and value is None):
                continue
            if name in symbols:
                sizes[name] = whole_number(f"{where}: size {name}", value)
            elif name not in settable:
                raise DeclarationError(
                    f"{where} has no parameter or variable '{name}'"
                    + did_you_mean(name, [*settable, *sorted(symbols | cls._unit_names)])
                )
        for name, value in values.items():
            if name not in cls._declared:
                continue
            shape = cls._declared[name].shape
            given = np.shape(value)
            if given == () and shape:
                continue
            if len(given) != len(shape):
                raise DeclarationError(
                    f"{where}.{name} has {len(shape)} dimensions {shape}, got an array of shape {given}"
                )
            for symbol, n in zip(shape, given, strict=True):
                wanted = symbol if isinstance(symbol, int) else sizes.setdefault(symbol, n)
                if wanted != n:
                    raise DeclarationError(
                        f"{where}.{name}: shape {given} does not fit {shape}: {symbol} is {wanted}, not {n}"
                    )
        sizes = {n: size for n, size in cls.DEFAULT_SIZES.items() if n in symbols} | sizes
        missing = symbols - sizes.keys()
        if missing:
            raise DeclarationError(
                f"{where}: size {', '.join(sorted(missing))} is not known; "
                f"give it as a keyword ({sorted(missing)[0]}=3) or give an array of that size"
            )
        return {**sizes, **cls._automatic_sizes(sizes)}

    @classmethod
    def _automatic_sizes(cls, sizes: Mapping[str, int]) -> dict[str, int]:
        """Return the sizes that follow from the others."""
        return {}

    def _layout(self, sizes: Mapping[str, int], units: Mapping[str, str | None]) -> None:
        """Lay the variables into zones and allocate the storage."""
        self.variables: dict[str, Variable] = {}
        slot = 0
        zones: dict[str, tuple[int, int]] = {}
        for kind in KINDS:
            first = slot
            for name, variable in self._declared.items():
                if variable.kind == kind:
                    shape = tuple(n if isinstance(n, int) else sizes[n] for n in variable.shape)
                    if any(n < 1 for n in shape):
                        raise DeclarationError(f"{type(self).__name__}.{name}: shape {shape} has no elements")
                    self.variables[name] = variable.resolved(shape, slot, units)
                    slot += self.variables[name].size
            zones[kind] = (first, slot - first)
        #: first slot and number of slots of each kind
        self.zones = zones
        self._bind(np.zeros(slot + 1))  # one spare slot, to which the vector of an empty zone refers

    def _bind(self, memory: Array) -> None:
        self.memory = memory
        self._views: dict[str, Array] = {}
        for name, v in self.variables.items():
            shape = tuple(int(n) for n in v.shape)
            self._views[name] = memory[v.slot : v.slot + v.size].reshape(shape)
        for name, (first, size) in self._vectors().items():
            setattr(self, name, memory[first : first + size])

    def _vectors(self) -> dict[str, tuple[int, int]]:
        """Return first slot and size of every vector; the spare slot for an empty zone."""
        spare = (self.memory.size - 1, 1)
        return {name: self.zones[kind] if self.zones[kind][1] else spare for name, kind in VECTORS.items()}

    @property
    def dtype(self) -> np.dtype[Any]:
        """The storage as a NumPy dtype; the vectors overlap the variables of their zone."""
        fields = {n: (v.slot, v.shape) for n, v in self.variables.items()}
        fields |= {n: (first, (size,)) for n, (first, size) in self._vectors().items()}
        return np.dtype(
            {
                "names": list(fields),
                "formats": [("f8", shape) if shape else "f8" for _, shape in fields.values()],
                "offsets": [8 * slot for slot, _ in fields.values()],
                "itemsize": 8 * self.memory.size,
            }
        )

    # ------------------------------------------------------------------ values

    def _get(self, name: str) -> Any:
        view = self._views[name]
        return view if view.ndim else float(view)

    def _set(self, name: str, value: Any) -> None:
        variable = self.variables[name]
        if variable.kind == "parameter":
            self._assign(variable, value)
        else:
            self._views[name][...] = value

    def _assign(self, variable: Variable, value: Any) -> None:
        where = f"{type(self).__name__}.{variable.name}"
        try:
            array = np.asarray(value, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise DeclarationError(
                f"{where} takes numbers of shape {variable.shape}, got {value!r}"
            ) from error
        if array.shape not in ((), variable.shape):
            raise DeclarationError(f"{where} has shape {variable.shape}, got {array.shape}")
        if np.isnan(array).any():
            raise DeclarationError(f"{where} is not a number; give finite values")
        if (array < variable.min).any() or (array > variable.max).any():
            raise DeclarationError(
                f"{where} = {value!r} is outside its bounds [{variable.min:g}, {variable.max:g}]"
            )
        if variable.whole and (array != np.floor(array)).any():
            raise DeclarationError(f"{where} = {value!r} must be a whole number")
        self._views[variable.name][...] = array

    def fresh(self) -> Participant:
        """Return a copy with a storage of its own, on which a run works, so that runs are repeatable."""
        other = copy.copy(self)
        other._bind(self.memory.copy())
        other.take_attributes(self.own_attributes())
        return other

    def own_attributes(self) -> dict[str, Any]:
        """Return copies of the instance's Python attributes, without the declared variables."""
        return {n: _copied(vars(self)[n]) for n in vars(self).keys() - _BOUND}

    def take_attributes(self, attributes: Mapping[str, Any]) -> None:
        """Replace the Python attributes by copies of those that `own_attributes` returned."""
        for name in vars(self).keys() - _BOUND - attributes.keys():
            delattr(self, name)
        for name, value in attributes.items():
            setattr(self, name, _copied(value))

    # ------------------------------------------------------------------- ports

    def ports(self, direction: Direction) -> dict[str, Port]:
        """Return the inputs, or the outputs and states, as ports."""
        kinds = ("input",) if direction == "input" else ("output", "state")
        return {
            name: Port("", name, v.shape, v.unit, count=v.size)  # type: ignore[arg-type]
            for name, v in self.variables.items()
            if v.kind in kinds
        }

    @property
    def declared_outputs(self) -> list[str]:
        """The names of the outputs and states."""
        return list(self.ports("output"))

    # ----------------------------------------------------------------- kernels

    @property
    def kernels(self) -> dict[str, Callable[..., None]]:
        """The kernels of this class by name."""
        return {name: getattr(type(self), name) for name in self.KERNELS if hasattr(type(self), name)}

    def __repr__(self) -> str:
        shown = ", ".join(
            f"{n}={self._get(n):g}" if not v.shape else f"{n}={v.shape}"
            for n, v in self.variables.items()
            if v.kind == "parameter" and not v.fixed
        )
        return f"{type(self).__name__}({shown})"


class Block(Participant):
    """A participant that acts at communication points: difference equations in `step(self, t, h)`.

    every
        acts at every `every`-th communication point and holds its outputs in between
    sample_period
        the same in seconds; it must be a multiple of the run's step

    Without either, the block acts at every communication point under sampled coupling,
    and at every solver stage under stage coupling.
    """

    KERNELS = ("initialize", "step")
    as_block = True

    def __init__(
        self, *, every: int | None = None, sample_period: float | None = None, **values: Any
    ) -> None:
        where = type(self).__name__
        if type(self).step is Block.step:
            raise DeclarationError(f"{where} has no step(self, t, h); a Block needs one")
        self.every, self.sample_period = rate(where, every, sample_period)
        super().__init__(**values)

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if "der" in cls.__dict__ or "derivatives" in cls.__dict__:
            raise DeclarationError(
                f"{cls.__name__}: a Block has no derivatives; write the next value of a state in "
                "step(self, t, h), or derive from Continuous for equations that hold between the steps"
            )

    def step(self, t: float, h: float) -> None:
        """Read the inputs at t, write the outputs that hold until the next call; h is the step."""
        raise NotImplementedError


class Continuous(Participant):
    """A participant with continuous state: differential equations.

    derivatives(self, t)
        writes `der_x` for every state `x` from states, inputs and parameters
    outputs(self, t)
        writes the outputs; runs after `derivatives` and may use `der_x`
    advance(self, t, h)
        advances the states from t to t + h with the inputs held. The default is the
        classical Runge-Kutta method (ode4) in equal substeps of at most `max_step`;
        a class with an exact solution overrides it.

    A class with an `advance` and without `derivatives`, such as an implicit method, runs
    under sampled coupling and can be exported as a Co-Simulation FMU; stage coupling
    refuses it.
    """

    KERNELS = ("initialize", "derivatives", "outputs", "advance")

    derivative_vector: Array

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """Stand for `der_x` of every state `x`, whose name a type checker cannot derive."""

    max_step = Parameter(np.inf, "largest internal step of advance", unit="s", min=1e-12, fixed=True)
    integrator_work = Local(0.0, "stages of advance", shape=(3, "n_states"))

    def __init__(self, **values: Any) -> None:
        if not hasattr(type(self), "derivatives") and type(self).advance is Continuous.advance:
            raise DeclarationError(
                f"{type(self).__name__} has no derivatives(self, t); a Continuous needs it, or an advance "
                "of its own (derive a class without continuous state from Block)"
            )
        super().__init__(**values)

    @classmethod
    def _complete(cls, declared: dict[str, Variable]) -> dict[str, Variable]:
        solver = next(base for base in cls.__mro__ if "advance" in vars(base))
        if "max_step" not in vars(solver):
            declared = {n: v for n, v in declared.items() if n not in ("max_step", "integrator_work")}
        derived: dict[str, Variable] = {}
        for name, state in declared.items():
            derived[name] = state
            if state.kind != "state":
                continue
            if f"der_{name}" in declared:
                raise DeclarationError(
                    f"{cls.__name__}: 'der_{name}' is the derivative of '{name}'; rename one of them"
                )
            if hasattr(cls, "derivatives"):
                unit = None if state.unit is None else f"({state.unit})/s"
                derived[f"der_{name}"] = Variable(
                    "derivative", 0.0, f"derivative of {name}", unit, state.shape, name=f"der_{name}"
                )
        return derived

    @classmethod
    def _automatic_sizes(cls, sizes: Mapping[str, int]) -> dict[str, int]:
        count = {"state": 0, "input": 0}
        for variable in cls._declared.values():
            if variable.kind in count:
                count[variable.kind] += math.prod(
                    n if isinstance(n, int) else sizes[n] for n in variable.shape
                )
        n, m = max(count["state"], 1), max(count["input"], 1)
        return {"n_states": n, "n_inputs_and_one": m + 1, "n_hold": n + m + 1}

    def advance(self, t: float, h: float) -> None:
        integrate_ode4(self, t, h)


class LinearContinuous(Continuous):
    """A Continuous with derivatives that are linear in states and inputs, with constant coefficients.

        x' = A x + B u + c

    `advance` is exact for the input held over [t, t + h], for any h:

        x(t + h) = e^(A h) x(t) + int_0^h e^(A s) ds (B u + c)

    A, B and c are read off `derivatives` (unit states, unit inputs) whenever h changes.
    """

    CACHE_KEYS = ("hold_step",)

    hold_step = Local(0.0, "step for which the hold matrices are valid", unit="s")
    hold_A = Local(0.0, "e^(A h), transposed", shape=("n_states", "n_states"))
    hold_B = Local(0.0, "int e^(A s) ds [B, c], transposed", shape=("n_inputs_and_one", "n_states"))
    hold_x = Local(0.0, "states at t", shape="n_states")
    hold_u = Local(0.0, "inputs at t", shape="n_inputs_and_one")
    hold_work = Local(0.0, "working memory of expm", shape=(4, "n_hold", "n_hold"))

    def advance(self, t: float, h: float) -> None:
        linear_hold(self, t, h)
