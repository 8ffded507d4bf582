"""What a broken run raises."""


class SimulationError(RuntimeError):
    """A run could not go on: says when, why and what to do. What was computed until then is kept by the caller."""
