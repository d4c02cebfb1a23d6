// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// The bundled head, from its plan to the objects that go back.

#include <fstream>

#include "absl/strings/str_format.h"
#include "gmock/gmock.h"

#include "core/base/stopwatch.h"
#include "core/imaging/series/image_header.h"
#include "core/planning/case_file/case_reader.h"
#include "core/planning/rendering/virtual_display.h"
#include "tests/client/pacs_bridge/objects/objects_fixture.h"
#include "tests/testing/meshes.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/scoped_environment.h"

namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class HeadObjectsTest : public ObjectsFixture {
 protected:
  // In place of the sample: the head, all of which goes as the sample does.
  PredictionObjectsInput MakeHeadInput() {
    PredictionObjectsInput input = MakeInput();
    EXPECT_EQ(RunCommandLine({"case", "pack", TestDataPath("plans/three_segments/plan.json"),
                              "--out", "head.tfcase"},
                             folder_)
                  .exit_code,
              0);
    const auto contents = ReadCase(folder_ / "head.tfcase");
    EXPECT_THAT(contents.status(), IsOk());
    if (!contents.ok()) return input;
    input.contents = *contents;
    input.prediction.clear_poses();
    FillPrediction(&input);
    input.band_mm.assign(static_cast<size_t>(input.deformed.rows()), 0.25);
    for (const std::string& key : PredictionUidKeys(input.contents)) {
      input.uids[key] = NewDicomUid();
    }
    // As many as a head has.
    while (input.source_images.size() < 400) {
      input.source_images.push_back({std::string(kCtImageClass), NewDicomUid()});
    }
    return input;
  }

  // By the command that the bridge starts.
  std::vector<std::string> Render(const PredictionObjectsInput& input) const {
    const FloatPositions positions = input.deformed.cast<float>();
    std::ofstream(folder_ / "after.f32", std::ios::binary)
        .write(reinterpret_cast<const char*>(positions.data()),
               static_cast<std::streamsize>(static_cast<size_t>(positions.size()) * sizeof(float)));
    // Under AddressSanitizer: Mesa's leaks, see tests/core/planning/rendering/figure_test.cc.
    const ScopedEnvironment no_leak_check("LSAN_OPTIONS", "detect_leaks=0");
    const ProcessResult rendered = RunCommandLine(
        {"case", "render", "head.tfcase", "--positions", "after.f32", "--out", "pictures"},
        folder_);
    EXPECT_EQ(rendered.exit_code, 0) << rendered.err;
    std::vector<std::string> pictures;
    for (const char* name : {"front.png", "left.png", "three_quarter.png"}) {
      pictures.push_back(folder_ / "pictures" / name);
    }
    return pictures;
  }
};

TEST_F(HeadObjectsTest, IsWrittenWithoutAnError) {
  PredictionObjectsInput input = MakeHeadInput();
  if (!absl::IsNotFound(VirtualDisplay::Open().status())) input.pictures = Render(input);
  const Stopwatch stopwatch;
  const auto objects = Write(input);
  RecordProperty("milliseconds", absl::StrFormat("%.0f", 1e3 * stopwatch.Seconds()));
  EXPECT_EQ(objects.size(), 8U);
  for (const char* key :
       {"stl:segment:maxilla", "stl:segment:mandible", "stl:segment:chin", "stl:bone"}) {
    EXPECT_EQ(objects.count(key), 1U) << key;
  }
  ASSERT_TRUE(Has("dciodvfy")) << "dicom3tools is not installed";
  for (const auto& [key, object] : objects) {
    Run("dciodvfy " + object.path);
    EXPECT_THAT(Said(), Not(HasSubstr("Error"))) << key;
  }
}

}  // namespace
}  // namespace tissueform::testing
