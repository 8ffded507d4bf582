"""The force of a bore on a square column, computed by interFoam on the grid of `exumob verify bore-column`.

    python benchmarks/openfoam/bore.py --work DIR [--cell-size 20] [--turbulence laminar]

`DIR` (outside the repository) keeps the case; a finished run is read again. Both forces are compared with the measured
one, counted from their impact.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from pathlib import Path

from case_files import (
    BODY,
    COURANT,
    GRAVITY,
    SCHEMES,
    SOLUTION,
    TRANSPORT,
    TURBULENCE,
    VISCOSITY_RATIO,
    WATER_DENSITY,
    WATER_VISCOSITY,
    block_mesh,
    turbulence_properties,
    vector,
    write_case,
)
from interfoam import call, latest_time, make_mesh, missing, parse_cells, read_forces

from exumob.verification.dam_breaks import (
    ACROSS,
    BESIDE,
    FILM,
    GATE,
    HELD,
    Blow,
    blow_from_impact,
    bore_faces,
    bore_on_column,
    measured_blow,
)

WALLS = "walls"
TANK = {
    WALLS: ("wall", "(1 2 6 5) (0 4 7 3) (0 1 5 4) (3 7 6 2) (0 3 2 1)"),
    "atmosphere": ("patch", "(4 5 6 7)"),
    BODY: ("wall", ""),
}
"""Its sides."""
SPEED = 1.7
"""Of the bore, for the turbulence at the beginning [m/s]."""


def field(dimensions: str, internal: str, walls: str, atmosphere: str) -> str:
    """A field: uniform inside, the same condition on the tank's walls and the column."""
    return (
        f"dimensions {dimensions};\ninternalField uniform {internal};\nboundaryField\n{{\n  {WALLS} {{ {walls} }}\n"
        f"  {BODY} {{ {walls} }}\n  atmosphere {{ {atmosphere} }}\n}}\n"
    )


def bore_files(cell_size: float, turbulence: str, duration: float) -> dict[str, str]:
    """Return all files of the case, path -> text."""
    faces = bore_faces(cell_size)
    (x, y), z = BESIDE, faces[2]
    layers = "".join(
        f"  boxToCell {{ box ({low:g} -9 {a:.10g}) ({high:g} 9 {b:.10g}); "
        f"fieldValues ( volScalarFieldValue alpha.water {share:.6g} ); }}\n"
        for low, high, level in ((-9.0, GATE, HELD), (GATE, 9.0, FILM))
        for a, b in itertools.pairwise(z)
        if (share := min((level - a) / (b - a), 1.0)) > 0.0
    )
    energy = 1.5 * (0.01 * SPEED) ** 2
    out = "type inletOutlet; inletValue $internalField; value $internalField;"
    files = {
        "system/blockMeshDict": block_mesh(faces, TANK),
        "system/topoSetDict": f"actions (\n  {{ name water; type cellSet; action new; source boxToCell; "
        f"box {vector((x, y, -9.0))} {vector((x + ACROSS, y + ACROSS, 9.0))}; }}\n"
        "  { name water; type cellSet; action invert; }\n);\n",
        "system/setFieldsDict": "defaultFieldValues ( volScalarFieldValue alpha.water 0 );\n"
        f"regions (\n{layers});\n",
        "system/controlDict": f"""application interFoam;
startFrom latestTime; startTime 0; stopAt endTime; endTime {duration:g}; deltaT 1e-4; adjustTimeStep yes;
maxDeltaT 0.02; maxCo {COURANT}; maxAlphaCo {COURANT}; writeControl adjustableRunTime; writeInterval {duration / 4:g};
purgeWrite 2; writeFormat binary; writePrecision 10; timeFormat general; timePrecision 8; runTimeModifiable no;
functions
{{
  forces
  {{
    type forces; libs (forces); patches ({BODY}); rho rho; rhoInf {WATER_DENSITY:g}; CofR (0 0 0);
    log off; writeControl timeStep; writeInterval 1;
  }}
}}
""",
        "system/fvSchemes": SCHEMES,
        "system/fvSolution": SOLUTION,
        "constant/g": f"dimensions [0 1 -2 0 0 0 0];\nvalue (0 0 {-GRAVITY});\n",
        "constant/transportProperties": TRANSPORT,
        "constant/turbulenceProperties": turbulence_properties(turbulence),
        "0/U": field(
            "[0 1 -1 0 0 0 0]", "(0 0 0)", "type slip;" if turbulence == "laminar" else "type noSlip;",
            "type pressureInletOutletVelocity; value uniform (0 0 0);",
        ),
        "0/p_rgh": field(
            "[1 -1 -2 0 0 0 0]", "0", "type fixedFluxPressure; value $internalField;",
            "type totalPressure; p0 uniform 0; value $internalField;",
        ),
        "0/alpha.water": field(
            "[0 0 0 0 0 0 0]", "0", "type zeroGradient;", "type inletOutlet; inletValue uniform 0; value uniform 0;"
        ),
    }  # fmt: skip
    if turbulence != "laminar":
        calculated = "type calculated; value $internalField;"
        kind = "nutUSpaldingWallFunction" if turbulence == "Smagorinsky" else "nutkWallFunction"
        wall = f"type {kind}; value $internalField;"
        viscosity = VISCOSITY_RATIO * WATER_VISCOSITY
        files["0/nut"] = field("[0 2 -1 0 0 0 0]", f"{viscosity:.6g}", wall, calculated)
    if turbulence == "kOmegaSST":
        value = "value $internalField;"
        files["0/k"] = field("[0 2 -2 0 0 0 0]", f"{energy:.6g}", f"type kqRWallFunction; {value}", out)
        omega = f"{energy / viscosity:.6g}"
        files["0/omega"] = field("[0 0 -1 0 0 0 0]", omega, f"type omegaWallFunction; {value}", out)
    return files


def interfoam_blow(cell_size: float, turbulence: str, duration: float, work: Path) -> tuple[Blow, int]:
    """Force of interFoam, and its number of cells."""
    folder = work / f"bore-{1e3 * cell_size:g}-{turbulence}"
    if not (folder / "log.checkMesh").exists():
        write_case(folder, bore_files(cell_size, turbulence, duration))
        make_mesh(folder)
    if latest_time(folder) < duration - 1e-6:
        call(folder, "log.interFoam", "interFoam")
    time, force, _, _ = read_forces(folder)
    return blow_from_impact(time, force[:, 0]), parse_cells((folder / "log.checkMesh").read_text())


def main() -> None:
    """Run and print the comparison."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--work", type=Path, required=True, help="folder of the cases, outside the repository")
    parser.add_argument("--cell-size", type=float, default=20.0, help="[mm]")
    parser.add_argument("--turbulence", choices=TURBULENCE, default="kOmegaSST")
    parser.add_argument("--duration", type=float, default=1.1, help="[s]")
    given = parser.parse_args()
    if why := missing():
        sys.exit(why)
    size = 1e-3 * given.cell_size
    other, cells = interfoam_blow(size, given.turbulence, given.duration, given.work)
    print(f"{cells} cells of {given.cell_size:g} mm")
    for name, blow in (
        ("measured", measured_blow()),
        (f"interFoam, {given.turbulence}", other),
        ("exumob", bore_on_column(size, given.duration)),
    ):
        means = ", ".join(f"{blow.mean(a, b):.1f}" for a, b in ((0.1, 0.4), (0.4, 0.7)))
        print(f"{name}: peak {blow.peak:.1f} N after {1e3 * blow.rise:.0f} ms; 0.1 to 0.4, 0.4 to 0.7 s: {means} N")


if __name__ == "__main__":
    main()
