"""Does the flow leave a smooth wall with `FlowSettings.smooth_separation`, and follow it without?"""

import pytest

from exumob.verification.columns import column


def test_behind_a_round_column_the_flow_separates():
    """1.2 is measured (Hoerner 1965); five cells to the column."""
    follows, leaves = (column("round", 0.5, 5.0, 12.0, smooth_separation=on) for on in (False, True))
    assert follows.mean(follows.drag) < 1.0
    assert leaves.mean(leaves.drag) == pytest.approx(1.2, rel=0.2)
