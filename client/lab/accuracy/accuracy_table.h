// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include "client/lab/accuracy/accuracy_run.h"
#include "core/base/csv_table.h"

namespace tissueform {

// Columns case, nu, model, reference, region ("all", "skin", places of a head's skin), mean_mm to
// max_mm, mean_percent (of the reference's largest displacement), seconds, reference_seconds,
// inverted_tets, converged, vertices and vertices_over_2_mm of the region, notice.
CsvTable AccuracyTable();
void AddAccuracyRows(const AccuracyCase& problem, const std::vector<AccuracyResult>& results,
                     CsvTable* table);

// For people: mean / max in mm over all vertices against both references at one Poisson's ratio,
// one row for each case and model.
CsvTable AccuracySummary();
void AddSummaryRows(const AccuracyCase& problem, const AccuracyResult& result, CsvTable* table);

// For people: p50 / p95 / p99 / max in mm to CalculiX's neo-Hookean answer on the places of a
// head's skin, one row for each case and place. A case without places or without this reference
// adds none.
CsvTable PlaceSummary();
void AddPlaceSummaryRows(const AccuracyCase& problem, const AccuracyResult& result,
                         CsvTable* table);

}  // namespace tissueform
