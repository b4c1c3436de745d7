"""One file a coupling: each puts the operations of the instances of a system in order."""
