"""The core: declarations, participants in Python, the contract of a component, the time grid."""
