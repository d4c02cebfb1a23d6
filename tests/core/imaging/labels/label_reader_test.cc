// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <Eigen/LU>
#include <sys/wait.h>

#include "core/imaging/labels/label_map.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

// Files that pydicom, DCMTK, nibabel, VTK and Teem's unu have written, in the helper program.
namespace tissueform::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

constexpr auto kInvalid = absl::StatusCode::kInvalidArgument;

// The phantom of write_labels.py.
constexpr std::array<int, 3> kSize = {20, 24, 16};
const Eigen::Vector3d kSpacing(1.5, 1, 2);
const Eigen::Vector3d kOrigin(-12, 30, 900);

using Box = std::array<std::array<int, 2>, 3>;
constexpr Box kSkullBox = {{{3, 16}, {4, 21}, {8, 15}}};
constexpr Box kMandibleBox = {{{3, 10}, {4, 13}, {2, 7}}};
constexpr Box kCanalBox = {{{5, 8}, {6, 10}, {3, 6}}};

bool Holds(const Box& box, const Eigen::Vector3i& voxel) {
  for (size_t axis = 0; axis < 3; ++axis) {
    const int index = voxel[static_cast<Eigen::Index>(axis)];
    if (index < box[axis][0] || index >= box[axis][1]) return false;
  }
  return true;
}

// In files of numbers the canal hides the mandible.
StructureSet Expected(const Eigen::Vector3i& voxel, bool overlapping) {
  StructureSet set = Holds(kSkullBox, voxel) ? SetOf(Structure::kSkull) : 0;
  const bool canal = Holds(kCanalBox, voxel);
  if (canal) set |= SetOf(Structure::kCanal);
  if (Holds(kMandibleBox, voxel) && (overlapping || !canal)) set |= SetOf(Structure::kLowerJaw);
  return set;
}

// Columns: the directions of a head that is turned by 10 degrees, or not.
Eigen::Matrix3d Directions(bool turned) {
  const double angle = turned ? M_PI / 18 : 0;
  Eigen::Matrix3d directions = Eigen::Matrix3d::Identity();
  directions.topLeftCorner<2, 2>() << std::cos(angle), -std::sin(angle), std::sin(angle),
      std::cos(angle);
  return directions;
}

StructureSet SetAt(const LabelMap& map, const Eigen::Vector3d& place_mm) {
  const Eigen::Vector3d index = map.steps_mm.inverse() * (place_mm - map.origin_mm);
  const Eigen::Vector3i voxel = index.array().round().cast<int>();
  EXPECT_LT((index - voxel.cast<double>()).norm(), 1e-3);
  for (int axis = 0; axis < 3; ++axis) {
    if (voxel[axis] < 0 || voxel[axis] >= map.size[static_cast<size_t>(axis)]) return 0;
  }
  return map.structures[static_cast<size_t>(
      voxel.x() + int64_t{map.size[0]} * (voxel.y() + int64_t{map.size[1]} * voxel.z()))];
}

// Every voxel of the phantom in its place. A SEG holds only the slices that it needs.
void ExpectPhantom(const LabelMap& map, bool overlapping, bool turned) {
  const Eigen::Matrix3d steps = Directions(turned) * kSpacing.asDiagonal();
  int64_t wrong = 0;
  for (int k = 0; k < kSize[2]; ++k) {
    for (int j = 0; j < kSize[1]; ++j) {
      for (int i = 0; i < kSize[0]; ++i) {
        const Eigen::Vector3d place = kOrigin + steps * Eigen::Vector3d(i, j, k);
        wrong += SetAt(map, place) == Expected({i, j, k}, overlapping) ? 0 : 1;
      }
    }
  }
  EXPECT_EQ(wrong, 0);
  EXPECT_EQ(map.sha256.size(), 64U);
}

class LabelReaderTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder = fs::path(::testing::TempDir()) / "foreign_labels";
    fs::create_directories(folder);
    const std::string command =
        absl::StrCat("/usr/bin/python3 ", SourcePath("tests/core/imaging/labels/write_labels.py"),
                     " ", folder.string(), " 2> ", (folder / "errors.txt").string());
    const int status = std::system(command.c_str());
    outcome = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  static void TearDownTestSuite() { fs::remove_all(folder); }

  void SetUp() override {
    ASSERT_EQ(outcome, 0) << "write_labels.py failed; its modules are in deploy/packages.txt";
  }

  static absl::StatusOr<LabelMap> Read(const std::string& name,
                                       const LabelReadOptions& options = {}) {
    return ReadLabelMap((folder / name).string(), options);
  }
  static LabelReadOptions WithAxes(const std::string& axes) {
    LabelReadOptions options;
    options.axes = axes;
    return options;
  }

  static fs::path folder;
  static int outcome;
};

fs::path LabelReaderTest::folder;
int LabelReaderTest::outcome = -1;

TEST_F(LabelReaderTest, ReadsNiftiOfNumbersByTheOnlyConventionThatFits) {
  for (const char* const name : {"numbers.nii.gz", "float.nii"}) {
    SCOPED_TRACE(name);
    ASSERT_OK_AND_ASSIGN(const LabelMap map, Read(name));
    EXPECT_EQ(map.format, "NIfTI");
    EXPECT_THAT(map.notes, ElementsAre(HasSubstr("DentalSegmentator")));
    ExpectPhantom(map, false, true);
  }
}

TEST_F(LabelReaderTest, ReadsNamesThatTotalSegmentatorPutsIntoNifti) {
  ASSERT_OK_AND_ASSIGN(const LabelMap map, Read("named.nii.gz"));
  EXPECT_THAT(map.notes, IsEmpty());
  ExpectPhantom(map, false, true);
  ASSERT_EQ(map.segments.size(), 3U);
  EXPECT_EQ(map.segments[0].value, 9);
  EXPECT_EQ(map.segments[0].side, Side::kLeft);
  EXPECT_EQ(map.segments[2].name, "skull");
}

// VTK's MetaImage does not state how it lies in the patient.
TEST_F(LabelReaderTest, ReadsMetaImageOfVtkWithAxes) {
  ASSERT_OK_AND_ASSIGN(const LabelMap map, Read("vtk.mha", WithAxes("LPS")));
  EXPECT_EQ(map.format, "MetaImage");
  ExpectPhantom(map, false, false);
  EXPECT_THAT(Read("vtk.mha"), StatusIs(kInvalid, HasSubstr("\"axes\"")));
}

TEST_F(LabelReaderTest, AxesAreOnlyForFilesThatDoNotStateTheirs) {
  ASSERT_OK_AND_ASSIGN(const LabelMap map, Read("numbers.nii.gz", WithAxes("RPI")));
  ExpectPhantom(map, false, true);
}

TEST_F(LabelReaderTest, ReadsSegNrrdWithLayersByNamesAndCodes) {
  ASSERT_OK_AND_ASSIGN(const LabelMap map, Read("layers.seg.nrrd"));
  EXPECT_EQ(map.format, "NRRD");
  EXPECT_THAT(map.notes, IsEmpty());
  ExpectPhantom(map, true, true);
}

TEST_F(LabelReaderTest, ReadsSegNrrdWithOneLayer) {
  ASSERT_OK_AND_ASSIGN(const LabelMap map, Read("one_layer.seg.nrrd"));
  ExpectPhantom(map, false, true);
}

TEST_F(LabelReaderTest, ReadsDicomSegOfEachKind) {
  for (const std::string name : {"binary.dcm", "binary_deflated.dcm", "binary_dcmtk.dcm",
                                 "fractional.dcm", "fractional_deflated.dcm", "fractional_rle.dcm",
                                 "labelmap.dcm", "labelmap_deflated.dcm", "labelmap_rle.dcm"}) {
    SCOPED_TRACE(name);
    ASSERT_OK_AND_ASSIGN(const LabelMap map, Read(name));
    EXPECT_EQ(map.format, "DICOM SEG");
    EXPECT_EQ(map.frame_uid, "1.2.826.0.1.3680043.8.498.1");
    ExpectPhantom(map, !absl::StartsWith(name, "labelmap"), true);
  }
}

// A few bytes that unpack to more than is read, and a packed part that ends early.
TEST_F(LabelReaderTest, RefusesDeflatedSegThatIsTooLargeOrCutOff) {
  LabelReadOptions options;
  options.limits.max_file_bytes = 2000;  // the file has 1 KB
  EXPECT_THAT(Read("labelmap_deflated.dcm", options),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("more than 2000 bytes")));
  for (const int share : {9, 5, 2}) {
    fs::copy_file(folder / "binary_deflated.dcm", folder / "cut.dcm",
                  fs::copy_options::overwrite_existing);
    fs::resize_file(folder / "cut.dcm", fs::file_size(folder / "cut.dcm") * share / 10);
    EXPECT_THAT(Read("cut.dcm"), StatusIs(kInvalid, ContainsRegex("cut off|truncated"))) << share;
  }
}

TEST_F(LabelReaderTest, ReadsAFolderOfMasksThatOverlap) {
  ASSERT_OK_AND_ASSIGN(const LabelMap map, Read("masks"));
  EXPECT_EQ(map.format, "NIfTI, a file a structure");
  ExpectPhantom(map, true, true);
  ASSERT_EQ(map.segments.size(), 3U);
  EXPECT_EQ(map.segments[0].name, "inferior_alveolar_canal");
  EXPECT_EQ(map.segments[0].structure, Structure::kCanal);
  EXPECT_EQ(map.segments[0].voxels, 3 * 4 * 3);
  EXPECT_THAT(map.notes,
              ElementsAre(HasSubstr("not known and not read: 1 (aorta), 6 (vertebrae_T1)."),
                          HasSubstr("without a voxel: 4 (sinus_frontal).")));
  ASSERT_OK_AND_ASSIGN(const LabelMap other, Read("masks_255"));
  ExpectPhantom(other, true, true);
  EXPECT_NE(map.sha256, other.sha256);
}

TEST_F(LabelReaderTest, NamesOfTheRecipeAreThoseOfMasks) {
  LabelReadOptions options;
  options.names = {{Structure::kSkull, "smith_1", {}}};
  ASSERT_OK_AND_ASSIGN(const LabelMap map, Read("renamed", options));
  ExpectPhantom(map, true, true);
  options.names = {{Structure::kSinus, "sinus_frontal", {}}};  // an empty mask is no slip
  EXPECT_THAT(Read("masks", options).status(), IsOk());
  options.names = {{Structure::kSinus, "sinus", {}}};
  EXPECT_THAT(Read("masks", options), StatusIs(kInvalid, HasSubstr("has no such segment")));
  options.names = {{Structure::kSkull, "", 3}};
  EXPECT_THAT(Read("masks", options), StatusIs(kInvalid, HasSubstr("has numbers at \"names\"")));
  options.names = {};
  options.convention = "totalsegmentator";
  EXPECT_THAT(Read("masks", options), StatusIs(kInvalid, HasSubstr("has a \"convention\"")));
}

TEST_F(LabelReaderTest, SaysWhatIsWrongWithAFolderOfMasks) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"all_unknown", "none of its 9 files has the name of a known structure: 1 (organ_0), "},
      {"all_empty", "no voxel of it is labelled"},
      {"several_labels", "mask \"skull\": it has more than one value besides 0"},
      {"fractions", "mask \"skull\": it has more than one value besides 0, or fractions"},
      {"other_grid", "mask \"skull\": its grid is not that of the masks before it"},
      {"other_size", "mask \"skull\": its grid is not that of the masks before it"},
      {"swapped_masks", "left and right are swapped"},
      {"twice", "two files for \"skull\"; keep one"},
      {"no_masks", "the folder has no .nii, .nii.gz"}};
  for (const auto& [name, message] : cases) {
    SCOPED_TRACE(name);
    const absl::Status status = Read(name).status();
    EXPECT_EQ(status.code(), kInvalid);
    EXPECT_THAT(status.message(), AllOf(HasSubstr("cannot use the label map: "), HasSubstr(message),
                                        Not(HasSubstr("\n")), Not(HasSubstr(folder.string()))));
  }
  LabelReadOptions options;
  options.limits.max_file_bytes = 400;  // of all masks together
  EXPECT_THAT(Read("masks", options),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("mask")));
}

TEST_F(LabelReaderTest, OneLineForTwoHundredSegments) {
  ASSERT_OK_AND_ASSIGN(const LabelMap map, Read("many.dcm"));
  EXPECT_EQ(map.segments.size(), 200U);
  ExpectPhantom(map, true, true);
  EXPECT_THAT(map.notes, ElementsAre(AllOf(HasSubstr("not known and not used: 4 (part 0), "),
                                           HasSubstr(" and 191 more"))));
}

TEST_F(LabelReaderTest, NamesOfTheRecipeGoFirst) {
  LabelReadOptions options;
  options.names = {{Structure::kSkull, "smith TUMOR", {}}, {Structure::kLowerJaw, "", 40}};
  ASSERT_OK_AND_ASSIGN(const LabelMap map, Read("unknown.nii", options));
  EXPECT_EQ(map.segments.size(), 3U);
}

TEST_F(LabelReaderTest, SaysWhatIsWrongInOneLine) {
  const auto message = [](const std::string& name) {
    const absl::StatusOr<LabelMap> map = Read(name);
    EXPECT_EQ(map.status().code(), kInvalid) << name;
    EXPECT_THAT(map.status().message(), AllOf(HasSubstr("cannot use the label map: "),
                                              Not(HasSubstr("\n")), Not(HasSubstr("secret"))));
    return std::string(map.status().message());
  };
  EXPECT_THAT(message("probability.nii"), HasSubstr("labels are whole numbers"));
  EXPECT_THAT(message("negative.nii"), HasSubstr("it has the value -1024"));
  EXPECT_THAT(message("empty.nii"), HasSubstr("no voxel of it is labelled"));
  EXPECT_THAT(message("unknown.nii"),
              HasSubstr("none of its 3 segments is known: 9 (c), 40 (b), 71 "));
  EXPECT_THAT(message("swapped.seg.nrrd"), HasSubstr("left and right are swapped"));
  EXPECT_THAT(message("ct.dcm"), HasSubstr("of modality CT, not a segmentation"));
}

TEST_F(LabelReaderTest, KeepsToItsLimits) {
  LabelReadOptions options;
  options.limits.max_file_bytes = 1000;
  EXPECT_THAT(Read("binary.dcm", options),
              StatusIs(absl::StatusCode::kResourceExhausted,
                       HasSubstr("max_file_bytes of label maps (1000)")));
  options = {};
  options.limits.max_voxels = 10000;
  EXPECT_THAT(Read("layers.seg.nrrd", options),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("at most 10000")));
  EXPECT_THAT(Read("missing.nii"), StatusIs(absl::StatusCode::kNotFound, HasSubstr("no such")));
}

// What is cut off must not crash the caller, nor be read.
TEST_F(LabelReaderTest, RefusesTruncatedFiles) {
  for (const char* const name : {"layers.seg.nrrd", "binary.dcm", "numbers.nii.gz"}) {
    const std::string cut = absl::StrCat("cut_", name);
    fs::copy_file(folder / name, folder / cut, fs::copy_options::overwrite_existing);
    fs::resize_file(folder / cut, fs::file_size(folder / cut) * 9 / 10);
    EXPECT_THAT(Read(cut), StatusIs(kInvalid, ContainsRegex("cut off|truncated"))) << name;
  }
}

}  // namespace
}  // namespace tissueform::testing
