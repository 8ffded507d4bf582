"""Active learning: the next scenario to compute with the flow in the loop is the one on which an ensemble disagrees.

Query by committee (Seung, Opper & Sompolinsky 1992, COLT, 287-294), in its form for regression: the variance of an
ensemble's members is the part of their error that more data would take away (Krogh & Vedelsby 1995, NIPS 7, 231-238).
No flow is computed for it: the ensemble drives the vehicle through the candidate, in seconds instead of half an hour,
and the members are compared along the path that it predicts.

The measure is the standard deviation of the members' loads over the deviation of the loads that they learnt
(`load_scale`), root mean square over time, bodies and components. Training counts errors in the same unit for every
candidate: small loads of a calm scenario do not count for more because they are small. The measure does not say what a
load does to the path. The spread of the members' own final positions would; it costs a run for each member instead of
one, and does not see errors whose effects cancel.

Its limits: the members have the same inputs and the same kind of weights, and an error that all of them share causes no
spread. Outside the training range inputs are held at its edge (`NetworkSet.scaled`), so the measure is too small there;
`Disagreement.out_of_range` gives the share of the time.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from exumob.learning.evaluation import FAST, drive
from exumob.paper.scenarios import Scenario
from exumob.support.arrays import Array
from exumob.support.errors import SimulationError
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.surrogates.networks import NetworkSet
from exumob.vehicle.parameters import Vehicle

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Disagreement:
    """Disagreement of the members of an ensemble on a scenario that need not have been computed."""

    scenario: Scenario
    by_load: Array
    """Body by component, shape (5, 6): root mean square over time of the members' deviation over `load_scale` [-]"""
    out_of_range: float
    """Share of the time that some body is outside the training range [-]"""
    fallback: float
    """Largest share of the coefficients in the loads of a body, mean over time [-]"""

    @property
    def total(self) -> float:
        """Root mean square over bodies and components, equal weights as in training [-]."""
        return float(np.sqrt(np.mean(self.by_load**2)))


def load_scale(networks: Sequence[NetworkSet]) -> Array:
    """Standard deviation of the loads that the members learnt, root mean square over them; shape (5, 6), N and N m.

    For networks whose loads are added to a base model it is the deviation of the added loads.
    """
    return np.sqrt(np.mean([network.arrays["output_scale"].astype(float) ** 2 for network in networks], axis=0))


def disagreement(
    scenario: Scenario, networks: Sequence[NetworkSet], vehicle: Vehicle, steps: Mapping[str, Any] = FAST
) -> Disagreement:
    """Drive a scenario with an ensemble and measure how far its members are apart on the way.

    Parameters
    ----------
    scenario : Scenario
        Any scenario; no run of it is needed.
    networks : sequence of NetworkSet
        Members of the ensemble, two at least.
    vehicle : Vehicle
        Vehicle of the training runs.
    steps : mapping
        Further arguments of `exumob.simulate`: its steps.

    Raises
    ------
    ValueError
        If there are fewer than two members.
    SimulationError
        If the vehicle cannot be driven by them.
    """
    if len(networks) < 2:
        raise ValueError(
            f"disagreement: networks has {len(networks)} members, and two at least are needed to disagree; train "
            "several seeds (`exumob train --seeds`)."
        )
    run = drive(scenario, SurrogateHydrodynamics(networks), vehicle, steps)
    spread = run["hydrodynamics_load_spread"].values / load_scale(networks)
    return Disagreement(
        scenario,
        np.sqrt(np.mean(spread**2, axis=0)),
        float(run["hydrodynamics_out_of_range"].any("body").mean()),
        float(run["hydrodynamics_fallback_share"].max("body").mean()),
    )


def rank(
    candidates: Iterable[Scenario], networks: Sequence[NetworkSet], vehicle: Vehicle, steps: Mapping[str, Any] = FAST
) -> list[Disagreement]:
    """Measure the `disagreement` on every candidate and sort, the largest first.

    A candidate that the members cannot drive is left out, with a warning that names it.
    """
    found = []
    for scenario in candidates:
        try:
            found.append(disagreement(scenario, networks, vehicle, steps))
        except SimulationError as error:
            logger.warning("%s cannot be driven by these networks and is left out: %s", scenario.name, error)
    return sorted(found, key=lambda one: one.total, reverse=True)


def next_scenario(
    candidates: Iterable[Scenario], networks: Sequence[NetworkSet], vehicle: Vehicle, steps: Mapping[str, Any] = FAST
) -> Scenario:
    """Choose the candidate on which the members disagree most: the one to compute next.

    Parameters
    ----------
    candidates : iterable of Scenario
    networks : sequence of NetworkSet
        Members of the ensemble, trained on the runs that there are.
    vehicle : Vehicle
        Vehicle of the training runs.
    steps : mapping
        As for `disagreement`.

    Raises
    ------
    ValueError
        If there is no candidate that the members can drive.
    """
    ranking = rank(candidates, networks, vehicle, steps)
    if not ranking:
        raise ValueError("next_scenario: candidates holds no scenario that these networks can drive; give others.")
    return ranking[0].scenario
