"""Drive the vehicle with a flow code in another process; start `stand_in.py`, or your own, first."""

import argparse

from exumob import Soil, Water, lane_change, simulate, summary
from exumob.coupling.flow_in_loop import CfdHydrodynamics
from exumob.coupling.remote import RemoteFlow
from exumob.coupling.semi_implicit import SemiImplicit
from vehicle_models.amphibious import amphibious_vehicle


def main() -> None:
    """Two seconds of the lane change in 60 % depth against 1 m/s."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--port", type=int, default=5005)
    parser.add_argument("--duration", type=float, default=2.0, help="[s]")
    chosen = parser.parse_args()
    flow = RemoteFlow("localhost", chosen.port, parameters={"code": "stand-in"})
    result = simulate(
        amphibious_vehicle(), Soil.published("LETE sand"), Water.at_ratio(0.6, current_speed=1.0), lane_change(),
        CfdHydrodynamics(flow), duration=chosen.duration, coupling=SemiImplicit(),
    )  # fmt: skip
    flow.close()
    print(summary(result))
    print("advances of the flow a macro step:", float(result["coupling_iterations"].mean()))


if __name__ == "__main__":
    main()
