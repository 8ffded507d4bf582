"""The interFoam case of a situation: dictionaries and fields, as text."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from situations import Situation

WATER_VISCOSITY, AIR_VISCOSITY, WATER_DENSITY, AIR_DENSITY = 1.0e-6, 1.48e-5, 1000.0, 1.2
"""[m^2/s], [kg/m^3]"""
GRAVITY = 9.81
"""[m/s^2], as `exumob.support.constants.GRAVITY`"""
TURBULENCE = ("kOmegaSST", "laminar", "Smagorinsky")
INTENSITY = 0.01
"""Turbulence intensity of the undisturbed flow [-]."""
VISCOSITY_RATIO = 5.0
"""Eddy over molecular viscosity of the undisturbed flow [-]."""
COURANT = 0.5
"""Largest Courant number, of the water's surface too [-]."""
PROFILE_STEPS = 20
"""Time steps from one record of the surface's profile to the next."""
BODY = "body"


def case_files(
    situation: Situation, turbulence: str, ranks: int, duration: float, *, steps: int | None = None
) -> dict[str, str]:
    """Return all files of the case, path -> text.

    Parameters
    ----------
    situation : Situation
    turbulence : str
        One of `TURBULENCE`.
    ranks : int
        Processes.
    duration : float
        Time computed [s].
    steps : int, optional
        Stop after about so many steps of equal length instead, without records of the surface: for the cost.
    """
    if turbulence not in TURBULENCE:
        raise ValueError(f"turbulence = {turbulence!r}; choose one of {', '.join(TURBULENCE)}.")
    files = {
        "system/blockMeshDict": block_mesh(situation.faces(), CHANNEL),
        "system/controlDict": control(situation, duration, steps),
        "system/fvSchemes": SCHEMES,
        "system/fvSolution": SOLUTION,
        "system/decomposeParDict": f"numberOfSubdomains {ranks};\nmethod simple;\n"
        f"simpleCoeffs {{ n ({ranks} 1 1); delta 0.001; }}\n",
        "system/setFieldsDict": set_fields(situation),
        "system/topoSetDict": topo_set(situation),
        "constant/g": f"dimensions [0 1 -2 0 0 0 0];\nvalue (0 0 {-GRAVITY});\n",
        "constant/transportProperties": TRANSPORT,
        "constant/turbulenceProperties": turbulence_properties(turbulence),
        **fields(situation, turbulence),
    }
    return files


def write_case(folder: Path, files: dict[str, str]) -> None:
    """Write the files with the header that OpenFOAM wants."""
    classes = {"U": "volVectorField", "g": "uniformDimensionedVectorField"}
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        kind = classes.get(path.name, "volScalarField" if path.parent.name == "0" else "dictionary")
        header = f"FoamFile {{ version 2.0; format ascii; class {kind}; object {path.name}; }}\n"
        path.write_text(header + text)


def vector(values: Iterable[float]) -> str:
    """(a b c)"""
    return "(" + " ".join(f"{v:.10g}" for v in values) + ")"


def block_mesh(faces: Sequence[np.ndarray], sides: dict[str, tuple[str, str]]) -> str:
    """One block, each cell a section of its own: exactly the faces of exumob's grid; sides by name: type, faces."""
    corners = [
        (faces[0][i], faces[1][j], faces[2][k])
        for k in (0, -1)
        for i, j in ((0, 0), (-1, 0), (-1, -1), (0, -1))
    ]  # fmt: skip
    grading = "\n  ".join("(" + " ".join(f"({w:.12g} 1 1)" for w in np.diff(f)) + ")" for f in faces)
    counts = " ".join(str(len(f) - 1) for f in faces)
    boundary = "\n".join(f"  {name} {{ type {kind}; faces ({list_}); }}" for name, (kind, list_) in sides.items())
    return (
        f"scale 1;\nvertices ({' '.join(vector(c) for c in corners)});\n"
        f"blocks (hex (0 1 2 3 4 5 6 7) ({counts}) simpleGrading (\n  {grading}));\n"
        f"edges ();\nboundary (\n{boundary}\n);\nmergePatchPairs ();\n"
    )


CHANNEL = {
    "inlet": ("patch", "(1 2 6 5)"),
    "outlet": ("patch", "(0 4 7 3)"),
    "sides": ("symmetry", "(0 1 5 4) (3 7 6 2)"),
    "bed": ("symmetry", "(0 3 2 1)"),
    "atmosphere": ("patch", "(4 5 6 7)"),
    BODY: ("wall", ""),
}
"""Sides of the window of a situation."""


def topo_set(situation: Situation) -> str:
    """The cells outside the body."""
    boxes = "".join(
        f"  {{ name water; type cellSet; action {'add' if n else 'new'}; source boxToCell; "
        f"box {vector(low)} {vector(high)}; }}\n"
        for n, (low, high) in enumerate(situation.boxes())
    )
    return f"actions (\n{boxes}  {{ name water; type cellSet; action invert; }}\n);\n"


def control(situation: Situation, duration: float, steps: int | None) -> str:
    """Time and records; a run goes on from the latest time saved."""
    center, points = vector(situation.center), profile_points(situation)
    records = f"""  forces
  {{
    type forces; libs (forces); patches ({BODY}); rho rho; rhoInf {WATER_DENSITY:g}; CofR {center};
    log off; writeControl timeStep; writeInterval 1;
  }}
"""
    if steps is None:
        records += f"""  profile
  {{
    type probes; libs (sampling); fields (alpha.water); fixedLocations false;
    writeControl timeStep; writeInterval {PROFILE_STEPS};
    probeLocations ({" ".join(vector(p) for p in points.reshape(-1, 3))});
  }}
"""
        # a start from rest to the current in one step needs a short first one
        saved = duration / math.ceil(duration / 0.25 - 1e-9)
        time = f"endTime {duration:g}; deltaT 1e-4; adjustTimeStep yes; maxDeltaT 0.02; writeInterval {saved:.10g};"
    else:
        widths = [float(np.diff(f).min()) for f in situation.faces()]
        dt = 0.25 * min(widths) / situation.current
        time = f"endTime {steps * dt:.6g}; deltaT {dt:.6g}; adjustTimeStep no; writeInterval 1000;"
    write = "adjustableRunTime" if steps is None else "runTime"
    return f"""application interFoam;
startFrom latestTime; startTime 0; stopAt endTime; {time}
maxCo {COURANT}; maxAlphaCo {COURANT};
writeControl {write}; purgeWrite 2; writeFormat binary; writePrecision 10; timeFormat general; timePrecision 8;
runTimeModifiable no;
functions
{{
{records}}}
"""


def profile_points(situation: Situation) -> np.ndarray:
    """Centres of the cells beside the middle plane whose water is recorded, (columns, layers, 3) [m]; not the body."""
    x, y, z = (0.5 * (f[:-1] + f[1:]) for f in situation.faces())
    x = x[np.abs(x - situation.center[0]) > 0.5 * situation.size[0]]
    x = x[(x > situation.low[0] + 0.5) & (x < situation.high[0] - 0.5)]
    return np.stack(np.meshgrid(x, y[[profile_row(situation)]], z, indexing="ij"), axis=-1)[:, 0]


def profile_row(situation: Situation) -> int:
    """Index along y of these columns."""
    y = situation.faces()[1]
    return int(np.searchsorted(0.5 * (y[:-1] + y[1:]), situation.center[1] - 1e-9))


def set_fields(situation: Situation) -> str:
    """Water up to the still level, which is a face of the grid; on the inlet too."""
    box = f"box (-999 -999 -999) (999 999 {situation.depth:.10g});"
    values = "fieldValues ( volScalarFieldValue alpha.water 1 );"
    return (
        "defaultFieldValues ( volScalarFieldValue alpha.water 0 );\n"
        f"regions (\n  boxToCell {{ {box} {values} }}\n  boxToFace {{ {box} {values} }}\n);\n"
    )


def field(dimensions: str, internal: str, **patches: str) -> str:
    """A field: uniform inside, and its conditions."""
    conditions = "\n".join(f"  {name} {{ {text} }}" for name, text in patches.items())
    return (
        f"dimensions {dimensions};\ninternalField uniform {internal};\n"
        f"boundaryField\n{{\n  sides {{ type symmetry; }}\n  bed {{ type symmetry; }}\n{conditions}\n}}\n"
    )


def fields(situation: Situation, turbulence: str) -> dict[str, str]:
    """Fields at t = 0: water and air move with the current everywhere, as when exumob starts."""
    current = vector((-situation.current, 0.0, 0.0))
    wall = "noSlip;" if turbulence != "laminar" else "slip;"
    out = "type inletOutlet; inletValue $internalField; value $internalField;"
    result = {
        "0/U": field(
            "[0 1 -1 0 0 0 0]", current,
            inlet="type fixedValue; value $internalField;",
            outlet=f"type outletPhaseMeanVelocity; alpha alpha.water; Umean {situation.current:g}; "
            "value $internalField;",
            atmosphere="type pressureInletOutletVelocity; value uniform (0 0 0);",
            **{BODY: f"type {wall}"},
        ),
        "0/p_rgh": field(
            "[1 -1 -2 0 0 0 0]", "0",
            inlet="type fixedFluxPressure; value $internalField;",
            outlet="type zeroGradient;",
            atmosphere="type totalPressure; p0 uniform 0; value $internalField;",
            **{BODY: "type fixedFluxPressure; value $internalField;"},
        ),
        "0/alpha.water": field(
            "[0 0 0 0 0 0 0]", "0",
            inlet="type fixedValue; value $internalField;",
            outlet="type variableHeightFlowRate; lowerBound 0; upperBound 1; value $internalField;",
            atmosphere="type inletOutlet; inletValue uniform 0; value uniform 0;",
            **{BODY: "type zeroGradient;"},
        ),
    }  # fmt: skip
    if turbulence == "laminar":
        return result
    walls = {
        "nut": "type nutkWallFunction; value $internalField;",
        "k": "type kqRWallFunction; value $internalField;",
        "omega": "type omegaWallFunction; value $internalField;",
    }
    if turbulence == "Smagorinsky":
        walls = {"nut": "type nutUSpaldingWallFunction; value $internalField;"}
    energy = 1.5 * (INTENSITY * situation.current) ** 2
    values = {
        "nut": ("[0 2 -1 0 0 0 0]", VISCOSITY_RATIO * WATER_VISCOSITY),
        "k": ("[0 2 -2 0 0 0 0]", energy),
        "omega": ("[0 0 -1 0 0 0 0]", energy / (VISCOSITY_RATIO * WATER_VISCOSITY)),
    }
    for name, condition in walls.items():
        dimensions, value = values[name]
        patches = {p: "type calculated; value $internalField;" if name == "nut" else out for p in OPEN_SIDES}
        if name != "nut":
            patches["inlet"] = "type fixedValue; value $internalField;"
        result[f"0/{name}"] = field(dimensions, f"{value:.6g}", **patches, **{BODY: condition})
    return result


OPEN_SIDES = ("inlet", "outlet", "atmosphere")


def turbulence_properties(turbulence: str) -> str:
    """Model and its switches."""
    if turbulence == "laminar":
        return "simulationType laminar;\n"
    if turbulence == "kOmegaSST":
        return "simulationType RAS;\nRAS { RASModel kOmegaSST; turbulence on; printCoeffs on; }\n"
    return (  # (C_s)^2 = C_k sqrt(C_k / C_e); C_s = 0.1 as in exumob
        "simulationType LES;\nLES\n{\n  LESModel Smagorinsky; turbulence on; printCoeffs on; delta cubeRootVol;\n"
        "  SmagorinskyCoeffs { Ck 0.0472; Ce 1.05; }\n  cubeRootVolCoeffs { deltaCoeff 1; }\n}\n"
    )


TRANSPORT = f"""phases (water air);
water {{ transportModel Newtonian; nu {WATER_VISCOSITY:g}; rho {WATER_DENSITY:g}; }}
air {{ transportModel Newtonian; nu {AIR_VISCOSITY:g}; rho {AIR_DENSITY:g}; }}
sigma 0.07;
"""

SCHEMES = """ddtSchemes { default Euler; }
gradSchemes { default Gauss linear; }
divSchemes
{
  default none;
  div(rhoPhi,U) Gauss linearUpwind grad(U);
  div(phi,alpha) Gauss vanLeer;
  div(phirb,alpha) Gauss linear;
  div(phi,k) Gauss upwind;
  div(phi,omega) Gauss upwind;
  div(((rho*nuEff)*dev2(T(grad(U))))) Gauss linear;
}
laplacianSchemes { default Gauss linear corrected; }
interpolationSchemes { default linear; }
snGradSchemes { default corrected; }
wallDist { method meshWave; }
"""

SOLUTION = """solvers
{
  "alpha.water.*"
  {
    nAlphaCorr 2; nAlphaSubCycles 1; cAlpha 1; MULESCorr yes; nLimiterIter 5;
    solver smoothSolver; smoother symGaussSeidel; tolerance 1e-8; relTol 0;
  }
  "pcorr.*" { solver PCG; preconditioner DIC; tolerance 1e-5; relTol 0; }
  p_rgh { solver GAMG; smoother DIC; tolerance 1e-7; relTol 0.01; }
  p_rghFinal { $p_rgh; relTol 0; }
  "(U|k|omega).*"
  {
    solver smoothSolver; smoother symGaussSeidel; nSweeps 1; tolerance 1e-7; relTol 0.1; minIter 1;
  }
}
PIMPLE { momentumPredictor no; nOuterCorrectors 1; nCorrectors 2; nNonOrthogonalCorrectors 0; }
relaxationFactors { equations { ".*" 1; } }
"""
