"""Components by name and the connections between their ports."""
