"""Small systems of equations on one thread: that of a vehicle's constraints has a hundred unknowns.

The linear algebra that NumPy brings along hands even such a system to a thread on every core, and these wait for one
another in a loop. Where other programs use the cores, as other runs of a sweep or a flow solver do, a solution of half
a millisecond then takes fifty.
"""

from __future__ import annotations

from contextlib import AbstractContextManager

from threadpoolctl import threadpool_limits


def on_one_thread() -> AbstractContextManager[object]:
    """Return a context in which linear algebra takes one thread of this process, as it had before at its end."""
    return threadpool_limits(limits=1, user_api="blas")
