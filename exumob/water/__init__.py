"""The water: its depth and current, the interface of hydrodynamics models, hydrostatics and the coefficient model."""
