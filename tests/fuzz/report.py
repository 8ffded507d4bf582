"""Try many inputs and print what became of them: ``python -m tests.fuzz.report 5000``, from the repository's root.

``python -m tests.fuzz.report 2000 runs classes`` tries some groups alone, or targets whose names hold a text;
``--seed 1`` gives other inputs.
"""

from __future__ import annotations

import argparse
import collections
import logging
import sys
import time
from collections.abc import Callable
from pathlib import Path

from hypothesis import HealthCheck, Phase, given, seed, settings

from .outcome import KINDS, Outcome
from .targets import Target

SHARES = {"dataclasses": 0.34, "functions": 0.33, "commands": 0.2, "files": 0.12, "runs": 0.01}
"""Share of each group in all inputs; a run takes as long as a thousand constructions"""


def groups() -> dict[str, list[Target]]:
    """All targets by group."""
    from .commands import command_targets
    from .files import file_targets
    from .runs import run_targets
    from .targets import class_target, function_targets, user_classes

    return {
        "dataclasses": [class_target(owner) for owner in user_classes()], "functions": function_targets(),
        "commands": command_targets(), "files": file_targets(), "runs": run_targets(),
    }  # fmt: skip


def try_target(target: Target, number: int, first: int, show: Callable[[object, Outcome], None]) -> collections.Counter:
    """Try a number of inputs; `show` is called with each that was not answered well."""
    found: collections.Counter[str] = collections.Counter()

    @seed(first)
    @settings(
        max_examples=number,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(target.inputs)
    def attempt(values: object) -> None:
        outcome = target.answer(values)
        found[outcome.kind] += 1
        if not outcome.fine:
            show(values, outcome)

    attempt()
    return found


def main() -> int:
    """Print the table; return 1 if something was not answered well."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("number", type=int, nargs="?", default=5000, help="number of inputs")
    parser.add_argument("only", nargs="*", help="groups, or parts of the targets' names")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--faults", type=int, default=3, help="number of faults shown of each target")
    options = parser.parse_args()
    sys.path.insert(0, str(Path(__file__).parents[1]))  # modules that tests share
    logging.disable(logging.CRITICAL)
    chosen = groups()
    if options.only:
        chosen = {
            name: [t for t in targets if name in options.only or any(text in t.name for text in options.only)]
            for name, targets in chosen.items()
        }  # fmt: skip
    chosen = {name: targets for name, targets in chosen.items() if targets}
    total, all_shares = collections.Counter(), sum(SHARES[name] for name in chosen)
    print(f"{'target':<45}{'tried':>7}" + "".join(f"{kind:>10}" for kind in KINDS) + f"{'s':>7}")
    for name, targets in chosen.items():
        of_group = collections.Counter()
        weights = sum(target.weight for target in targets)
        for target in targets:
            number = max(round(options.number * SHARES[name] / all_shares * target.weight / weights), 1)
            faults: dict[str, str] = {}

            def show(values: object, outcome: Outcome, faults: dict[str, str] = faults) -> None:
                faults.setdefault(outcome.detail[:60], f"    {outcome.kind}: {values!r:.300}\n        {outcome.detail}")

            began = time.process_time()
            found = try_target(target, number, options.seed, show)
            of_group += found
            print(_row(target.name, found, time.process_time() - began), flush=True)
            for text in list(faults.values())[: options.faults]:
                print(text)
        print(_row(f"-- {name}", of_group), flush=True)
        total += of_group
    print(_row("== all", total))
    return 1 if any(total[kind] for kind in ("unclear", "silent", "hang")) else 0


def _row(name: str, found: collections.Counter, seconds: float | None = None) -> str:
    numbers = "".join(f"{found[kind]:>10}" for kind in KINDS)
    return f"{name:<45}{found.total():>7}{numbers}" + ("" if seconds is None else f"{seconds:>7.1f}")


if __name__ == "__main__":
    sys.exit(main())
