"""The loop of a run: its operations, their text in LLVM IR, and the signals that end a run."""
