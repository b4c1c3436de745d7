"""The cache of exported FMUs: changes that make another file, and changes that do not."""

from __future__ import annotations

from cosim import Block, Input, Output, Parameter
from fmus.export.cached import as_fmu, cache_key

SOURCE = """
class Gain(Block):
    '''One text'''

    K = Parameter(2.0, "gain", unit="N/m")
    x = Input("displacement", unit="m")
    u = Output("force", unit="N")

    def step(self, t, h):
        '''Another text'''
        self.u = scaled(self.K, self.x)  # and a comment

def scaled(K, x):
    '''A third text'''
    return K * x
"""


def gain(*changes: tuple[str, str]) -> Block:
    """An instance of the class above after changes to its source."""
    source = SOURCE
    for old, new in changes:
        assert old in source
        source = source.replace(old, new)
    names = {"Block": Block, "Input": Input, "Output": Output, "Parameter": Parameter, "__name__": "plant"}
    exec(source, names)
    block: Block = names["Gain"]()
    return block


def test_words_do_not_make_another_fmu() -> None:
    key = cache_key(gain())
    assert cache_key(gain(("One text", "x"), ("Another text", "y"), ("A third text", "z"))) == key
    assert cache_key(gain(("# and a comment", ""))) == key


def test_what_the_fmu_contains_makes_another_one() -> None:
    changes = [
        ("K * x", "K * x * 2.0"),
        ("2.0,", "3.0,"),
        ('unit="N/m"', 'unit="kN/m"'),
        ('"displacement"', '"stroke"'),
        ("class Gain", "Other = None\n\nclass Gain"),
    ]
    keys = [cache_key(gain(change)) for change in changes]
    assert len({cache_key(gain()), *keys[:-1]}) == len(changes)
    assert keys[-1] == cache_key(gain())


def test_units_in_the_file_are_those_of_the_declaration() -> None:
    """A change of the unit alone once returned the old file."""
    for unit in ("m", "mm"):
        fmu = as_fmu(gain(('unit="m"', f'unit="{unit}"')))
        assert fmu.input_ports["x"].unit == unit
