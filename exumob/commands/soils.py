"""The command `exumob soils`."""

from __future__ import annotations

import math

from rich import box
from rich.table import Table

from exumob.commands.shared import console


def soils_command() -> None:
    """List the published soils with their Bekker-Wong parameters."""
    from exumob.ground.soil import Soil

    table = Table(
        title="Published soils (Wong, Theory of Ground Vehicles)",
        caption="k_c in kN/m^(n+1), k_phi in kN/m^(n+2), c in kPa, phi in deg, K in mm\n"
        "* and all c1, c2: chosen by class of soil",
        box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0),
    )  # fmt: skip
    table.add_column("soil", no_wrap=True)
    for column in ("n", "k_c", "k_phi", "c", "phi", "K", "c1", "c2"):
        table.add_column(column, justify="right", no_wrap=True)
    for row in Soil.published_table():
        soil = row.soil
        shear = f"{1e3 * soil.shear_modulus_x:.0f}{'' if row.shear_modulus_published else '*'}"
        stiffness = f"{soil.k_c / 1e3:.4g}", f"{soil.k_phi / 1e3:.4g}"
        strength = f"{soil.cohesion / 1e3:.3g}", f"{math.degrees(soil.friction_angle):.1f}"
        table.add_row(
            row.name, f"{soil.n:g}", *stiffness, *strength, shear, *(f"{c:.2f}"[1:] for c in (soil.c1, soil.c2))
        )
    console.print(table)
