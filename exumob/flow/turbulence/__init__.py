"""Eddy viscosity: Smagorinsky, k-omega SST, wall functions."""
