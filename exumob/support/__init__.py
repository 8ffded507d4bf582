"""Helpers without physics: checks of input, errors, constants, files, provenance, smoothing, the Exudyn build."""
