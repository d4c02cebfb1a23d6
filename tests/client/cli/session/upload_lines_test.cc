// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/session/upload_lines.h"

#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace tissueform {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class UploadLinesTest : public ::testing::Test {
 protected:
  double now_s_ = 0;
  std::vector<std::string> lines_;
  UploadLines upload_{[this](const std::string& line) { lines_.push_back(line); },
                      [this] { return now_s_; }};
  const UploadOptions options_ = upload_.Options();
};

TEST_F(UploadLinesTest, ShortUploadPrintsNothing) {
  for (now_s_ = 0; now_s_ < 1; now_s_ += 0.1) options_.on_progress(100, 1000);
  EXPECT_THAT(lines_, IsEmpty());
}

TEST_F(UploadLinesTest, LongUploadPrintsALineASecond) {
  for (int step = 1; step <= 30; ++step) {
    now_s_ = step / 8.0;
    options_.on_progress(step * 100'000, 3'000'000);
  }
  EXPECT_THAT(lines_, ElementsAre("uploading: 0.8 of 3.0 MB", "uploading: 1.6 of 3.0 MB",
                                  "uploading: 2.4 of 3.0 MB", "uploading: 3.0 of 3.0 MB"));
}

TEST_F(UploadLinesTest, EventsAreReportedAtOnce) {
  options_.on_resumed(1'500'000, 3'000'000);
  options_.on_interrupted(absl::UnavailableError("nobody is there"));
  options_.on_resumed(0, 3'000'000);
  EXPECT_THAT(lines_, ElementsAre("the upload continues: the server has 1.5 of 3.0 MB already",
                                  "upload interrupted (nobody is there); trying again",
                                  "the upload restarts"));
}

TEST_F(UploadLinesTest, RepeatedFailuresAreNotAllReported) {
  for (now_s_ = 0; now_s_ < 19; now_s_ += 2) {
    options_.on_interrupted(absl::AbortedError("another client sends"));
    options_.on_resumed(1'500'000, 3'000'000);
  }
  options_.on_interrupted(absl::UnavailableError("nobody is there"));
  const std::string waits = "upload interrupted (another client sends); trying again";
  const std::string goes_on = "the upload continues: the server has 1.5 of 3.0 MB already";
  EXPECT_THAT(lines_, ElementsAre(waits, goes_on, waits, goes_on,
                                  "upload interrupted (nobody is there); trying again"));
}

}  // namespace
}  // namespace tissueform
