// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdlib>
#include <filesystem>
#include <map>
#include <memory>
#include <png.h>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include "client/pacs_bridge/dicom/dicom_uid.h"
#include "client/pacs_bridge/objects/prediction_objects.h"
#include "core/imaging/series/image_header.h"
#include "core/planning/case_file/predicted_case.h"
#include "proto/conversion/geometry_conversion.h"
#include "tests/core/planning/case_file/sample_case.h"
#include "tests/testing/ct_series.h"
#include "tests/testing/file_bytes.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_authority.h"

namespace tissueform::testing {

// The sample case turned and moved as a whole, in the study of a small CT series.
class ObjectsFixture : public ::testing::Test {
 protected:
  ObjectsFixture()
      : folder_(EmptyTestFolder(absl::StrCat(
            "objects_", ::testing::UnitTest::GetInstance()->current_test_info()->name()))) {
    std::filesystem::create_directory(folder_ / "ct");
    std::filesystem::create_directory(folder_ / "out");
  }

  static HandlePose Pose() {
    return {.rotation_vector = {0, 0, 0.1}, .pivot_mm = {1, 2, 3}, .translation_mm = {0, -6, 2}};
  }

  // A picture of its own colours for every frame.
  std::string MakePicture(int frame, uint32_t width = 64, uint32_t height = 48) const {
    std::vector<uint8_t> rgb;
    for (uint32_t i = 0; i < width * height; ++i) {
      rgb.push_back(static_cast<uint8_t>(i % 251));
      rgb.push_back(static_cast<uint8_t>(i / width));
      rgb.push_back(static_cast<uint8_t>(80 * frame));
    }
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    image.width = width;
    image.height = height;
    image.format = PNG_FORMAT_RGB;
    std::string path = folder_ / absl::StrCat("picture", frame, ".png");
    EXPECT_NE(png_image_write_to_file(&image, path.c_str(), 0, rgb.data(), 0, nullptr), 0);
    return path;
  }

  PredictionObjectsInput MakeInput(const CtSeriesOptions& options = {}) {
    series_ = WriteCtSeries(folder_ / "ct", options);
    PredictionObjectsInput input;
    input.source_header = series_.files.front();
    input.source_series_uid = series_.series_uid;
    for (const std::string& uid : series_.instance_uids) {
      input.source_images.push_back({std::string(kCtImageClass), uid});
    }
    input.contents = SampleCase();
    FillPrediction(&input);
    input.band_mm.assign(static_cast<size_t>(input.deformed.rows()), 0.25);
    v1::Measure measure;
    measure.set_name("e_line_upper_lip");
    measure.set_title("Oberlippe zur E-Linie");
    measure.set_unit("mm");
    measure.set_before(-3.5);
    measure.set_after(-1.25);
    measure.set_lowest_after(-1.5);
    measure.set_highest_after(-1);
    input.measures = {measure};
    for (const int frame : {1, 2, 3}) input.pictures.push_back(MakePicture(frame));
    for (const std::string& key : PredictionUidKeys(input.contents)) {
      input.uids[key] = NewDicomUid();
    }
    input.made = absl::FromUnixSeconds(1'790'000'000);
    input.device_serial = "bridge-1";
    return input;
  }

  static void FillPrediction(PredictionObjectsInput* input) {
    input->deformed = RestPositions(input->contents.mesh);
    for (auto row : input->deformed.rowwise()) {
      row = ApplyPose(Pose(), row.transpose()).transpose();
    }
    v1::Prediction& prediction = input->prediction;
    prediction.set_name("predictions/0123456789abcdef");
    prediction.set_mesh(input->contents.mesh.name);
    prediction.set_case_("cases/" + std::string(64, 'c'));
    prediction.set_model(v1::DEFORMATION_MODEL_NEO_HOOKEAN);
    prediction.set_software_version("0.1.0");
    prediction.set_software_commit("0123abc");
    prediction.set_recipe_sha256(std::string(64, 'd'));
    for (const CaseHandle& handle : input->contents.handles) {
      *prediction.add_poses() = ToProto(NamedPose{handle.name, Pose()});
    }
  }

  // By their keys; none when they cannot be written.
  std::map<std::string, WrittenObject> Write(const PredictionObjectsInput& input) const {
    std::map<std::string, WrittenObject> objects;
    const auto written = WritePredictionObjects(input, (folder_ / "out").string());
    EXPECT_THAT(written.status(), IsOk());
    for (const WrittenObject& object : written.value_or(std::vector<WrittenObject>{})) {
      objects[object.key] = object;
    }
    return objects;
  }

  static std::unique_ptr<DcmFileFormat> Load(const std::string& path) {
    auto file = std::make_unique<DcmFileFormat>();
    EXPECT_TRUE(file->loadFile(path.c_str()).good());
    return file;
  }

  static std::string Value(DcmItem* item, const DcmTagKey& tag) {
    OFString value;
    if (item->findAndGetOFStringArray(tag, value).bad()) return "";
    return value.c_str();
  }

  // Another's program, whose words go to said.txt.
  int Run(const std::string& command) const {
    const int status =
        std::system(absl::StrCat(command, " > ", (folder_ / "said.txt").string(), " 2>&1").c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  std::string Said() const { return BytesOfFile(folder_ / "said.txt"); }
  bool Has(const std::string& program) const {
    return Run(absl::StrCat("command -v ", program)) == 0;
  }

  const std::filesystem::path folder_;
  CtSeries series_;
};

}  // namespace tissueform::testing
