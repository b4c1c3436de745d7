"""Drive one participant by hand, interpreted and compiled, and keep its whole memory at every step."""

from __future__ import annotations

import numpy as np

from cosim import Array, Block, Participant
from cosim.codegen.kernels import kernel_addresses
from cosim.core.participant import KERNEL_TIMES
from cosim.loop.signals import KERNEL


def drive(participant: Participant, inputs: Array, h: float, jit: bool) -> Array:
    """Run the kernels over inputs (r, m) at t = k h; return the memory after every step, (r, slots)."""
    p = participant.fresh()
    names = ["step"] if isinstance(p, Block) else ["derivatives", "outputs", "advance"]
    if jit:
        found = kernel_addresses(p)
        functions = {n: KERNEL(address) for n, address in found.items()}
        kernels = {n: (lambda t, h, n=n: functions[n](p.memory.ctypes.data, t, h)) for n in found}
    else:
        kernels = {n: (lambda t, h, n=n: getattr(p, n)(*(t, h)[: KERNEL_TIMES[n]])) for n in p.kernels}
    if "initialize" in kernels:
        kernels["initialize"](0.0, 0.0)
    rows = []
    for k, u in enumerate(np.asarray(inputs, dtype=np.float64)):
        if u.size:
            p.input_vector[:] = u
        for name in names:
            if name in kernels:
                assert not kernels[name](k * h, h)
        rows.append(p.memory.copy())
    return np.array(rows)


def trace(participant: Participant, inputs: Array, h: float, port: str, jit: bool = False) -> Array:
    """Return one port of the driven participant, (r, size)."""
    v = participant.variables[port]
    return drive(participant, inputs, h, jit)[:, v.slot : v.slot + v.size]


def assert_same_bits(participant: Participant, inputs: Array, h: float) -> None:
    """Interpreted and compiled leave the same bits in every slot at every step."""
    interpreted, compiled = (drive(participant, inputs, h, jit) for jit in (False, True))
    different = np.nonzero((interpreted.view(np.int64) != compiled.view(np.int64)).any(axis=0))[0]
    names = {
        n
        for n, v in participant.variables.items()
        if np.isin(different, range(v.slot, v.slot + v.size)).any()
    }
    assert not names, f"{participant!r}: {names} differ"
