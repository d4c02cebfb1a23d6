#!/usr/bin/python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Evaluates prepared answers as docs/prepared-answers.md says, with numpy and nothing of ours.

Usage: evaluate_golden_answers.py CASES.json

The positions of every case must be within 1e-4 mm of those that are written there, the error within a millionth of it.
Exits with 77 where numpy is not installed.
"""

import json
import math
import pathlib
import struct
import sys

try:
    import numpy as np
except ModuleNotFoundError as missing:
    print(missing)
    sys.exit(77)

AGREEMENT_MM = 1e-4
BAND_AGREEMENT_MM = 2e-3
TYPES = {1: "<f8", 2: "<f4", 3: "<i4", 4: "<i2"}
NUMBERS = (
    "model num_vertices num_handles tolerance_mm max_rotation_rad max_scale_change max_estimate_mm largest_rest_mm "
    "num_polynomials degree simplex_width largest_gain_mm size_mm estimate_scale cut_per_mm rounding_mm"
).split()
GRADIENT_FIELD, LINEAR_ELASTIC, NEO_HOOKEAN = 1, 2, 3
FREE, FIXED = -2, -1


def read_sections(data):
    magic, version, count = struct.unpack_from("<8sII", data, 0)
    if magic != b"TFANSWER" or version not in (1, 2, 3):
        sys.exit(f"not prepared answers of version 1 to 3: {magic} {version}")
    sections = {}
    for i in range(count):
        number, kind, offset, length = struct.unpack_from("<IIII", data, 16 + 16 * i)
        if offset % 16 != 0:
            sys.exit(f"section {number} is not aligned")
        sections[number] = np.frombuffer(data, TYPES[kind], length, offset)
    return sections


def turn_minus_identity(w, scale):
    """scale R(w) - I by Rodrigues' formula."""
    angle = np.linalg.norm(w)
    if angle == 0:
        return (scale - 1) * np.eye(3)
    x, y, z = w / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return scale * (np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross) - np.eye(3)


class Answers:
    """One file."""

    def __init__(self, data):
        self.sections = read_sections(data)
        for name, value in zip(NUMBERS, self.sections[1]):
            setattr(self, name, float(value))
        self.handles = int(self.num_handles)
        self.regions = self.section(2)
        self.free = self.section(3, 3)
        self.fixed = self.section(4, 3)
        self.held = self.section(5, 3)
        self.columns = len(self.section(24))

    def section(self, number, width=None):
        values = self.sections.get(number, np.zeros(0))
        return values if width is None else values.reshape(-1, width)

    @staticmethod
    def unpacked(steps, upper, lower, rows):
        """#rows by #columns; `upper` alone where there is no `lower`."""
        columns = len(steps)
        units = 65536.0 * upper.astype(np.float64).reshape(columns, rows)
        if rows > 0 and len(lower) > 0:
            full = len(lower) // rows
            units[columns - full:] += lower.reshape(full, rows)
        return (units * steps[:, None]).T

    # Poses into factors.

    def blended(self, poses, u):
        w = sum((u[h] * pose["w"] for h, pose in enumerate(poses)), np.zeros(3))
        return w, 1 + sum(u[h] * (pose["scale"] - 1) for h, pose in enumerate(poses))

    def motion(self, pose, point):
        A = turn_minus_identity(pose["w"], pose["scale"])
        return A, A @ (point - pose["pivot"]) + pose["translation"]

    def gradient_factors(self, poses):
        nodes = self.section(12, self.handles)
        at_nodes = np.array([turn_minus_identity(*self.blended(poses, u)).ravel() for u in nodes])
        C = self.section(13).reshape(len(nodes), len(nodes)) @ at_nodes
        count = int(self.num_polynomials)
        blocks = [C[n].reshape(3, 3).T for n in range(count - 1, -1, -1)]
        for h, pose in enumerate(poses):
            A, b = self.motion(pose, self.section(10, 3)[h])
            blocks += [A.T, b[None, :]]
        sizes = np.linalg.norm(C, axis=1)
        gains = self.section(15)
        end = count + len(gains)
        error = sizes[count:end] @ gains + 1.5 * gains.max() * sizes[end:].sum()
        error += self.largest_gain_mm * self.remainder(poses)
        return np.concatenate(blocks), error

    def remainder(self, poses):
        low = self.section(14)
        corners = [self.blended(poses, low)]
        corners += [self.blended(poses, low + self.simplex_width * axis) for axis in np.eye(self.handles)]
        diameter = max(np.linalg.norm(a[0] - b[0]) for a in corners for b in corners)
        if diameter == 0:
            return 0
        radius = diameter * math.sqrt(self.handles / (2 * self.handles + 2))
        degree = int(self.degree)

        def after(n):
            return min(1, 2.0 ** (4 - n)) * radius ** (n + 1) / math.factorial(n + 1)

        scales = [scale for _, scale in corners]
        return (max(scales) + min(scales)) / 2 * after(degree) + (max(scales) - min(scales)) / 2 * after(degree - 1)

    def elastic_factors(self, poses):
        factors = []
        for pose in poses:
            A, b = self.motion(pose, self.section(10))
            factors.append(np.concatenate([A, b[:, None]], axis=1).ravel())
        return np.concatenate(factors)[:, None]

    def contact_forces(self, coefficients):
        """Forces l >= 0 with gaps q + C l >= 0 and l (q + C l) = 0, by Murty's least index: the first row that is wrong
        changes sides. It ends because C is positive definite."""
        q = self.section(50).copy()
        rows = len(q)
        if rows == 0:
            return np.zeros((0, 1))
        q += self.section(51).reshape(rows, -1) @ coefficients[:, 0]
        C = self.section(52).reshape(rows, rows)
        active = np.zeros(rows, bool)
        while True:
            forces = np.zeros(rows)
            forces[active] = np.linalg.solve(C[np.ix_(active, active)], -q[active])
            gaps = q + C @ forces
            wrong = np.where(active, forces < 0, gaps < -1e-12)
            if not wrong.any():
                return forces[:, None]
            active[np.argmax(wrong)] ^= True

    def pairs(self, poses):
        numbers = []
        for pose, centroid in zip(poses, self.section(11, 3)):
            R = turn_minus_identity(pose["w"], 1)
            numbers += [(R[2, 1] - R[1, 2]) / 2, (R[0, 2] - R[2, 0]) / 2, (R[1, 0] - R[0, 1]) / 2]
            numbers += list(self.motion(pose, centroid)[1])
        n = np.array(numbers)
        products = [(1 if a == b else 2) * n[a] * n[b] for a in range(len(n)) for b in range(a, len(n))]
        return n, np.array(products)

    def neo_hookean_factors(self, poses):
        n, products = self.pairs(poses)
        factors = [self.elastic_factors(poses), products[:, None]]
        error = self.second_order_error(products)
        if len(self.section(44)) > 0:
            triples, q = self.third_order(n, products)
            factors.append(triples[:, None] / (1 + q))
            error = max(error, np.linalg.norm(self.section(45) * triples)) * q / (1 + q)
        error += self.rounding_mm + self.cut_per_mm * np.linalg.norm(self.section(40) * n)
        return np.concatenate(factors), error

    def third_order(self, n, pairs):
        """The triples' products, and how long their order is beside the second."""
        triples = []
        for a in range(len(n)):
            for b in range(a, len(n)):
                for c in range(b, len(n)):
                    orders = (6, 3, 1)[(a == b) + (b == c)]
                    triples.append(orders * n[a] * n[b] * n[c])
        triples = np.array(triples)
        second = np.linalg.norm(self.section(43).reshape(-1, len(pairs)).astype(np.float64) @ pairs)
        third = np.linalg.norm(self.section(44).reshape(-1, len(triples)).astype(np.float64) @ triples)
        return triples, third / second if second > 0 else 0

    def second_order_error(self, products):
        moves = self.section(42).reshape(-1, len(products)).astype(np.float64) @ products
        farthest = np.linalg.norm(moves.reshape(-1, 3), axis=1).max(initial=0)
        single = np.linalg.norm(self.section(41) * products)
        return self.estimate_scale * (farthest * single) ** 0.75 / math.sqrt(self.size_mm)

    # Factors into displacements of free vertices.

    def compressed(self, factors):
        """The displacements, and the bound of what compression and single precision do."""
        width = factors.shape[1]
        g = self.section(20).reshape(self.columns, len(factors)) @ factors
        rows = len(self.free) if width == 3 else 3 * len(self.free)
        moves = self.unpacked(self.section(24), self.section(25), self.section(26), rows) @ g
        cut = self.section(22).reshape(-1, len(factors)).astype(np.float64) @ factors
        error = np.linalg.norm(cut, axis=1).sum() + self.section(23).astype(np.float64) @ np.linalg.norm(factors, axis=1)
        error *= 1 + 1e-4
        sizes = np.linalg.norm(g, axis=1)
        full = len(self.section(26)) // rows if rows > 0 else 0
        only_upper = self.columns - full
        half_step = (0.5 if width == 3 else math.sqrt(3) / 2) * 65536
        error += half_step * (self.section(24)[:only_upper] @ sizes[:only_upper])
        sums = np.cumsum(sizes * self.section(21))
        total = sums[-1] if len(sums) > 0 else 0
        error += 5.98e-8 * (4 * total + sums.sum() + 2 * self.largest_rest_mm)
        return moves.reshape(-1, 3), error

    def clustered(self, factors):
        g = self.unpacked(self.section(30), self.section(31), self.section(32), self.columns) @ factors[:, 0]
        moves = np.zeros((len(self.free), 3))
        vertex = column = upper = lower = 0
        for vertices, columns, full in self.section(33, 3):
            size, full_size = 3 * vertices * columns, 3 * vertices * full
            own = self.unpacked(self.section(24)[column:column + columns], self.section(25)[upper:upper + size],
                                self.section(26)[lower:lower + full_size], 3 * vertices)
            moves[self.section(34)[vertex:vertex + vertices]] = (own @ g[column:column + columns]).reshape(-1, 3)
            vertex, column, upper, lower = vertex + vertices, column + columns, upper + size, lower + full_size
        return moves

    # All together.

    def held_error(self, poses):
        largest = np.linalg.norm(self.fixed.astype(np.float64), axis=1).max(initial=0)
        regions = self.regions[self.regions >= 0]
        for h, pose in enumerate(poses):
            rest = self.held[regions == h]
            if len(rest) == 0:
                continue
            low, high = rest.min(axis=0), rest.max(axis=0)
            middle = (low + high) / 2
            moved = middle + self.motion(pose, middle)[1]
            largest = max(largest, np.linalg.norm(moved) + pose["scale"] * np.linalg.norm(high - low) / 2)
        return 5.97e-8 * largest

    def evaluate(self, poses):
        """Positions and error."""
        if self.model == NEO_HOOKEAN:
            factors, error = self.neo_hookean_factors(poses)
            moves = self.clustered(factors)
        else:
            gradient = self.model == GRADIENT_FIELD
            factors, error = self.gradient_factors(poses) if gradient else (self.elastic_factors(poses), 0)
            if not gradient:
                factors = np.concatenate([factors, self.contact_forces(factors)])
            moves, compression_error = self.compressed(factors)
            error += compression_error
        positions = np.zeros((len(self.regions), 3))
        positions[self.regions == FREE] = self.free + moves
        positions[self.regions == FIXED] = self.fixed
        regions = self.regions[self.regions >= 0]
        for h, pose in enumerate(poses):
            A, b = self.motion(pose, np.zeros(3))
            rest = self.held[regions == h]
            positions[self.regions == h] = rest + rest @ A.T + b
        return positions, max(error, self.held_error(poses))

    def band(self, poses):
        """Of every vertex, where there are columns of the band; empty where a handle turns too far."""
        if any(np.linalg.norm(pose["w"]) > min(self.max_rotation_rad, 0.524) * (1 + 1e-9) for pose in poses):
            return np.zeros(0)
        steps, upper = self.section(61), self.section(62)
        g = self.section(60).reshape(len(steps), 12 * self.handles) @ self.elastic_factors(poses)[:, 0]
        rows = len(upper) // len(steps)
        fields = (self.unpacked(steps, upper, np.zeros(0), rows) @ g).reshape(-1, len(self.free), 3)
        covariance = np.einsum("kvi,kvj->vij", fields, fields)
        trace = np.trace(covariance, axis1=1, axis2=2)
        squares = (covariance ** 2).sum(axis=(1, 2))
        moving = squares > 0
        x = np.clip(trace[moving] ** 2 / squares[moving], 1, 3) - 2
        root = 2.447747 + 0.5 * (2.795483 - 1.959964) * x + 0.5 * (1.959964 - 2 * 2.447747 + 2.795483) * x * x
        of_free = np.zeros(len(self.free))
        of_free[moving] = np.sqrt(squares[moving] / trace[moving]) * root
        band = np.zeros(len(self.regions))
        band[self.regions == FREE] = of_free
        return band

    def covers(self, poses, error):
        slack = 1e-9
        if self.model != LINEAR_ELASTIC:
            if any(np.linalg.norm(pose["w"]) > self.max_rotation_rad * (1 + slack) for pose in poses):
                return False
        if self.model == GRADIENT_FIELD and any(abs(p["scale"] - 1) > self.max_scale_change + slack for p in poses):
            return False
        if self.model == NEO_HOOKEAN and any(pose["scale"] != 1 for pose in poses):
            return False
        return error <= (self.max_estimate_mm if self.model == NEO_HOOKEAN else self.tolerance_mm)


def pose_of(case):
    return {"w": np.array(case["rotation_vector"]), "pivot": np.array(case["pivot_mm"]),
            "translation": np.array(case["translation_mm"]), "scale": case["scale"]}


def main(path):
    golden = json.loads(path.read_text())
    answers = Answers((path.parent / golden["answers"]).read_bytes())
    for number, case in enumerate(golden["cases"]):
        poses = [pose_of(pose) for pose in case["poses"]]
        positions, error = answers.evaluate(poses)
        if abs(error - case["error_mm"]) > 1e-6 * case["error_mm"] + 1e-9:
            sys.exit(f"case {number}: the error is {error}, not {case['error_mm']}")
        if answers.covers(poses, error) != case["covered"]:
            sys.exit(f"case {number}: covered is not {case['covered']}")
        if not case["covered"]:
            continue
        off = np.abs(positions - np.array(case["positions_mm"]).reshape(-1, 3)).max()
        if not off <= AGREEMENT_MM:
            sys.exit(f"case {number}: off by {off} mm")
        if "band_mm" in case:
            band, wanted = answers.band(poses), np.array(case["band_mm"])
            if len(band) != len(wanted):
                sys.exit(f"case {number}: {len(band)} numbers of the band, not {len(wanted)}")
            off = np.abs(band - wanted).max(initial=0)
            if not off <= BAND_AGREEMENT_MM:
                sys.exit(f"case {number}: the band is off by {off} mm")


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
