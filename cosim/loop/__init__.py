"""The loop of a run: its operations, their LLVM IR, and the signals that end a run."""
