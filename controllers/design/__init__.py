"""Models and designs: state space, reduction, Riccati equations, sliding surfaces."""
