// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/zip_inputs.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::IsOk;

class ZipInputsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(::testing::TempDir()) / "zip_inputs";
    fs::remove_all(folder_);
    fs::create_directories(folder_ / "work");
  }
  void TearDown() override { fs::remove_all(folder_); }

  // Packs files of these names; one that begins with "dicom" is a DICOM file.
  std::string Zip(const std::vector<std::string>& names) const {
    std::string command =
        absl::StrCat("cd '", folder_.string(), "' && rm -f in.zip && python3 -m zipfile -c in.zip");
    for (const std::string& name : names) {
      const std::string start = name.starts_with("dicom") ? std::string(128, '\0') + "DICM" : "";
      std::ofstream(folder_ / name, std::ios::binary) << start << "x";
      absl::StrAppend(&command, " ", name);
    }
    EXPECT_EQ(std::system(command.c_str()), 0);
    return (folder_ / "in.zip").string();
  }
  // The path in the unpacked folder; empty for the folder itself.
  std::string Resolved(const std::vector<std::string>& names, ZipContent content) const {
    ZipInputs zips((folder_ / "work").string());
    const absl::StatusOr<std::string> path = zips.Resolve(Zip(names), content);
    EXPECT_THAT(path.status(), IsOk());
    if (!path.ok()) return "";
    EXPECT_TRUE(fs::exists(*path));
    return fs::is_directory(*path) ? "" : fs::path(*path).filename().string();
  }
  std::string Refusal(const std::vector<std::string>& names, ZipContent content) const {
    ZipInputs zips((folder_ / "work").string());
    const std::string message(zips.Resolve(Zip(names), content).status().message());
    EXPECT_THAT(message, HasSubstr("cannot use the zip: "));
    return message;
  }

  fs::path folder_;
};

TEST_F(ZipInputsTest, OneInputIsFound) {
  EXPECT_EQ(Resolved({"dicom1", "dicom2", "readme.txt"}, ZipContent::kCt), "");
  EXPECT_EQ(Resolved({"head.NII.gz", "readme.txt"}, ZipContent::kCt), "head.NII.gz");
  EXPECT_EQ(Resolved({"head.nhdr", "head.raw.gz"}, ZipContent::kCt), "head.nhdr");
  EXPECT_EQ(Resolved({"bones.seg.nrrd", "notes.txt"}, ZipContent::kLabels), "bones.seg.nrrd");
  EXPECT_EQ(Resolved({"dicom_seg"}, ZipContent::kLabels), "dicom_seg");
  EXPECT_EQ(Resolved({"skull.nii.gz", "aorta.nii.gz", "statistics.json"}, ZipContent::kLabels), "");
  EXPECT_EQ(Resolved({"s.json", "skin.stl", "points.mrk.json"}, ZipContent::kSurfaces), "s.json");
  EXPECT_TRUE(fs::is_empty(folder_ / "work"));
}

TEST_F(ZipInputsTest, SeveralAreListedWithoutTheirNames) {
  const std::string two = Refusal({"Doe.nrrd", "Roe.mha", "a.txt"}, ZipContent::kCt);
  EXPECT_THAT(two, HasSubstr("2 volumes: file 1 (.nrrd, 0.0 MB), file 2 (.mha, 0.0 MB)"));
  EXPECT_EQ(two.find("Doe"), two.npos);
  EXPECT_THAT(Refusal({"dicom1", "head.nrrd"}, ZipContent::kCt),
              HasSubstr("1 volume and DICOM files"));
  EXPECT_THAT(Refusal({"a.nrrd", "b.nrrd"}, ZipContent::kLabels), HasSubstr("2 files"));
  EXPECT_THAT(Refusal({"a.json", "b.json"}, ZipContent::kSurfaces), HasSubstr("2 .json files"));
  EXPECT_THAT(Refusal({"skin.stl"}, ZipContent::kSurfaces), HasSubstr("0 .json files"));
}

TEST_F(ZipInputsTest, OtherPathsStayAsTheyAre) {
  ZipInputs zips((folder_ / "work").string());
  EXPECT_EQ(*zips.Resolve("none", ZipContent::kCt), "none");
  EXPECT_EQ(*zips.Resolve(folder_.string(), ZipContent::kCt), folder_.string());
}

}  // namespace
}  // namespace tissueform
