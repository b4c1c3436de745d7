"""Chapter 4 of the thesis: chattering of sliding mode control in six cases."""
