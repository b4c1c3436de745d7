"""Chapter 2 of the thesis: the 76-story building in wind."""
