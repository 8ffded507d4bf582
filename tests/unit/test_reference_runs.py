"""Reference runs are found under their names; one that another macro step has made is no such run."""

from dataclasses import replace

import pytest
import xarray as xr

from exumob.paper.reference_runs import MACRO_STEP, FlowRun
from exumob.paper.scenarios import Scenario
from exumob.support.provenance import parameters_json

RUN = FlowRun(Scenario.named("D60/U1"))


@pytest.mark.parametrize("made", [MACRO_STEP, 1e-3])
def test_a_result_of_another_macro_step_is_refused(tmp_path, vehicle, made):
    """A name without a macro step stands for the default, which was 1 ms once."""
    kept = xr.Dataset(attrs={"parameters": parameters_json({"steps": {"macro_step": made}})})
    kept.to_netcdf(tmp_path / f"{RUN.name}.nc")
    if made == MACRO_STEP:
        assert RUN.compute(vehicle, tmp_path) == tmp_path / f"{RUN.name}.nc"
    else:
        with pytest.raises(ValueError, match="macro step of 1 ms, and this run has 2 ms; move it away"):
            RUN.compute(vehicle, tmp_path)
    assert "1ms" in replace(RUN, macro_step=1e-3).name and "ms" not in RUN.name.replace("mm", "")


def test_a_window_is_doubled_or_fitted_and_its_run_named_so():
    names = {replace(RUN, **{option: True}).name for option in ("doubled", "hull_on_faces")}
    assert len(names | {RUN.name}) == 3
    with pytest.raises(ValueError, match=r"FlowRun\.hull_on_faces = True has no effect with doubled = True"):
        replace(RUN, doubled=True, hull_on_faces=True)
