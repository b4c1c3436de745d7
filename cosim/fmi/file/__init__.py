"""An .fmu file: archive, model description, display units, library."""
