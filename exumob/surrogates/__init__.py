"""Networks in place of the flow solver: input features, evaluation without torch, the hydrodynamics model."""
