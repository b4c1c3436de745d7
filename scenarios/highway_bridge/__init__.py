"""Chapter 3 of the thesis: the 91/5 highway bridge in six earthquakes."""
