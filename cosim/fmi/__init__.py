"""FMUs as components of a system: FMI 2.0 and 3.0, Co-Simulation and Model Exchange.

The terms of this package, from the outside to the inside:

    FMU              the component that a user writes: a file, start values, an interface with options
    FMUFile          the part of it that is read from the file: description, variables as ports
    FMUInstance      an FMU in a run: buffers, and operations for the loop
    Driver           one instance of the FMU's code, driven call by call; the doctor uses it, too
    api              FMPy's object with the functions of FMI

    file/            archive, model description, display units, shared library
    instance/        instances and drivers
    isolation/       an FMU in a process of its own
"""
