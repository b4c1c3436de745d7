"""Sampled coupling, as with a digital controller: inputs are held over a communication step.

    at t_k      outputs of FMUs and Continuous participants, the result of the inputs held over
                [t_{k-1}, t_k]; blocks that are due, in the order of their connections; record
    to t_{k+1}  copy and latch all inputs; then advance every FMU and Continuous by h

A plant in a loop is never algebraic: with acceleration feedback y_k carries u_{k-1}. All
inputs are latched before anything advances, so the order of the components does not
matter. Where continuous participants drive each other directly, each holds the value of
the other at t_k: an error of first order in h.
"""

from __future__ import annotations

from ...loop.operations import Operation
from ..binding import Binding
from .schedule import Schedule


def sampled(binding: Binding) -> Schedule:
    """Return the schedule of sampled coupling."""
    instances = [(name, binding.instances[name]) for name in binding.moving]
    inputs = [op for name, i in instances for op in [*binding.copies(name), *i.latch()]]
    advance = [op for _, i in instances for op in i.advance()]
    return Schedule("sampled coupling", at_point(binding), [*inputs, *advance, *binding.pass_on])


def at_point(binding: Binding) -> list[Operation]:
    """Return the operations at a communication point."""
    instances = [binding.instances[name] for name in binding.moving]
    outputs = [op for i in instances for op in [*i.read(), *i.read_texts()]]
    return [*outputs, *(op for name in binding.blocks for op in binding.block(name))]
