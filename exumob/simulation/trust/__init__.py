"""What a result is worth: which model of the water answered, how far it was off where that was measured, and of what
its error consists.
"""

from exumob.simulation.trust.judgement import Trust, trust_of, trust_of_all

__all__ = ["Trust", "trust_of", "trust_of_all"]
