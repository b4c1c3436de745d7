"""An exported building, run with FMPy alone: the loop needs FMPy and the FMU, but not this project.

    cosim export building_in_fmpy:building --out building.fmu
    python building_in_fmpy.py building.fmu

`shake` is that loop. `cosim run building_in_fmpy` runs the same system here, with the same numbers.
"""

import math
import sys
from shutil import rmtree
from typing import Any

from fmpy import extract, read_model_description
from fmpy.simulation import instantiate_fmu

H, STEPS, DAMPING = 0.01, 1000, 40.0


def ground(t: float) -> float:
    """Return the acceleration of the ground, m/s^2: three seconds of shaking."""
    return 2.0 * math.sin(9.0 * t) if t < 3.0 else 0.0


def shake(path: str) -> list[float]:
    """Return the roof displacement at 0, H, 2 H, ..., m; a damper ties the roof to a fixed point."""
    description = read_model_description(path)
    reference = {v.name: v.valueReference for v in description.modelVariables}
    unpacked = extract(path)
    building = instantiate_fmu(unpacked, description, "CoSimulation")
    building.setupExperiment(startTime=0.0)
    building.enterInitializationMode()
    building.exitInitializationMode()
    inputs, roof = [reference["ground_acceleration"], reference["force[3]"]], []
    for k in range(STEPS + 1):
        x, v = building.getReal([reference["x[3]"], reference["v[3]"]])
        roof.append(x)
        building.setReal(inputs, [ground(k * H), -DAMPING * v])
        building.doStep(currentCommunicationPoint=k * H, communicationStepSize=H)
    building.terminate()
    building.freeInstance()
    rmtree(unpacked)
    return roof


def build() -> Any:
    """Return the same system; its participant `building` is the one to export."""
    from controllers.laws.viscous_dampers import ViscousDampers
    from cosim import System
    from cosim.blocks import function_source
    from fmus.plants.shear_building import ShearBuilding

    plant = ShearBuilding.build([3.0, 2.0, 1.5], [3000.0, 2000.0, 1000.0], 0.02)
    members = {"building": plant, "ground": function_source(ground), "damper": ViscousDampers(c=DAMPING, p=1)}
    links = [("building.v[3]", "damper.v"), ("damper.u", "building.force[3]")]
    return System(members, [("ground.y", "building.ground_acceleration"), *links])


def run() -> Any:
    """Run building and damper."""
    from cosim import simulate

    return simulate(build(), step=H, stop=STEPS * H)


if __name__ == "__main__":
    print(f"largest displacement of the roof: {max(map(abs, shake(sys.argv[1]))):.6f} m")
