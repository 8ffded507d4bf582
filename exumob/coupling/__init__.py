"""The flow and the vehicle together (paper, Sec. 2.3): schemes, the interface of flow codes, the flow in the loop."""
