"""The writer of the loop's LLVM IR: values, blocks, loops and checks.

It writes f-strings. `llvmlite.ir.IRBuilder` builds the same instructions as Python objects and
needs 30 times as long, for every run of every system: 0.25 s for 300 plants with a controller
each, a third of the time that the set-up of such a run takes.
"""

from __future__ import annotations

import struct
from collections.abc import Callable

INLINE = 8  # up to this many floats, an operation is unrolled; above, it is a loop


def number(x: float) -> str:
    """Return a float as LLVM reads it exactly."""
    return f"0x{struct.unpack('<Q', struct.pack('<d', x))[0]:016X}"


class Writer:
    """Writes operations in order; `exits` are the branches to the block that reports a failure."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.exits: list[tuple[str, int, str]] = []
        self.library: dict[str, str] = {}
        #: the block that is being written
        self.block = ""
        #: writes the End of every UnlessEvent and Repeat that is open
        self.ends: list[Callable[[], None]] = []
        #: the number of the substep, a double, inside a Repeat
        self.substep = ""
        #: the current operation: its number, and the places of its addresses in the table
        self.row = 0
        self.places: dict[str, int] = {}
        self._count = 0

    def write(self, line: str) -> None:
        """Write an instruction without a value."""
        self.lines.append(f"  {line}")

    def value(self, expression: str) -> str:
        """Write `%v = expression` and return %v."""
        self._count += 1
        self.lines.append(f"  %v{self._count} = {expression}")
        return f"%v{self._count}"

    # -------------------------------------------------------------------------- blocks

    def label(self) -> str:
        """Return a new block name."""
        self._count += 1
        return f"b{self._count}"

    def start_block(self, name: str) -> None:
        """Begin a block; the one before must have ended with a branch."""
        self.lines.append(f"{name}:")
        self.block = name

    def go_to(self, block: str) -> None:
        """End the block with a jump."""
        self.write(f"br label %{block}")

    def branch(self, condition: str, yes: str, no: str) -> None:
        """End the block with a jump that depends on an i1."""
        self.write(f"br i1 {condition}, label %{yes}, label %{no}")

    def when(
        self, condition: str, body: Callable[[], None], otherwise: Callable[[], None] | None = None
    ) -> None:
        """Write a body that runs if an i1 is true, and one that runs if it is false."""
        yes, on = self.label(), self.label()
        no = self.label() if otherwise else on
        self.branch(condition, yes, no)
        for block, write in ((yes, body), (no, otherwise)):
            if write is not None:
                self.start_block(block)
                write()
                self.go_to(on)
        self.start_block(on)

    def each(self, n: int, body: Callable[[int | str], None], inline: int = INLINE) -> None:
        """Write body(i) for i = 0 .. n - 1: unrolled, or as a loop for more than `inline`."""
        if n <= inline:
            for element in range(n):
                body(element)
            return
        before, loop, inside, end = self.block, self.label(), self.label(), self.label()
        self._count += 1
        i, following = f"%i{self._count}", f"%j{self._count}"
        self.go_to(loop)
        self.start_block(loop)
        self.write(f"{i} = phi i64 [ 0, %{before} ], [ {following}, %{inside} ]")
        self.branch(self.value(f"icmp slt i64 {i}, {n}"), inside, end)
        self.start_block(inside)
        body(i)
        self.write(f"{following} = add i64 {i}, 1")
        self.go_to(loop)
        self.start_block(end)

    # -------------------------------------------------------------------------- memory

    def address(self, name: str) -> str:
        """Load an address of the current operation from the table, by its name."""
        return self.load(self.value(f"getelementptr i64, ptr %table, i64 {self.places[name]}"), "ptr")

    def at(self, base: str, i: int | str, stride: int = 1, offset: int = 0) -> str:
        """Return the address of float `stride i + offset` at a pointer; i is a number or a value."""
        if isinstance(i, int):
            index = str(stride * i + offset)
        else:
            index = i if stride == 1 else self.value(f"mul i64 {i}, {stride}")
            index = index if offset == 0 else self.value(f"add i64 {index}, {offset}")
        return base if index == "0" else self.value(f"getelementptr double, ptr {base}, i64 {index}")

    def load(self, address: str, kind: str = "double") -> str:
        """Load a float, or a value of another type."""
        return self.value(f"load {kind}, ptr {address}")

    def store(self, value: str, address: str, kind: str = "double") -> None:
        """Store a float, or a value of another type."""
        self.write(f"store {kind} {value}, ptr {address}")

    def count_up(self, place: str) -> str:
        """Add 1 to the counter at an address; return its value before."""
        before = self.load(place, "i64")
        self.store(self.value(f"add i64 {before}, 1"), place, "i64")
        return before

    # ---------------------------------------------------------------------- arithmetic

    def add(self, x: str, y: str) -> str:
        """Return x + y."""
        return self.value(f"fadd double {x}, {y}")

    def multiply(self, x: str, y: str) -> str:
        """Return x y."""
        return self.value(f"fmul double {x}, {y}")

    def time(self, fraction: float, substeps: int = 1) -> str:
        """Return t_0 + (k + c) h: c is the fraction of a step, or of the present substep."""
        c = "" if fraction == 0.0 else number(fraction)
        if substeps > 1:
            c = self.multiply(self.add(self.substep, number(fraction)), number(1.0 / substeps))
        return self.add("%t0", self.multiply(self.add("%kf", c) if c else "%kf", "%h"))

    def step(self, every: int) -> str:
        """Return the step of an operation that runs at every n-th communication point."""
        return "%h" if every == 1 else self.multiply("%h", number(float(every)))

    # ---------------------------------------------------------------- calls and checks

    def call(self, kinds: str, *arguments: str, function: str = "function") -> str:
        """Call a function of the current operation with typed arguments; return its i32 status."""
        typed = ", ".join(f"{kind} {a}" for kind, a in zip(kinds.split(), arguments, strict=True))
        return self.value(f"call i32 {self.address(function)}({typed})")

    def call_back(self, name: str, t: str, h: str) -> None:
        """Call a callback of the current operation; go on if it did not fail."""
        self.check_status(self.call("ptr double double", "null", t, h, function=name))

    def call_library(self, name: str, text: str, arguments: str) -> str:
        """Call a function that is part of the loop's text; return its i64."""
        if self.library.setdefault(name, text) != text:
            raise AssertionError(f"internal error: two functions of the loop are named {name}")
        return self.value(f"call i64 @{name}({arguments})")

    def check(self, status: str) -> None:
        """Go on if the i64 status is 0, report it otherwise."""
        on = self.label()
        self.branch(self.value(f"icmp eq i64 {status}, 0"), on, "failed")
        self.exits.append((self.block, self.row, status))
        self.start_block(on)

    def check_status(self, status: str) -> None:
        """Go on if the i32 status of a kernel or callback is 0."""
        self.check(self.value(f"sext i32 {status} to i64"))

    def check_fmi(self, status: str) -> None:
        """Go on after fmiOK and fmiWarning; any other status, negative ones included, is a failure."""
        bad = self.value(f"icmp ugt i32 {status}, 1")
        code = self.value(f"select i1 {bad}, i32 {status}, i32 0")
        self.check(self.value(f"zext i32 {code} to i64"))

    def check_finite(self, address: str, n: int) -> None:
        """Report the first of n floats that is not finite; search for it only if there is one."""
        if n > INLINE:
            self._check_each(address, n)
        elif n > 0:
            any_bad = ""
            for i in range(n):
                bits = self.load(self.at(address, i), "i64")
                exponent = self.value(f"and i64 {bits}, {0x7FF0000000000000}")
                bad = self.value(f"icmp eq i64 {exponent}, {0x7FF0000000000000}")
                any_bad = self.value(f"or i1 {any_bad}, {bad}") if any_bad else bad
            self.when(any_bad, lambda: self._check_each(address, n))

    def _check_each(self, address: str, n: int) -> None:
        found = self.value(f"call i64 @nonfinite(ptr {address}, i64 {n})")
        self.check(self.value(f"sub i64 0, {found}"))
