"""Chapter 2 of the thesis: the 76-story building in wind, with an active tuned mass damper."""
