"""What the loop runs: operations, how they are written as LLVM IR, and what ends a run."""
