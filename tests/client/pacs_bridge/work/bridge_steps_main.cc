// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// What the crash test kills: takes a series from received files to a published case, and an export
// to the PACS, each as a folder. Ends itself by SIGKILL at the fault point that is passed as the
// KILL_AT-th (0: never), and prints how many were passed. Where WORLD_DIR has a merged.dcm the PACS
// gives that as the series' header, and places count from the export on.
//
//   tissueform-bridge-steps STATE_DIR WORLD_DIR KILL_AT

#include <atomic>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "client/pacs_bridge/work/export_work.h"
#include "client/pacs_bridge/work/plan_work.h"
#include "client/pacs_bridge/work/series_intake.h"
#include "core/planning/case_file/case_writer.h"
#include "server/platform/storage/fault_points.h"
#include "tests/client/pacs_bridge/work/bridge_world.h"
#include "tests/core/planning/case_file/sample_case.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

std::atomic<int> passed = 0;
int kill_at = 0;

void Pass(const char*) {
  if (++passed == kill_at) std::raise(SIGKILL);
}

// In place of `plan build` and `case pack`, which take long.
absl::Status StandInForPacking(BridgeQueue* queue, QueuedSeries* series) {
  TF_ASSIGN_OR_RETURN(const std::string bytes, SerializeCase(SampleCase()));
  series->case_name = "cases/" + Sha256Hex({bytes});
  std::ofstream(CasePathOf(*queue, series->key, series->case_name)) << bytes;
  series->state = SeriesState::kPacked;
  return ReceivedRows(queue).Update(*series);
}

absl::Status DoSeries(BridgeQueue* queue, CaseServer* server, QueuedSeries* series) {
  SeriesIntakeOptions options;
  SeriesRule rule;
  rule.recipe = "recipe.json";
  rule.min_slices = 8;
  rule.max_spacing_mm = 10;
  rule.max_thickness_mm = 10;
  rule.min_coverage_mm = 0;
  options.rules = {rule};
  options.quiet = std::chrono::milliseconds(0);
  SeriesIntake intake(queue, options);
  TF_RETURN_IF_ERROR(intake.Recover());
  TF_RETURN_IF_ERROR(intake.Settle().status());
  TF_ASSIGN_OR_RETURN(const std::vector<QueuedSeries> all, ReceivedRows(queue).List());
  if (all.size() != 1) return absl::InternalError("there is not one series");
  *series = all.front();
  PlanWork work(queue, server, {});
  while (series->state != SeriesState::kPublished) {
    if (series->state == SeriesState::kChosen) {
      const fs::path plan = fs::path(queue->plan_folder(series->key)) / "plan";
      fs::create_directories(plan);
      std::ofstream(plan / "plan.json") << "{}";
    }
    if (series->state == SeriesState::kBuilt) {
      TF_RETURN_IF_ERROR(StandInForPacking(queue, series));
    } else {
      TF_RETURN_IF_ERROR(work.Step(series));
    }
  }
  return absl::OkStatus();
}

absl::Status DoExport(BridgeQueue* queue, CaseServer* server, PacsClient* pacs,
                      const QueuedSeries& series) {
  testing::HeaderWriter writer;
  ExportWork work(queue, server, pacs, &writer, {});
  v1::Export requested;
  requested.set_name("exports/1");
  requested.set_prediction("predictions/1");
  requested.set_case_(series.case_name);
  requested.set_state(v1::EXPORT_STATE_WAITING);
  TF_RETURN_IF_ERROR(work.Take(requested));
  ExportRows rows(queue);
  TF_ASSIGN_OR_RETURN(QueuedExport queued, rows.Get("exports/1"));
  while (queued.state != BridgeExportState::kReported) {
    if (queued.state == BridgeExportState::kAsked) {
      TF_ASSIGN_OR_RETURN(const QueuedStudy study, ReceivedRows(queue).GetStudy(series.study_uid));
      TF_RETURN_IF_ERROR(rows.Confirm("exports/1", DigestOf(study.patient)));
      TF_ASSIGN_OR_RETURN(queued, rows.Get("exports/1"));
    }
    TF_RETURN_IF_ERROR(work.Step(&queued));
  }
  return absl::OkStatus();
}

absl::Status DoEverything(const std::string& state, const fs::path& world) {
  const fs::path merged = world / "merged.dcm";
  if (!fs::exists(merged)) fault_hook = Pass;
  TF_ASSIGN_OR_RETURN(const auto queue, BridgeQueue::Open(state));
  testing::FolderCaseServer server(world / "server");
  testing::FolderPacs pacs(world / "pacs");
  QueuedSeries series;
  TF_RETURN_IF_ERROR(DoSeries(queue.get(), &server, &series));
  TF_ASSIGN_OR_RETURN(const std::vector<QueuedImage> images,
                      ReceivedRows(queue.get()).ListImages(series.key));
  pacs.headers[series.uid] = fs::exists(merged) ? merged.string() : images.front().file;
  fault_hook = Pass;
  return DoExport(queue.get(), &server, &pacs, series);
}

}  // namespace
}  // namespace tissueform

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  tissueform::kill_at = std::atoi(argv[3]);
  const absl::Status status = tissueform::DoEverything(argv[1], argv[2]);
  std::fprintf(stderr, "%s\n", status.ToString().c_str());
  std::printf("%d\n", tissueform::passed.load());
  return status.ok() ? 0 : 1;
}
