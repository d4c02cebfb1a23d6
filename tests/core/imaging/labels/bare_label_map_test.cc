// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/labels/bare_label_map.h"

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/imaging/labels/label_map.h"
#include "tests/testing/file_bytes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::StatusIs;

constexpr auto kInvalid = absl::StatusCode::kInvalidArgument;

// A mandible of one voxel among eight. "Planted" stands wherever a program may write a name.
constexpr char kNrrd[] =
    "NRRD0005\n# Planted\ncontent: Planted\ntype: uchar\ndimension: 3\n"
    "space: left-posterior-superior\nsizes: 2 2 2\nspace directions: (1,0,0) (0,1,0) (0,0,1)\n"
    "space origin: (1,2,3)\nencoding: raw\nDICOM_patientID:=Planted\n"
    "Segmentation_SourceRepresentation:=Planted\nSegment0_Name:=mandible\n"
    "Segment0_LabelValue:=1\nSegment0_Layer:=0\nSegment0_Comment:=Planted\n\n";
constexpr char kMetaImage[] =
    "ObjectType = Image\nNDims = 3\nComment = Planted\nBinaryData = True\n"
    "TransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = 1 2 3\nAnatomicalOrientation = RAI\n"
    "ElementSpacing = 1 1 1\nDimSize = 2 2 2\nPatient = Planted\nElementType = MET_UCHAR\n"
    "ElementDataFile = LOCAL\n";

std::string Voxels() { return std::string("\0\1\0\0\0\0\0\0", 8); }

template <typename T>
void Put(size_t at, T value, std::string* bytes) {
  std::memcpy(bytes->data() + at, &value, sizeof(value));
}

std::string Nifti() {
  std::string file(512, '\0');
  Put<int32_t>(0, 348, &file);
  file.replace(148, 7, "Planted");
  file.replace(228, 7, "Planted");
  const int16_t sizes[] = {3, 2, 2, 2, 1, 1, 1, 1};
  std::memcpy(file.data() + 40, sizes, sizeof(sizes));
  Put<int16_t>(70, 2, &file);  // unsigned bytes
  Put<int16_t>(72, 8, &file);
  for (size_t i = 0; i < 4; ++i) Put<float>(76 + 4 * i, 1, &file);
  Put<float>(108, 512, &file);
  Put<int16_t>(254, 1, &file);  // sform
  for (size_t i = 0; i < 3; ++i) Put<float>(280 + 20 * i, 1, &file);
  file.replace(344, 4, std::string("n+1\0", 4));
  file.replace(348, 4, std::string("\1\0\0\0", 4));  // an extension of 160 bytes
  Put<int32_t>(352, 160, &file);
  Put<int32_t>(356, 6, &file);
  const std::string table =
      "Planted<Label Key=\"3\">Planted<Label Key=\"1\" "
      "Red=\"0\"><![CDATA[mandible]]></Label>Planted<Label Key=\"2\">Planted";
  file.replace(360, table.size(), table);
  return file + Voxels();
}

absl::StatusOr<LabelMap> Read(const std::string& ending, const std::string& bytes) {
  const fs::path path = fs::path(::testing::TempDir()) / absl::StrCat("bare_label_map", ending);
  std::ofstream(path, std::ios::binary) << bytes;
  LabelReadOptions options;
  options.names = {{.structure = Structure::kLowerJaw, .name = {}, .value = 1}};
  absl::StatusOr<LabelMap> map = ReadLabelMap(path.string(), options);
  fs::remove(path);
  return map;
}

// Gzip unpacked by another program; other bytes as they are.
std::string Unpacked(const std::string& bytes) {
  if (!bytes.starts_with("\x1f\x8b")) return bytes;
  const fs::path packed = fs::path(::testing::TempDir()) / "bare_label_map_packed.gz";
  std::ofstream(packed, std::ios::binary) << bytes;
  EXPECT_EQ(std::system(absl::StrCat("gzip -d -f '", packed.string(), "'").c_str()), 0);
  const fs::path unpacked = fs::path(packed).replace_extension();
  std::string contents = testing::BytesOfFile(unpacked);
  fs::remove(unpacked);
  return contents;
}

TEST(BareLabelMapTest, TextGoesAndTheMapStays) {
  const std::pair<std::string, std::string> files[] = {
      {".seg.nrrd", kNrrd + Voxels()}, {".mha", kMetaImage + Voxels()}, {".nii", Nifti()}};
  for (const auto& [ending, bytes] : files) {
    SCOPED_TRACE(ending);
    ASSERT_OK_AND_ASSIGN(const LabelMap whole, Read(ending, bytes));
    ASSERT_OK_AND_ASSIGN(const BareLabelMap bare, WithoutText("in" + ending, bytes));
    EXPECT_THAT(Unpacked(bare.bytes), Not(HasSubstr("Planted")));
    ASSERT_OK_AND_ASSIGN(const LabelMap read, Read(bare.ending, bare.bytes));
    EXPECT_EQ(read.structures, whole.structures);
    EXPECT_EQ(read.origin_mm, whole.origin_mm);
    EXPECT_EQ(read.segments.front().name, whole.segments.front().name);
  }
}

TEST(BareLabelMapTest, RefusesFilesThatCannotBeCleaned) {
  EXPECT_THAT(WithoutText("a.dcm", "x").status(), StatusIs(kInvalid, HasSubstr("DICOM SEG")));
  EXPECT_THAT(WithoutText("a.nhdr", "x").status(),
              StatusIs(kInvalid, HasSubstr("a file of their own")));
  EXPECT_THAT(WithoutText("a.nrrd", "NRRD0005\ndata file: b.raw\n\n").status(),
              StatusIs(kInvalid, HasSubstr("a file of their own")));
  for (const char* name : {"a.nrrd", "a.mha", "a.nii", "a.nii.gz"}) {
    for (const std::string& bytes :
         {std::string(), std::string(400, 'x'), std::string("\x1f\x8b")}) {
      EXPECT_THAT(WithoutText(name, bytes).status(), StatusIs(kInvalid, HasSubstr("damaged")));
    }
  }
}

}  // namespace
}  // namespace tissueform
