"""A run: plan, instances, coupling, recording, result."""
