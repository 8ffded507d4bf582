"""The pressure equation: assembly with the free surface, and its multigrid conjugate-gradient solver."""
