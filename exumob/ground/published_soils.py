"""Published Bekker-Wong parameters of 23 soils as their sources print them, and values for what these do not give."""

WONG_TABLE = """\
Dry sand (Land Locomotion Lab)  | 1.10 |   0.99 | 1528.43 |  1.04 | 28.0 |       | loose sand
Sandy loam 15 %                 | 0.70 |   5.27 | 1515.04 |  1.72 | 29.0 |       | firm loam
Sandy loam 22 %                 | 0.20 |   2.56 |   43.12 |  1.38 | 38.0 |       | firm loam
Sandy loam 11 %                 | 0.90 |  52.53 | 1127.97 |  4.83 | 20.0 |       | firm loam
Sandy loam 23 %                 | 0.40 |  11.42 |  808.96 |  9.65 | 35.0 |       | firm loam
Sandy loam 26 %                 | 0.30 |   2.79 |  141.11 | 13.79 | 22.0 |       | firm loam
Sandy loam 32 %                 | 0.50 |   0.77 |   51.91 |  5.17 | 11.0 |       | firm loam
Clayey soil 38 %                | 0.50 |  13.19 |  692.15 |  4.14 | 13.0 |       | clay
Clayey soil 55 %                | 0.70 |  16.03 | 1262.53 |  2.07 | 10.0 |       | clay
Heavy clay 25 %                 | 0.13 |  12.70 | 1555.95 | 68.95 | 34.0 |       | clay
Heavy clay 40 %                 | 0.11 |   1.84 |  103.27 | 20.69 |  6.0 |       | clay
Lean clay 22 %                  | 0.20 |  16.43 | 1724.69 | 68.95 | 20.0 |       | clay
Lean clay 32 %                  | 0.15 |   1.52 |  119.61 | 13.79 | 11.0 |       | clay
LETE sand                       | 0.79 | 102.00 | 5301.00 |  1.30 | 31.1 | 0.012 | loose sand
Upland sandy loam 51 %          | 1.10 |  74.60 | 2080.00 |  3.30 | 33.7 |       | firm loam
Rubicon sandy loam 43 %         | 0.66 |   6.90 |  752.00 |  3.70 | 29.8 |       | firm loam
North Gower clayey loam 46 %    | 0.73 |  41.60 | 2471.00 |  6.10 | 26.6 |       | firm loam
Grenville loam 24 %             | 1.01 |   0.06 | 5880.00 |  3.10 | 29.8 |       | firm loam
Snow (US)                       | 1.60 |   4.37 |  196.72 |  1.03 | 19.7 |       | snow
Snow (Harrison)                 | 1.60 |   2.49 |  245.90 |  0.62 | 23.2 |       | snow
Snow (Sweden)                   | 1.44 |  10.55 |   66.08 |  6.00 | 20.7 |       | snow
DLR Mars simulant               | 0.80 |   5.79 |  180.00 |  0.30 | 17.8 | 0.010 | planetary
Lunar soil                      | 1.00 |   1.40 |  820.00 |  0.17 | 35.0 | 0.010 | planetary
"""
"""Wong, Theory of Ground Vehicles, table of terrain values, and the two planetary soils in common use.

Columns: name (per cent: moisture), n [-], k_c [kN/m^(n+1)], k_phi [kN/m^(n+2)], cohesion [kPa], friction angle [deg],
shear deformation modulus K [m] where published, and the class, chosen by us, that supplies what is not published.
"""

SOIL_CLASSES = {
    # class: (K [m], c1, c2, why)
    "loose sand": (
        0.025, 0.18, 0.32, "K of loose sand (Wong, Theory of Ground Vehicles); c1, c2 of loose sand (Wong & Reece 1967)"
    ),
    "firm loam": (
        0.010, 0.43, 0.32,
        "K of firm sandy terrain (Wong, Theory of Ground Vehicles); c1, c2 of compact sand (Wong & Reece 1967)",
    ),
    "clay": (
        0.006, 0.43, 0.32, "K of clay (Wong, Theory of Ground Vehicles); c1, c2 as used for lean clay in the literature"
    ),
    "snow": (
        0.0375, 0.18, 0.32,
        "K in the middle of 25 to 50 mm for fresh snow (Wong, Theory of Ground Vehicles); c1, c2 published for no "
        "snow: those of loose sand, the other very compressible ground",
    ),
    "planetary": (0.010, 0.40, 0.15, "c1, c2 after Ishigami et al. (J. Field Robotics 24 (2007) 233)"),
}  # fmt: skip
"""Values for what the source of a soil does not give; (c1, c2) are published for none of the 23 soils themselves."""

WETTER = {
    "Sandy loam 15 %": "Sandy loam 22 %", "Sandy loam 11 %": "Sandy loam 23 %", "Sandy loam 26 %": "Sandy loam 32 %",
    "Clayey soil 38 %": "Clayey soil 55 %", "Heavy clay 25 %": "Heavy clay 40 %", "Lean clay 22 %": "Lean clay 32 %",
}  # fmt: skip
"""Soils that the same laboratory also measured at a higher moisture (they follow each other in the table), and which
soil of the table that is. No source of the table gives any soil saturated, as it is under water."""
MEASURED_DRY = ("Dry sand (Land Locomotion Lab)", "LETE sand")
"""Sands without a moisture in the table: air-dry."""
NOT_UNDER_WATER = ("Snow (US)", "Snow (Harrison)", "Snow (Sweden)", "DLR Mars simulant", "Lunar soil")
"""Of which nothing under water is measured."""
