# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Reads prepared answers (docs/prepared-answers.md) from bytes that are not trusted. Needs numpy only."""

from __future__ import annotations

import struct
from typing import Any, Dict, Optional

import numpy as np

MAX_BYTES = 256 << 20
MAX_CONTACT_ROWS = 1_000
GRADIENT_FIELD, LINEAR_ELASTIC, NEO_HOOKEAN = 1, 2, 3
FREE, FIXED = -2, -1
_TYPES = {1: "<f8", 2: "<f4", 3: "<i4", 4: "<i2"}
_NUMBERS = (
    "model num_vertices num_handles tolerance_mm max_rotation_rad max_scale_change max_estimate_mm largest_rest_mm "
    "num_polynomials degree simplex_width largest_gain_mm size_mm estimate_scale cut_per_mm rounding_mm"
).split()

Array = Any


def _require(condition: bool, what: str) -> None:
    if not condition:
        raise ValueError(f"prepared answers are damaged: {what}")


def read_sections(data: bytes) -> Dict[int, Array]:
    """The sections by their numbers, without a copy. Raises ValueError unless each is within the bytes, aligned and finite."""
    _require(16 <= len(data) <= MAX_BYTES, "too short or too long")
    magic, version, count = struct.unpack_from("<8sII", data, 0)
    _require(magic == b"TFANSWER" and version in (1, 2, 3, 4), "not version 1 to 4")
    _require(count <= 64 and 16 + 16 * count <= len(data), "the table of sections is cut off")
    sections: Dict[int, Array] = {}
    for i in range(count):
        number, kind, offset, length = struct.unpack_from("<IIII", data, 16 + 16 * i)
        _require(kind in _TYPES and offset % 16 == 0, f"section {number} has an unknown type or is not aligned")
        _require(offset + length * np.dtype(_TYPES[kind]).itemsize <= len(data), f"section {number} is cut off")
        values: Array = np.frombuffer(data, _TYPES[kind], length, offset)
        _require(kind > 2 or bool(np.isfinite(values).all()), f"section {number} has numbers that are not finite")
        sections[number] = values
    return sections


class AnswerFile:
    """The sections, checked, and the numbers of section 1 as attributes."""

    model: float
    num_vertices: float
    tolerance_mm: float
    max_rotation_rad: float
    max_scale_change: float
    max_estimate_mm: float
    largest_rest_mm: float
    num_polynomials: float
    degree: float
    simplex_width: float
    largest_gain_mm: float
    size_mm: float
    estimate_scale: float
    cut_per_mm: float
    rounding_mm: float

    def __init__(self, data: bytes) -> None:
        self._sections = read_sections(data)
        numbers = self.section(1)
        _require(len(numbers) >= len(_NUMBERS), "section 1 is too short")
        for name, value in zip(_NUMBERS, numbers):
            setattr(self, name, float(value))
        _require(self.model in (GRADIENT_FIELD, LINEAR_ELASTIC, NEO_HOOKEAN), "an unknown model")
        self.handles = int(numbers[2])
        _require(1 <= self.handles <= 1_000 and 0 <= self.degree <= 64, "a number of handles or a degree out of range")
        self.regions = self.section(2)
        self.free = self.section(3, 3)
        self.fixed = self.section(4, 3)
        self.held = self.section(5, 3)
        self._check_regions()
        if self.model == NEO_HOOKEAN:
            self._check_clusters()

    def section(self, number: int, width: Optional[int] = None) -> Array:
        values = self._sections.get(number, np.zeros(0))
        return values if width is None else values.reshape(-1, width)

    def _check_regions(self) -> None:
        regions = self.regions
        _require(len(regions) == int(self.num_vertices) and (len(regions) == 0 or FREE <= regions.min() <= regions.max() < self.handles),
                 "regions that do not exist")
        for region, places in ((FREE, self.free), (FIXED, self.fixed)):
            _require(int((regions == region).sum()) == len(places), "rest positions that do not fit the regions")
        _require(int((regions >= 0).sum()) == len(self.held), "rest positions that do not fit the regions")
        _require(len(self.section(50)) <= MAX_CONTACT_ROWS, "too many rows of contact")
        pairs, rows = self.seal_pairs, len(self.section(50))
        for number, width in ((53, 12 * self.handles), (54, rows), (55, 12 * self.handles), (56, rows), (57, pairs)):
            _require(len(self.section(number)) == pairs * width, "a lip seal of other sizes")
        _require(len(self.section(58)) == (1 if pairs > 0 else 0) and pairs <= rows, "a lip seal of other sizes")

    @property
    def seal_pairs(self) -> int:
        """Pairs of lip vertices that are held together; 0 without a seal."""
        return len(self.section(53)) // (12 * self.handles)

    def seal_matrix(self, number: int) -> Array:
        """#pairs rows."""
        return self.section(number, len(self.section(number)) // self.seal_pairs)

    def _check_clusters(self) -> None:
        order = self.section(34)
        _require(np.array_equal(np.sort(order), np.arange(len(self.free))), "clusters that do not hold each vertex once")
        _require(len(self.section(33)) % 3 == 0 and (len(self.section(33)) == 0 or self.section(33).min() >= 0), "invalid clusters")
        clusters = self.section(33, 3).astype(np.int64)
        size, full = 3 * clusters[:, 0] * clusters[:, 1], 3 * clusters[:, 0] * clusters[:, 2]
        _require(bool((clusters[:, 2] <= clusters[:, 1]).all()) and clusters[:, 0].sum() == len(order), "invalid clusters")
        _require(clusters[:, 1].sum() == len(self.section(24)) and size.sum() == len(self.section(25)) and
                 full.sum() == len(self.section(26)), "columns that do not fit the clusters")


def unpacked(steps: Array, upper: Array, lower: Array, rows: int) -> Array:
    """#rows by #columns, in single precision; `upper` alone where there is no `lower`."""
    columns = len(steps)
    units = 65536.0 * upper.astype(np.float64).reshape(columns, rows)
    if rows > 0 and len(lower) > 0:
        full = len(lower) // rows
        units[columns - full:] += lower.reshape(full, rows)
    return np.ascontiguousarray((units * steps[:, None]).T, dtype=np.float32)
