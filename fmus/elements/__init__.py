"""Force-deformation laws of elements."""
