"""State observers and estimators."""
