"""From a kernel in Python to LLVM IR and native code."""
