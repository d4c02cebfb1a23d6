# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Evaluates prepared answers as docs/prepared-answers.md says. Needs numpy only."""

from __future__ import annotations

import math
from typing import Any, List, Optional, Sequence, Tuple

import numpy as np

from .answer_file import FIXED, FREE, GRADIENT_FIELD, LINEAR_ELASTIC, NEO_HOOKEAN, AnswerFile, Array, unpacked

_SLACK = 1e-9
_LARGEST_BAND_ROTATION = 0.524
# Radii that hold 95 of 100 of a standard normal distribution in one, two and three dimensions.
_OF_ONE, _OF_TWO, _OF_THREE = 1.959964, 2.447747, 2.795483
_MAX_BLOCK_STEPS = 50


def turn_minus_identity(w: Array, scale: float) -> Array:
    """scale R(w) - I by Rodrigues' formula."""
    angle = float(np.linalg.norm(w))
    if angle == 0:
        return (scale - 1) * np.eye(3)
    x, y, z = w / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return scale * (np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross) - np.eye(3)


class HandlePose:
    """Of one handle, in the order of the session's handles."""

    def __init__(self, w: Any, pivot: Any, translation: Any, scale: float) -> None:
        self.w = np.asarray(w, dtype=np.float64)
        self.pivot = np.asarray(pivot, dtype=np.float64)
        self.translation = np.asarray(translation, dtype=np.float64)
        self.scale = scale
        self.A = turn_minus_identity(self.w, scale)

    def shift(self, point: Array) -> Array:
        """How far it displaces the point."""
        return self.A @ (point - self.pivot) + self.translation


def contact_forces(q: Array, C: Array) -> Tuple[Optional[Array], float]:
    """Forces l >= 0 with gaps q + C l >= 0 and l (q + C l) = 0, and by how many mm they miss that; None if they are not found.

    Exchanges all rows that are wrong at once, and after that has not helped the first one only (Murty), which ends because C is
    positive definite where it is used.
    """
    rows = len(q)
    active = np.zeros(rows, dtype=bool)
    for step in range(_MAX_BLOCK_STEPS + 20 * rows + 1):
        forces = np.zeros(rows)
        try:
            forces[active] = np.linalg.solve(C[np.ix_(active, active)], -q[active])
        except np.linalg.LinAlgError:
            return None, 0.0
        gaps = q + C @ forces
        wrong = np.where(active, forces < 0, gaps < -1e-12)
        if not wrong.any():
            return forces, float(np.abs(gaps[active]).max(initial=0))
        if step < _MAX_BLOCK_STEPS:
            active ^= wrong
        else:
            active[np.argmax(wrong)] ^= True
    return None, 0.0


class AnswerEvaluator:
    """The answers of one file. Constant: any number of threads may evaluate at once."""

    def __init__(self, data: bytes) -> None:
        """Raises ValueError if the bytes cannot be evaluated."""
        self.file = file = AnswerFile(data)
        self._width = 3 if file.model == GRADIENT_FIELD else 1
        try:
            self._prepare()
        except (ValueError, IndexError) as error:
            raise ValueError(f"prepared answers are damaged: sections that do not fit together ({error})") from error
        rest = [HandlePose([0, 0, 0], [0, 0, 0], [0, 0, 0], 1)] * file.handles
        try:
            self.evaluate(rest)
        except (ValueError, IndexError) as error:
            raise ValueError(f"prepared answers are damaged: sections that do not fit together ({error})") from error

    @property
    def is_estimate(self) -> bool:
        """Whether the errors are estimates, not bounds."""
        return self.file.model == NEO_HOOKEAN

    def _prepare(self) -> None:
        file = self.file
        self._is_free, self._is_fixed = file.regions == FREE, file.regions == FIXED
        held = file.regions[file.regions >= 0]
        self._held = [file.held[held == handle] for handle in range(file.handles)]
        self._held_places = [np.flatnonzero(file.regions == handle) for handle in range(file.handles)]
        self._largest_fixed = float(np.linalg.norm(file.fixed.astype(np.float64), axis=1).max(initial=0))
        if file.model == NEO_HOOKEAN:
            self._prepare_clusters()
            return
        rows = len(file.free) if self._width == 3 else 3 * len(file.free)
        self._columns = unpacked(file.section(24), file.section(25), file.section(26), rows)
        self._map = file.section(20).reshape(len(file.section(24)), -1)
        self._cut = file.section(22).reshape(-1, self._map.shape[1]).astype(np.float64)
        self._full = len(file.section(26)) // rows if rows > 0 else 0

    def _prepare_clusters(self) -> None:
        file = self.file
        self._map = unpacked(file.section(30), file.section(31), file.section(32), len(file.section(24)))
        self._clusters = []
        vertex = column = upper = lower = 0
        for vertices, columns, full in file.section(33, 3).tolist():
            size, full_size = 3 * vertices * columns, 3 * vertices * full
            own = unpacked(file.section(24)[column:column + columns], file.section(25)[upper:upper + size],
                           file.section(26)[lower:lower + full_size], 3 * vertices)
            self._clusters.append((file.section(34)[vertex:vertex + vertices], slice(column, column + columns), own))
            vertex, column, upper, lower = vertex + vertices, column + columns, upper + size, lower + full_size

    # Poses into factors.

    def _blended(self, poses: Sequence[HandlePose], u: Array) -> Tuple[Array, float]:
        w = sum((u[h] * pose.w for h, pose in enumerate(poses)), np.zeros(3))
        return w, 1 + sum(u[h] * (pose.scale - 1) for h, pose in enumerate(poses))

    def _gradient_factors(self, poses: Sequence[HandlePose]) -> Tuple[Array, float]:
        file = self.file
        nodes = file.section(12, file.handles)
        at_nodes = np.array([turn_minus_identity(*self._blended(poses, u)).ravel() for u in nodes])
        C = file.section(13).reshape(len(nodes), len(nodes)) @ at_nodes
        count = int(file.num_polynomials)
        blocks = [C[n].reshape(3, 3).T for n in range(count - 1, -1, -1)]
        for h, pose in enumerate(poses):
            blocks += [pose.A.T, pose.shift(file.section(10, 3)[h])[None, :]]
        sizes = np.linalg.norm(C, axis=1)
        gains = file.section(15)
        end = count + len(gains)
        error = sizes[count:end] @ gains + 1.5 * gains.max() * sizes[end:].sum()
        error += file.largest_gain_mm * self._remainder(poses)
        return np.concatenate(blocks), float(error)

    def _remainder(self, poses: Sequence[HandlePose]) -> float:
        file = self.file
        low = file.section(14)
        corners = [self._blended(poses, low)]
        corners += [self._blended(poses, low + file.simplex_width * axis) for axis in np.eye(file.handles)]
        diameter = max(float(np.linalg.norm(a[0] - b[0])) for a in corners for b in corners)
        if diameter == 0:
            return 0.0
        radius = diameter * math.sqrt(file.handles / (2 * file.handles + 2))
        degree = int(file.degree)

        def after(n: int) -> float:
            return min(1.0, 2.0 ** (4 - n)) * radius ** (n + 1) / math.factorial(n + 1)

        scales = [scale for _, scale in corners]
        return (max(scales) + min(scales)) / 2 * after(degree) + (max(scales) - min(scales)) / 2 * after(degree - 1)

    def _elastic_factors(self, poses: Sequence[HandlePose]) -> Array:
        origin = self.file.section(10)
        factors = [np.concatenate([pose.A, pose.shift(origin)[:, None]], axis=1).ravel() for pose in poses]
        return np.concatenate(factors)[:, None]

    def _contact_factors(self, coefficients: Array) -> Tuple[Optional[Array], float]:
        rows = len(self.file.section(50))
        if rows == 0:
            return np.zeros((0, 1)), 0.0
        q = self.file.section(50) + self.file.section(51).reshape(rows, -1) @ coefficients[:, 0]
        compliance = self.file.section(52).reshape(rows, rows)
        forces, residual = contact_forces(q, compliance)
        if forces is not None and len(self.file.section(58)) > 0:
            forces, of_seal = self._sealed(coefficients[:, 0], q, compliance, forces)
            residual += of_seal
        return None if forces is None else forces[:, None], residual

    def _sealed(self, a: Array, q: Array, compliance: Array, free: Array) -> Tuple[Optional[Array], float]:
        """Forces of contact and of the seal (docs/prepared-answers.md), from those of free lips."""
        upper_map, upper_forces, lower_map, lower_forces = (self.file.seal_matrix(number) for number in (53, 54, 55, 56))
        stiffness = self.file.seal_matrix(57)
        heights = upper_map @ a + upper_forces @ free
        unforced = lower_map @ a
        if not np.abs(heights - unforced - lower_forces @ free).max() <= self.file.section(58)[0]:
            return np.concatenate([free, np.zeros(len(heights))]), 0.0
        across = lower_forces.T @ stiffness
        shrunk = across @ lower_forces
        forces, residual = contact_forces(q + across @ (heights - unforced), compliance - (shrunk + shrunk.T) / 2)
        if forces is None:
            return None, 0.0
        return np.concatenate([forces, stiffness @ (heights - unforced) - across.T @ forces]), residual

    def _pairs(self, poses: Sequence[HandlePose]) -> Tuple[Array, Array]:
        numbers: List[float] = []
        for pose, centroid in zip(poses, self.file.section(11, 3)):
            R = turn_minus_identity(pose.w, 1)
            numbers += [(R[2, 1] - R[1, 2]) / 2, (R[0, 2] - R[2, 0]) / 2, (R[1, 0] - R[0, 1]) / 2]
            numbers += list(pose.shift(centroid))
        n = np.array(numbers)
        products = [(1 if a == b else 2) * n[a] * n[b] for a in range(len(n)) for b in range(a, len(n))]
        return n, np.array(products)

    def _neo_hookean_factors(self, poses: Sequence[HandlePose]) -> Tuple[Array, float]:
        file = self.file
        n, products = self._pairs(poses)
        factors = [self._elastic_factors(poses), products[:, None]]
        error = self._second_order_error(products)
        if len(file.section(44)) > 0:
            triples, q = self._third_order(n, products)
            factors.append(triples[:, None] / (1 + q))
            error = max(error, float(np.linalg.norm(file.section(45) * triples))) * q / (1 + q)
        error += file.rounding_mm + file.cut_per_mm * float(np.linalg.norm(file.section(40) * n))
        return np.concatenate(factors), error

    def _third_order(self, n: Array, pairs: Array) -> Tuple[Array, float]:
        """The triples' products, and how long their order is next to the second."""
        triples = []
        for a in range(len(n)):
            for b in range(a, len(n)):
                for c in range(b, len(n)):
                    orders = (6, 3, 1)[(a == b) + (b == c)]
                    triples.append(orders * n[a] * n[b] * n[c])
        products = np.array(triples)
        second = float(np.linalg.norm(self.file.section(43).reshape(-1, len(pairs)).astype(np.float64) @ pairs))
        third = float(np.linalg.norm(self.file.section(44).reshape(-1, len(products)).astype(np.float64) @ products))
        return products, third / second if second > 0 else 0.0

    def _second_order_error(self, products: Array) -> float:
        file = self.file
        moves = file.section(42).reshape(-1, len(products)).astype(np.float64) @ products
        farthest = float(np.linalg.norm(moves.reshape(-1, 3), axis=1).max(initial=0))
        single = float(np.linalg.norm(file.section(41) * products))
        return float(file.estimate_scale * (farthest * single) ** 0.75 / math.sqrt(file.size_mm))

    # Factors into displacements of free vertices.

    def _compressed(self, factors: Array) -> Tuple[Array, float]:
        """The displacements, and the bound of what compression and single precision do."""
        file = self.file
        g = self._map @ factors
        moves = self._columns @ g.astype(np.float32)
        error = float(np.linalg.norm(self._cut @ factors, axis=1).sum())
        error += float(file.section(23).astype(np.float64) @ np.linalg.norm(factors, axis=1))
        error *= 1 + 1e-4
        sizes = np.linalg.norm(g, axis=1)
        only_upper = len(sizes) - self._full
        half_step = (0.5 if self._width == 3 else math.sqrt(3) / 2) * 65536
        error += half_step * float(file.section(24)[:only_upper] @ sizes[:only_upper])
        sums = np.cumsum(sizes * file.section(21))
        total = float(sums[-1]) if len(sums) > 0 else 0.0
        error += 5.98e-8 * (4 * total + float(sums.sum()) + 2 * file.largest_rest_mm)
        return moves.reshape(-1, 3), error

    def _clustered(self, factors: Array) -> Array:
        g = self._map @ factors[:, 0].astype(np.float32)
        moves = np.zeros((len(self.file.free), 3), dtype=np.float32)
        for vertices, own, columns in self._clusters:
            moves[vertices] = (columns @ g[own]).reshape(-1, 3)
        return moves

    # All together.

    def _held_error(self, poses: Sequence[HandlePose]) -> float:
        largest = self._largest_fixed
        for pose, rest in zip(poses, self._held):
            if len(rest) > 0:
                low, high = rest.min(axis=0), rest.max(axis=0)
                middle = (low + high) / 2
                moved = float(np.linalg.norm(middle + pose.shift(middle)))
                largest = max(largest, moved + pose.scale * float(np.linalg.norm(high - low)) / 2)
        return 5.97e-8 * largest

    def _displacements(self, poses: Sequence[HandlePose]) -> Tuple[Optional[Array], float]:
        if self.file.model == NEO_HOOKEAN:
            factors, error = self._neo_hookean_factors(poses)
            return self._clustered(factors), error
        if self.file.model == GRADIENT_FIELD:
            factors, error = self._gradient_factors(poses)
        else:
            factors = self._elastic_factors(poses)
            forces, error = self._contact_factors(factors)
            if forces is None:
                return None, 0.0
            factors = np.concatenate([factors, forces])
        moves, compression_error = self._compressed(factors)
        return moves, error + compression_error

    def evaluate(self, poses: Sequence[HandlePose]) -> Tuple[Optional[Array], float]:
        """Positions (#V, 3) float32 in mm and their error in mm (of neo_hookean an estimate); None if forces of contact are not found."""
        moves, error = self._displacements(poses)
        if moves is None:
            return None, 0.0
        positions = np.empty((len(self.file.regions), 3), dtype=np.float32)
        positions[self._is_free] = self.file.free + moves
        positions[self._is_fixed] = self.file.fixed
        origin = np.zeros(3)
        for pose, rest, places in zip(poses, self._held, self._held_places):
            positions[places] = rest + rest @ pose.A.T + pose.shift(origin)
        return positions, max(error, self._held_error(poses))

    def covers(self, poses: Sequence[HandlePose], error: float) -> bool:
        """Whether an answer with this error may be used; otherwise ask the server."""
        file = self.file
        if file.model != LINEAR_ELASTIC and any(np.linalg.norm(pose.w) > file.max_rotation_rad * (1 + _SLACK) for pose in poses):
            return False
        if file.model == GRADIENT_FIELD and any(abs(pose.scale - 1) > file.max_scale_change + _SLACK for pose in poses):
            return False
        if file.model == NEO_HOOKEAN and any(pose.scale != 1 for pose in poses):
            return False
        return error <= (file.max_estimate_mm if file.model == NEO_HOOKEAN else file.tolerance_mm)

    def band(self, poses: Sequence[HandlePose]) -> Array:
        """Of every vertex in mm, where there are columns of the band; empty otherwise, and where a handle turns too far."""
        file = self.file
        steps, upper = file.section(61), file.section(62)
        largest = min(file.max_rotation_rad, _LARGEST_BAND_ROTATION) * (1 + _SLACK)
        if len(steps) == 0 or any(np.linalg.norm(pose.w) > largest for pose in poses):
            return np.zeros(0)
        g = file.section(60).reshape(len(steps), 12 * file.handles) @ self._elastic_factors(poses)[:, 0]
        fields = (unpacked(steps, upper, np.zeros(0), len(upper) // len(steps)) @ g).reshape(-1, len(file.free), 3)
        covariance = np.einsum("kvi,kvj->vij", fields, fields)
        trace = np.trace(covariance, axis1=1, axis2=2)
        squares = (covariance ** 2).sum(axis=(1, 2))
        moving = squares > 0
        x = np.clip(trace[moving] ** 2 / squares[moving], 1, 3) - 2
        of_free = np.zeros(len(file.free))
        root = _OF_TWO + (_OF_THREE - _OF_ONE) / 2 * x + (_OF_ONE - 2 * _OF_TWO + _OF_THREE) / 2 * x * x
        of_free[moving] = np.sqrt(squares[moving] / trace[moving]) * root
        band = np.zeros(len(file.regions))
        band[self._is_free] = of_free
        return band
