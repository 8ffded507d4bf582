"""Bekker-Wong parameters of a soil, your own or published. SI units and radians."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

import numpy as np

from exumob.ground.published_soils import MEASURED_DRY, NOT_UNDER_WATER, SOIL_CLASSES, WETTER, WONG_TABLE
from exumob.support.declared import Declared, checked, nearest_names
from exumob.support.quantities import ImplausibleValue, Quantity, Unusual, shown

SOIL_RECORD = np.dtype(
    [
        ("k_c", "f8"),
        ("k_phi", "f8"),
        ("n", "f8"),
        ("cohesion", "f8"),
        ("tan_friction_angle", "f8"),
        ("shear_modulus_x", "f8"),
        ("shear_modulus_y", "f8"),
        ("c1", "f8"),
        ("c2", "f8"),
        ("rebound_ratio", "f8"),
        ("damping", "f8"),
        ("reece_pressure", "?"),  # pressure_form "reece"
        ("shear_resultant", "?"),  # shear_limit "resultant"
    ],
    align=True,
)
"""A `Soil` as compiled code sees it; names and units of the fields are those of `Soil`."""

WIDEST_PUBLISHED = 0.16
"""Largest k_c / k_phi of the published soils, that of Snow (Sweden) [m]: the width at which both carry the same."""
WIDEST = 1.0
"""Largest plausible k_c / k_phi [m]; of no published soil it is the other way round, k_phi / k_c is 6 1/m or more."""


@dataclass(frozen=True)
class Soil(Declared):
    """A soil, described by its Bekker-Wong parameters in SI units.

    `pressure_form` chooses the normal pressure under a plate of width b that has sunk by z:

    - ``"bekker"``: (k_c / b + k_phi) z^n, paper Eq. (3); k_c [N/m^(n+1)], k_phi [N/m^(n+2)].
    - ``"reece"``: (k_c + k_phi b) (z / b)^n, Reece (1965) as in Wong & Reece (1967); k_c [Pa], k_phi [Pa/m].

    `shear_limit` chooses how the shear stress in the contact patch, paper Eq. (4) after Janosi & Hanamoto (1961), is
    bounded by the strength c + sigma tan(phi):

    - ``"per_axis"``: longitudinal and lateral shear each reach the strength on their own (the paper).
    - ``"resultant"``: their resultant reaches it, along the resultant shear displacement (Wong & Chiang, Proc. IMechE
      D 215 (2001) 343, for skid steering); never more than the strength in any direction.

    Raises
    ------
    ValueError
        If a value is not finite or outside its range.
    """

    k_c: Annotated[float, Quantity("N/m^(n+1)", at_least=0.0, at_most=1e12, plausible=(0.0, 1e8))]
    """Pressure-sinkage modulus that acts over the width; its unit depends on n and `pressure_form`, see above"""
    # no lower end: it is small beside k_phi in many soils, and k_phi tells kilonewtons from newtons
    k_phi: Annotated[float, Quantity("N/m^(n+2)", at_least=0.0, at_most=1e12, plausible=(6e3, 1e10))]
    """Pressure-sinkage modulus that does not depend on the width; not 0 if `k_c` is"""
    # the lower end is just above the largest that is published in kN/m^(n+2), 5880
    n: Annotated[float, Quantity("1", above=0.0, at_most=3.0, remedy="published exponents lie between 0.1 and 1.7.")]
    """Sinkage exponent"""
    cohesion: Annotated[float, Quantity("Pa", at_least=0.0, at_most=1e8, plausible=(70.0, 1e6))]
    """Cohesion c"""
    # the lower end is just above the largest that is published in kPa, 68.95
    friction_angle: Annotated[float, Quantity("rad", at_least=0.0, at_most=math.radians(80.0))]
    """Angle of internal friction phi"""
    shear_modulus_x: Annotated[float, Quantity("m", above=0.0, plausible=(2e-4, 0.5))]
    """Shear deformation modulus K_x along the wheel: the displacement at which 63 % of the strength is mobilised"""
    shear_modulus_y: Annotated[float, Quantity("m", above=0.0, plausible=(2e-4, 0.5))]
    """The same across the wheel, K_y"""
    c1: Annotated[float, Quantity("1", at_least=0.0, at_most=1.0)]
    """Coefficient of the angle of maximum pressure, (c1 + c2 |slip_ratio|) entry_angle; c1 + c2 <= 1"""
    c2: Annotated[float, Quantity("1", at_least=0.0, at_most=1.0)]
    """Coefficient of the angle of maximum pressure with slip"""
    rebound_ratio: Annotated[float, Quantity("1", at_least=0.0, at_most=1.0)] = 0.0
    """Elastic recovery of the sinkage behind the wheel over the sinkage, kappa"""
    damping: Annotated[float, Quantity("s/m", at_least=0.0, at_most=1e3)] = 0.8
    """Normal damping: the pressure is multiplied by 1 + damping * (rate of sinkage), never below 0
    (the form of Hunt & Crossley, J. Appl. Mech. 42 (1975) 440: no jump of the force at touch-down). Real soil
    dissipates energy, which the Bekker pressure alone does not. The default is chosen by us: it damps a 2 kg wheel
    assembly (diameter 0.2 m, width 0.08 m) on LETE sand under 140 N at 20 % of critical"""
    name: str = ""
    """Name in messages and results"""
    pressure_form: Literal["bekker", "reece"] = "bekker"
    """Form of the normal pressure, see above"""
    shear_limit: Literal["per_axis", "resultant"] = "per_axis"
    """Limit of the shear stress, see above"""

    def _check(self) -> None:
        if self.k_c == 0.0 and self.k_phi == 0.0:
            raise ValueError(
                "Soil.k_c = 0 and Soil.k_phi = 0: such a soil carries no load; give at least one of them > 0."
            )
        swapped = self.k_phi > 0.0 and self.k_c > WIDEST * self.k_phi and self.pressure_form == "bekker"
        if swapped and not (isinstance(self.k_c, Unusual) or isinstance(self.k_phi, Unusual)):
            raise ImplausibleValue(
                f"Soil.k_c = {self.k_c:g} and Soil.k_phi = {self.k_phi:g}: k_c / k_phi = {self.k_c / self.k_phi:.3g} "
                f"m, and no published soil has more than {WIDEST_PUBLISHED:g} m ({WIDEST:g} m passes); are they "
                f"swapped? If they are meant: k_c=unusual({self.k_c:g}) in Python, --unusual at the command line."
            )
        if self.c1 + self.c2 > 1.0 + 1e-12:
            raise ValueError(
                f"Soil.c1 + Soil.c2 = {self.c1 + self.c2:g} must be <= 1: at full slip the maximum pressure would lie "
                "ahead of the entry angle; published pairs are (0.43, 0.32), (0.18, 0.32), (0.3, 0.4), (0.4, 0.15)."
            )

    @checked
    def pressure(
        self,
        sinkage: Annotated[
            float, Quantity("m", at_least=0.0, at_most=1e3, negative="a plate that does not touch has no pressure.")
        ],
        width: Annotated[float, Quantity("m", at_least=1e-6, at_most=1e6)],
    ) -> float:
        """Return the pressure under a flat plate [Pa].

        Parameters
        ----------
        sinkage : float
            Depth of the plate below the undisturbed surface [m], >= 0.
        width : float
            Smaller side of the plate [m], > 0.
        """
        if self.pressure_form == "reece":
            return (self.k_c + self.k_phi * width) * (sinkage / width) ** self.n
        return (self.k_c / width + self.k_phi) * sinkage**self.n

    def as_record(self) -> np.ndarray:
        """Return the parameters for compiled code, an array of dtype `SOIL_RECORD`, shape (1,).

        Kernels take its element 0.
        """
        derived = {
            "tan_friction_angle": math.tan(self.friction_angle),
            "reece_pressure": self.pressure_form == "reece",
            "shear_resultant": self.shear_limit == "resultant",
        }
        record = np.zeros(1, SOIL_RECORD)
        for name in SOIL_RECORD.names or ():
            record[name] = derived[name] if name in derived else getattr(self, name)
        return record

    @classmethod
    @checked
    def published(cls, name: str) -> Soil:
        """Return one of the 23 soils of `published_table` by its name in the table.

        Raises
        ------
        ValueError
            If no soil has this name; the message gives the nearest names.
        """
        for row in _PUBLISHED:
            if row.name.casefold() == name.strip().casefold():
                return row.soil
        near = nearest_names(name.strip(), [row.name for row in _PUBLISHED])
        hint = f"did you mean {' or '.join(map(repr, near))}? There are more" if near else "use one of those"
        raise ValueError(
            f"Soil.published: no soil is called {shown(name)}; {hint} in `exumob soils` (Soil.published_table)."
        )

    @staticmethod
    def published_table() -> tuple[PublishedSoil, ...]:
        """Return all published soils with the provenance of every value, in the order of the source."""
        return _PUBLISHED


class PublishedSoil(NamedTuple):
    """A row of the table of published soils."""

    name: str
    soil: Soil
    shear_modulus_published: bool
    """True: K stands in the source; False: chosen by the rule in `source`"""
    source: str
    """The origin of each value, in words"""

    @property
    def moisture(self) -> float:
        """Moisture at which it was measured [-], over the dry mass; 0: dry, nan: not said."""
        found = re.search(r"(\d+) %$", self.name)
        if found is not None:
            return 0.01 * float(found[1])
        return 0.0 if self.name in MEASURED_DRY else math.nan

    @property
    def under_water(self) -> str:
        """How far its values hold under water, where soil is saturated, in words; no source measured it so."""
        if self.name in NOT_UNDER_WATER:
            return "was never measured under water"
        if self.moisture == 0.0:
            return "was measured dry"
        measured = f"was measured at {100.0 * self.moisture:.0f} % moisture"
        if self.name in WETTER:
            return f"{measured}; {WETTER[self.name]!r} is the same soil wetter"
        return f"{measured}, the wettest published"


def _kilo(text: str) -> float:
    return round(1e3 * float(text), 6)


def _published() -> tuple[PublishedSoil, ...]:
    rows = []
    for line in WONG_TABLE.splitlines():
        name, n, k_c, k_phi, cohesion, friction, modulus, kind = (cell.strip() for cell in line.split("|"))
        default_modulus, c1, c2, why = SOIL_CLASSES[kind]
        shear_modulus = float(modulus) if modulus else default_modulus
        soil = Soil(
            k_c=_kilo(k_c), k_phi=_kilo(k_phi), n=float(n), cohesion=_kilo(cohesion),
            friction_angle=math.radians(float(friction)), shear_modulus_x=shear_modulus, shear_modulus_y=shear_modulus,
            c1=c1, c2=c2, name=name,
        )  # fmt: skip
        if modulus and "; " in why:
            why = why.split("; ", 1)[1]
        known = "n, k_c, k_phi, c, phi, K" if modulus else "n, k_c, k_phi, c, phi"
        source = f"{known}: published; class {kind!r}: {why}; K_y = K_x, no rebound (chosen by us)"
        rows.append(PublishedSoil(name, soil, bool(modulus), source))
    return tuple(rows)


_PUBLISHED = _published()
