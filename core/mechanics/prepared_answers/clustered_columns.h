// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "core/base/types.h"
#include "core/mechanics/answer_evaluator/portable_answers.h"

namespace tissueform {

struct ClusterUses {
  Eigen::MatrixXd typical;  // #columns by #uses: what the columns are turned for
  Eigen::MatrixXd tried;    // #columns by #uses, some hundred: what the cut is judged by
  Eigen::VectorXd room_mm;  // of every use tried: how far it may put a vertex off
};

// Writes many columns of which every place of the surface needs few: vertices are divided into
// clusters of neighbors, and each has axes of its own, as many as it needs. With f the factors of
// all columns
//   displacements of cluster k = columns_k * (map_k * f),
// columns_k the columns of its vertices turned to their principal axes under the weight of typical
// uses (as ColumnCompression does for all vertices at once). Of 207 columns over the skin of a head
// with three handles a cluster of 128 vertices needs 17 on average.
//
// What is cut is judged by uses that are tried, not by a bound, which adds up what the many small
// columns do as if they all did it at once: for answers that are estimates themselves.
//
// `rest`: of the free vertices, whose single precision `answers` have. `columns`: 3 #free (3 v +
// axis) by #columns, mm. The cut puts no vertex off by more than the room of any use that is tried.
// Entries have 16 bits where that is enough for it, else 32.
void ClusterColumns(const Positions& rest, const Eigen::MatrixXd& columns, const ClusterUses& uses,
                    PortableAnswers* answers);

// Where clusters put the free vertices, by the evaluator's product; #free by 3.
FloatPositions EvaluateClusters(const PortableAnswers& answers, const Eigen::VectorXd& factors);

// At most, while they are made and later.
int64_t ClusteredColumnsBytes(Eigen::Index num_vertices, Eigen::Index columns);

}  // namespace tissueform
