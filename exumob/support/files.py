"""Places of the package's own files."""

from pathlib import Path

PACKAGE = Path(__file__).parents[1]
"""The folder `exumob` of this installation."""
