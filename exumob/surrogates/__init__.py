"""Networks in place of the flow solver: their inputs, their evaluation without torch, the model in the loop."""
