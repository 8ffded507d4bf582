"""The vehicle as a redundant-coordinate Exudyn system with all loads applied to it (paper, Eq. 6)."""
