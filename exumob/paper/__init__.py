"""The paper's scenarios by name (`scenarios`), and their runs with the flow in the loop (`reference_runs`)."""
