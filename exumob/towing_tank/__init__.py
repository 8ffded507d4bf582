"""Captive runs: a vehicle on a prescribed path through the flow.

``captive_run(vehicle, water, CaptiveMotion(speed=1.0))`` returns the loads of the water on its five bodies.
"""

from typing import TYPE_CHECKING

from exumob.support.lazy import on_first_use

if TYPE_CHECKING:
    from exumob.towing_tank.motion import CaptiveMotion, PrescribedMotion
    from exumob.towing_tank.record import captive_summary
    from exumob.towing_tank.run import captive_run
else:
    __getattr__, __dir__ = on_first_use(__name__)

__all__ = ["CaptiveMotion", "PrescribedMotion", "captive_run", "captive_summary"]
