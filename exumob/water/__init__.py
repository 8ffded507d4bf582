"""The water, the interface of all models of its loads, and the reduced-order model (hydrostatics and coefficients)."""
