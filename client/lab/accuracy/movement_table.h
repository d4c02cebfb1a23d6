// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include "client/lab/accuracy/accuracy_run.h"
#include "core/base/csv_table.h"

namespace tissueform {

// Where chin, lower lip, upper lip and nose go: the vertex of each that lies foremost at rest, and
// the mean over all of its vertices. A case without these places adds no rows.

// Columns case, nu, answer (of a model or a reference), place, vertex (the foremost one), its
// forward_mm, up_mm, left_mm (the patient's) and moved_mm; the place's mean_forward_mm, mean_up_mm
// and mean_left_mm; notice.
CsvTable MovementTable();
void AddMovementRows(const AccuracyCase& problem, const std::vector<AccuracyResult>& results,
                     CsvTable* table);

// For people: forward / up in mm of the foremost vertex and, behind a semicolon, of the place's
// mean, at one Poisson's ratio, one row for each case and place.
CsvTable MovementSummary();
void AddMovementSummaryRows(const AccuracyCase& problem, const AccuracyResult& result,
                            CsvTable* table);

}  // namespace tissueform
