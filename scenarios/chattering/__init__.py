"""Chapter 4 of the thesis: six cases of chattering in sliding mode control."""
