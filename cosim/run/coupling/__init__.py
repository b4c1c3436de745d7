"""The couplings, one file each: they put the operations of the instances of a system in order."""
