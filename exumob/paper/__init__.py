"""The scenarios of the paper, by name, and their runs with the flow in the loop."""
