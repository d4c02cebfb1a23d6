// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "client/pacs_bridge/work/export_work.h"
#include "client/pacs_bridge/work/plan_work.h"
#include "client/pacs_bridge/work/series_intake.h"
#include "core/planning/case_file/case_writer.h"
#include "tests/client/pacs_bridge/work/bridge_world.h"
#include "tests/core/planning/case_file/sample_case.h"
#include "tests/testing/ct_series.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_authority.h"

namespace tissueform::testing {

inline SeriesRule SmallRule() {
  SeriesRule rule;
  rule.recipe = "recipe.json";
  rule.min_slices = 8;
  rule.max_spacing_mm = 10;
  rule.max_thickness_mm = 10;
  rule.min_coverage_mm = 0;
  return rule;
}

// A bridge in folders, with a clock that stands: for the tests of its parts.
class BridgeWork : public ::testing::Test {
 protected:
  BridgeWork()
      : root_(EmptyTestFolder("bridge_work")),
        queue_(*BridgeQueue::Open((root_ / "state").string())),
        rows_(queue_.get()),
        exports_(queue_.get()) {
    std::filesystem::create_directories(root_ / "server");
    std::filesystem::create_directories(root_ / "pacs");
    server_ = std::make_unique<FolderCaseServer>(root_ / "server");
    pacs_ = std::make_unique<FolderPacs>(root_ / "pacs");
    ExportWorkOptions work;
    work.warn = [this](const std::string& line) { warnings_.push_back(line); };
    work_ = std::make_unique<ExportWork>(queue_.get(), server_.get(), pacs_.get(), &writer_, work);
    UseRule(SmallRule());
  }

  // Restarts the intake with this rule.
  void UseRule(const SeriesRule& rule) {
    SeriesIntakeOptions options;
    options.rules = {rule};
    options.quiet = std::chrono::seconds(30);
    options.find_series = [this](const std::string& study) { return FindSeries(study); };
    options.now = [this] { return now_; };
    intake_ = std::make_unique<SeriesIntake>(queue_.get(), options);
  }

  // What the PACS says of a study.
  absl::StatusOr<std::vector<SeriesSummary>> FindSeries(const std::string& study) {
    ++asked_;
    if (count_ < 0) return absl::UnavailableError("no PACS");
    std::vector<SeriesSummary> all = elsewhere_;
    const std::vector<QueuedSeries> known = *rows_.ListStudy(study);
    for (const QueuedSeries& series : known) {
      all.push_back({.study_uid = study,
                     .series_uid = series.uid,
                     .modality = "CT",
                     .instances = static_cast<int>(count_)});
    }
    return all;
  }

  // Shows a series to the intake, but for some slices.
  CtSeries Receive(const std::string& name, const CtSeriesOptions& options = {},
                   const std::vector<size_t>& without = {}) {
    const std::filesystem::path folder = std::filesystem::path(queue_->received_folder()) / name;
    std::filesystem::create_directories(folder);
    CtSeries series = WriteCtSeries(folder, options);
    for (size_t i = 0; i < series.files.size(); ++i) {
      if (std::count(without.begin(), without.end(), i) > 0) {
        std::filesystem::rename(series.files[i], (root_ / (name + std::to_string(i))));
      } else {
        intake_->Arrived(series.files[i], *ReadInstanceHeader(series.files[i]));
      }
    }
    return series;
  }
  SeriesState StateOf(const CtSeries& series) { return rows_.GetByUid(series.series_uid)->state; }
  void Settle() { ASSERT_THAT(intake_->Settle(), IsOk()); }
  void WaitQuietly() { now_ += std::chrono::seconds(31); }

  // A case of a chosen series, as if it was built and packed.
  QueuedSeries MakeCase(const CtSeries& received) {
    QueuedSeries series = *rows_.GetByUid(received.series_uid);
    CaseFile contents = SampleCase();
    contents.title = series.key;
    const std::string bytes = *SerializeCase(contents);
    std::filesystem::create_directories(queue_->plan_folder(series.key));
    series.case_name = "cases/" + Sha256Hex({bytes});
    std::ofstream(CasePathOf(*queue_, series.key, series.case_name)) << bytes;
    series.state = SeriesState::kPublished;
    series.done_s = 1'000'000;
    EXPECT_THAT(rows_.Update(series), IsOk());
    pacs_->headers[received.series_uid] = received.files.front();
    return series;
  }
  CtSeries ReceiveWithCase(const std::string& name, const CtSeriesOptions& options = {}) {
    CtSeries series = Receive(name, options);
    WaitQuietly();
    Settle();
    EXPECT_EQ(StateOf(series), SeriesState::kChosen);
    MakeCase(series);
    return series;
  }
  void Ask(const std::string& name, const CtSeries& series) {
    v1::Export requested;
    requested.set_name(name);
    requested.set_prediction("predictions/1");
    requested.set_case_(rows_.GetByUid(series.series_uid)->case_name);
    requested.set_state(v1::EXPORT_STATE_WAITING);
    ASSERT_THAT(work_->Take(requested), IsOk());
  }
  void Confirm(const std::string& name) {
    const QueuedSeries series = *rows_.GetByCase(exports_.Get(name)->case_name);
    ASSERT_THAT(exports_.Confirm(name, DigestOf(rows_.GetStudy(series.study_uid)->patient)),
                IsOk());
  }
  // All steps that go at once; the last status.
  absl::Status Work(const std::string& name) {
    QueuedExport queued = *exports_.Get(name);
    absl::Status status;
    for (int i = 0; i < 10 && status.ok() && queued.state != BridgeExportState::kAsked; ++i) {
      status = work_->Step(&queued);
    }
    return status;
  }
  BridgeExportState StateOfExport(const std::string& name) { return exports_.Get(name)->state; }
  std::vector<std::string> Stored() { return LinesOfFile(root_ / "pacs/stores"); }
  std::vector<std::string> Updates() { return LinesOfFile(root_ / "server/updates"); }

  const std::filesystem::path root_;
  const std::unique_ptr<BridgeQueue> queue_;
  ReceivedRows rows_;
  ExportRows exports_;
  std::unique_ptr<FolderCaseServer> server_;
  std::unique_ptr<FolderPacs> pacs_;
  HeaderWriter writer_;
  std::vector<std::string> warnings_;
  std::unique_ptr<ExportWork> work_;
  std::chrono::steady_clock::time_point now_ = std::chrono::steady_clock::now();
  int64_t count_ = -1;  // what the PACS counts of each series; -1: it cannot be asked
  std::vector<SeriesSummary> elsewhere_ = {};  // what it has besides
  int asked_ = 0;
  std::unique_ptr<SeriesIntake> intake_;
};

}  // namespace tissueform::testing
