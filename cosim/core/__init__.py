"""Declarations: variables, participants, the time grid."""
