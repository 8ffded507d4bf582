"""Coupling of vehicle and water (paper, Sec. 2.3): schemes, the interface of flow codes, the flow in the loop."""
