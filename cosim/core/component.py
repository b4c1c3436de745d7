"""The contract of a component: anything that can take part in a system.

Blocks and continuous systems written in Python (participant.py) and FMUs (cosim/fmi/fmu.py)
keep it; so can any other class. A component is a description: it holds start values and
options, and a run does not change it. It is used in this order:

1. `System.add` gives it a name. `ports` is read there and at every later connection, so the
   ports stay the same from then on.
2. `System.connect` looks up ports by name, compares kind, shape and unit, and orders the
   components with `as_block` along their connections.
3. A run reads `declared_outputs`, unless the ports to record are given, and `every` and
   `sample_period` of the components with `as_block`.
4. The run makes one running instance of each component (cosim/run): of a participant in Python
   from its kernels and a copy of its storage (`fresh`), of an FMU from its file. The instance
   has separate memory, so that one component serves any number of runs, one after the other
   or at the same time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol, runtime_checkable

from .port import Direction, Port


@runtime_checkable
class Component(Protocol):
    """A component of a system; the module's text gives the order of the calls."""

    @property
    def as_block(self) -> bool:
        """True: acts at communication points, after its inputs are known. False: moves between them."""

    @property
    def every(self) -> int | None:
        """A block acts at every n-th communication point only; None where that is not given."""

    @property
    def sample_period(self) -> float | None:
        """The same in s; None where that is not given. At most one of the two is given."""

    @property
    def declared_outputs(self) -> Sequence[str]:
        """The names of the outputs of numbers that a run records by default."""

    def ports(self, direction: Direction) -> Mapping[str, Port]:
        """Return the ports that can be set ("input") or read ("output", states included), by name.

        Each port is whole (all of its values, no component). Two names of one port, such as
        the aliases of FMI 3.0, lead to the same port, which has one of them.
        """
