"""Surrogates of the water's loads, learned from runs with the flow in the loop (paper, Sec. 3)."""
