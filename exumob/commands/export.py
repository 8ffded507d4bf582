"""The command `exumob export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from exumob.commands.shared import check_targets, console, fail


def export_command(
    networks: Annotated[Path, typer.Argument(help="File of networks (.safetensors).")],
    output: Annotated[Path, typer.Option(help="Write the ONNX graph here (.onnx).")],
) -> None:
    """Write networks as an ONNX graph, for other programs.

    Example: exumob export networks/memory_seed0.safetensors --output memory.onnx
    """
    from exumob.surrogates.networks import NetworkSet

    try:
        check_targets({"--output": output}, (".onnx",))
        found = NetworkSet.load(networks)
        from exumob.learning.onnx_export import export_onnx

        file = export_onnx(found, output)
    except (ValueError, OSError) as error:
        fail(error)
    except ImportError as error:
        fail(ImportError(f"{error}; the export needs onnx: pip install 'exumob[onnx]'"))
    base = found.architecture.base
    waves = ", with the coefficients of waves that its metadata hold," if "waves" in found.about else ""
    added = "" if base == "none" else f"; to its loads those of the model '{base}'{waves} are to be added"
    console.print(f"{file}: {found.name}{added}", soft_wrap=True)
