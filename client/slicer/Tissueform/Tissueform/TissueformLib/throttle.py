# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""When a moved transform leads to a prediction."""

from __future__ import annotations


class FrameThrottle:
    """At most one prediction per period, of the newest transforms. A slow one is followed by a pause of the same length, in which the
    user interface works. Times are in seconds of one clock."""

    def __init__(self, period: float = 1 / 30) -> None:
        self._period = period
        self._wanted = False
        self._earliest = 0.0

    def want(self) -> None:
        """A transform has changed."""
        self._wanted = True

    def take(self, now: float) -> bool:
        """Whether to predict now; then call done."""
        if not self._wanted or now < self._earliest:
            return False
        self._wanted = False
        return True

    def done(self, begin: float, end: float) -> None:
        """The prediction lasted from begin to end."""
        self._earliest = max(begin + self._period, end + (end - begin))
