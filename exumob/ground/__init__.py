"""Soil, terrain and the forces of soil on a wheel (paper, Sec. 2.2, Eqs. 3 to 5)."""
