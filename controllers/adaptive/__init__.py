"""Laws that learn while they run."""
