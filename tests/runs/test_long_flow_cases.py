"""Cases of `exumob verify` that take longer than the default tests may: each meets its limits."""

import pytest
from flow_case_limits import chosen, complaints


@pytest.mark.parametrize("case", chosen(long=True))
def test_case_meets_its_limits(case):
    bad = complaints(case)
    assert not bad, "\n".join(bad)
