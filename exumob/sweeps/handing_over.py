"""Handing what a sweep runs to other processes, with the vehicle files whose classes it holds."""

from __future__ import annotations

import pickle
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, SupportsIndex

from exumob.vehicle.vehicle_file import MODULES, load_vehicle


class WithVehicleFiles:
    """A class whose objects can be unpickled though they hold objects of classes that a vehicle file defines.

    Such a file is no module that can be imported: the process that unpickles runs it first, under the same name.
    """

    def __reduce_ex__(self, protocol: SupportsIndex) -> str | tuple[Any, ...]:
        """Pickle the files' paths beside the state, if there are any."""
        loaded = {name: module.__file__ for name, module in list(sys.modules.items()) if name.startswith(MODULES)}
        if not loaded:
            return super().__reduce_ex__(protocol)
        state = pickle.dumps(vars(self))
        files = [str(Path(file).resolve()) for name, file in loaded.items() if file and name.encode() in state]
        return _restored, (type(self), files, state)


def _restored(kind: type, files: Sequence[str], state: bytes) -> Any:
    for file in files:
        load_vehicle(file)
    found: Any = object.__new__(kind)
    vars(found).update(pickle.loads(state))
    return found
