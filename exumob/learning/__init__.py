"""Training of networks for the loads of the water, from runs with the flow in the loop (paper, Sec. 3)."""
