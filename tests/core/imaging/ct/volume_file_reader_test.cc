// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"

#include "tests/core/imaging/ct/ct_folder.h"
#include "tests/core/imaging/ct/packed.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using tissueform::testing::CtFolder;
using tissueform::testing::Pack;
using tissueform::testing::PhantomHu;
using tissueform::testing::StatusIs;
using tissueform::testing::TestDataPath;
using tissueform::testing::WorstPhantomError;

using ::tissueform::testing::kInvalid;
constexpr int kSizeX = 12;
constexpr int kSizeY = 10;
constexpr int kSizeZ = 9;

// The phantom's values as the bytes of a file whose voxel (i, j, k) lies where `place` says.
template <typename T>
std::string PhantomBytes(const std::function<Eigen::Vector3d(int i, int j, int k)>& place,
                         double add = 0) {
  std::string bytes;
  for (int k = 0; k < kSizeZ; ++k) {
    for (int j = 0; j < kSizeY; ++j) {
      for (int i = 0; i < kSizeX; ++i) {
        const T value = static_cast<T>(PhantomHu(place(i, j, k)) + add);
        char raw[sizeof(T)];
        std::memcpy(raw, &value, sizeof(T));
        bytes.append(raw, sizeof(T));
      }
    }
  }
  return bytes;
}

Eigen::Vector3d UprightPlace(int i, int j, int k) {
  return {-30 + 0.5 * i, 20 + 0.75 * j, 100 + 1.25 * k};
}

class VolumeFileTest : public CtFolder {
 protected:
  absl::StatusOr<CtVolume> ReadContents(const std::string& name, const std::string& contents,
                                        const std::string& axes = "") const {
    Write(name, contents);
    CtReadOptions options;
    options.axes = axes;
    return Read(options, name);
  }
};

std::string NrrdHeader(const std::string& fields, const std::string& type = "int16") {
  return absl::StrCat("NRRD0004\n# a comment\ntype: ", type,
                      "\ndimension: 3\nsizes: 12 10 9\nendian: little\nencoding: raw\n", fields);
}

std::string NrrdLps() {
  return NrrdHeader(
      "space: left-posterior-superior\nspace directions: (0.5,0,0) (0,0.75,0) (0,0,1.25)\n"
      "space origin: (-30,20,100)\n\n");
}

std::string MetaHeader(const std::string& fields, const std::string& type = "MET_SHORT") {
  return absl::StrCat("ObjectType = Image\nNDims = 3\n", fields,
                      "DimSize = 12 10 9\nElementSpacing = 0.5 0.75 1.25\nElementType = ", type,
                      "\n");
}

// The 348 bytes of NIfTI-1 and four of no extensions; RAS.
std::string NiftiHeader(int16_t sform_code, float slope = 1, float intercept = 0,
                        int16_t volumes = 1) {
  std::string header(352, '\0');
  const auto put = [&header](size_t offset, const auto& value) {
    std::memcpy(header.data() + offset, &value, sizeof(value));
  };
  put(0, int32_t{348});
  put(40, std::array<int16_t, 8>{static_cast<int16_t>(volumes > 1 ? 4 : 3), kSizeX, kSizeY, kSizeZ,
                                 volumes, 1, 1, 1});
  put(70, int16_t{4});  // signed short
  put(72, int16_t{16});
  put(76, std::array<float, 4>{1, 0.5F, 0.75F, 1.25F});
  put(108, 352.0F);
  put(112, slope);
  put(116, intercept);
  put(123, char{2});  // mm
  put(254, sform_code);
  put(280, std::array<float, 12>{-0.5F, 0, 0, 30, 0, -0.75F, 0, -20, 0, 0, 1.25F, 100});
  put(344, std::array<char, 4>{'n', '+', '1', '\0'});
  return header;
}

void ExpectUprightPhantom(const absl::StatusOr<CtVolume>& volume, const std::string& format) {
  ASSERT_TRUE(volume.ok()) << volume.status();
  EXPECT_THAT(volume->size, ElementsAre(kSizeX, kSizeY, kSizeZ));
  EXPECT_TRUE(volume->spacing_mm.isApprox(Eigen::Vector3d(0.5, 0.75, 1.25), 1e-6));
  EXPECT_TRUE(volume->origin_mm.isApprox(Eigen::Vector3d(-30, 20, 100), 1e-6));
  EXPECT_EQ(WorstPhantomError(*volume), 0);
  EXPECT_EQ(volume->provenance.format, format);
}

TEST_F(VolumeFileTest, FormatsThatStateLpsAreRead) {
  const std::string voxels = PhantomBytes<int16_t>(UprightPlace);
  ExpectUprightPhantom(ReadContents("v.nrrd", NrrdLps() + voxels), "NRRD");
  ExpectUprightPhantom(
      ReadContents("v.mha", MetaHeader("Offset = -30 20 100\nAnatomicalOrientation = RAI\n") +
                                "ElementDataFile = LOCAL\n" + voxels),
      "MetaImage");
  ExpectUprightPhantom(ReadContents("v.nii", NiftiHeader(1) + voxels), "NIfTI");
}

// The steps of the sform along i, j, k and the place of voxel 0, row by row; qform none.
std::string NiftiWithSform(const std::array<float, 12>& sform, char unit = 2) {
  std::string header = NiftiHeader(1);
  std::memcpy(header.data() + 280, sform.data(), sizeof(sform));
  header[123] = unit;
  return header;
}

TEST_F(VolumeFileTest, NiftiAxesThatAreOffSquareByRoundingAreMadeSquare) {
  const std::string header =
      NiftiWithSform({-0.5F, 0.0004F, 0, 30, 0, -0.75F, 0.0009F, -20, 0.0001F, 0, 1.25F, 100});
  const std::string voxels = PhantomBytes<int16_t>(UprightPlace);
  for (const bool packed : {false, true}) {
    const std::string name = packed ? "v.nii.gz" : "v.nii";
    const std::string bytes = header + voxels;
    ASSERT_OK_AND_ASSIGN(const CtVolume volume,
                         ReadContents(name, packed ? Pack(bytes, true) : bytes));
    EXPECT_TRUE((volume.direction.transpose() * volume.direction).isIdentity(1e-12));
    EXPECT_TRUE(volume.direction.isIdentity(1e-3));
    EXPECT_TRUE(volume.spacing_mm.isApprox(Eigen::Vector3d(0.5, 0.75, 1.25), 1e-6));
    EXPECT_TRUE(volume.origin_mm.isApprox(Eigen::Vector3d(-30, 20, 100), 1e-6));
    EXPECT_EQ(volume.At(7, 3, 2), PhantomHu(UprightPlace(7, 3, 2)));
    EXPECT_EQ(volume.provenance.format, "NIfTI");
    EXPECT_THAT(volume.provenance.notes, ElementsAre(HasSubstr("not exactly square")));
  }
}

TEST_F(VolumeFileTest, NiftiShearedAsByATiltedGantryKeepsItsShear) {
  const double tilt = 8 * M_PI / 180;
  const auto step_y = static_cast<float>(1.25 * std::sin(tilt));
  const auto step_z = static_cast<float>(1.25 * std::cos(tilt));
  const auto place = [&](int i, int j, int k) -> Eigen::Vector3d {
    return {-30 + 0.5 * i, 20 + 0.75 * j + double{step_y} * k, 100 + double{step_z} * k};
  };
  const std::string voxels = PhantomBytes<int16_t>(place);
  ASSERT_OK_AND_ASSIGN(const CtVolume volume,
                       ReadContents("v.nii", NiftiWithSform({-0.5F, 0, 0, 30, 0, -0.75F, -step_y,
                                                             -20, 0, 0, step_z, 100}) +
                                                 voxels));
  EXPECT_LE(WorstPhantomError(volume), 1);  // rounding of places that float32 states
  EXPECT_NEAR(std::abs(volume.provenance.gantry_tilt_deg), 8, 1e-4);
  for (const auto& sform :
       {std::array<float, 12>{-0.5F, 0, 0.3F, 30, 0, -0.75F, 0, -20, 0, 0, 1.25F, 100},
        std::array<float, 12>{-0.5F, 0.2F, 0, 30, 0, -0.75F, 0, -20, 0, 0, 1.25F, 100},
        std::array<float, 12>{-0.5F, 0, 0, 30, 0, -0.75F, 1, -20, 0, 0, 1.25F, 100}}) {
    EXPECT_THAT(ReadContents("v.nii", NiftiWithSform(sform) + voxels),
                StatusIs(kInvalid, HasSubstr("axes are sheared")));
  }
}

TEST_F(VolumeFileTest, NiftiFormsThatMirrorEachOtherAreRefused) {
  const std::string voxels = PhantomBytes<int16_t>(UprightPlace);
  std::string header = NiftiHeader(1);
  const int16_t scanner = 1;
  const std::array<float, 6> half_turn = {0, 0, 1, 30, -20, 100};
  std::memcpy(header.data() + 252, &scanner, sizeof(scanner));
  std::memcpy(header.data() + 256, half_turn.data(), sizeof(half_turn));
  ExpectUprightPhantom(ReadContents("v.nii", header + voxels), "NIfTI");
  for (const size_t step : {size_t{280}, size_t{76}}) {  // -x of the sform, or qfac
    std::string mirrored = header;
    float number = 0;
    std::memcpy(&number, mirrored.data() + step, sizeof(number));
    number = -number;
    std::memcpy(mirrored.data() + step, &number, sizeof(number));
    EXPECT_THAT(ReadContents("v.nii", mirrored + voxels),
                StatusIs(kInvalid, HasSubstr("left and right of the patient are uncertain")));
  }
}

TEST_F(VolumeFileTest, NiftiInMetersOrMicrometersIsConverted) {
  const std::string voxels = PhantomBytes<int16_t>(UprightPlace);
  const std::array<float, 12> mm = {-0.5F, 0, 0, 30, 0, -0.75F, 0, -20, 0, 0, 1.25F, 100};
  for (const auto& [unit, scale] : {std::pair('\1', 0.001F), std::pair('\3', 1000.0F)}) {
    std::array<float, 12> scaled = mm;
    for (float& number : scaled) number *= scale;
    std::string header = NiftiWithSform(scaled, unit);
    const std::array<float, 3> pixdim = {0.5F * scale, 0.75F * scale, 1.25F * scale};
    std::memcpy(header.data() + 80, pixdim.data(), sizeof(pixdim));
    ASSERT_OK_AND_ASSIGN(const CtVolume volume, ReadContents("v.nii", header + voxels));
    EXPECT_TRUE(volume.spacing_mm.isApprox(Eigen::Vector3d(0.5, 0.75, 1.25), 1e-6));
    EXPECT_TRUE(volume.origin_mm.isApprox(Eigen::Vector3d(-30, 20, 100), 1e-6));
    EXPECT_TRUE(volume.direction.isIdentity(1e-6));
    EXPECT_EQ(volume.At(7, 3, 2), PhantomHu(UprightPlace(7, 3, 2)));
    EXPECT_THAT(volume.provenance.notes, ElementsAre(HasSubstr("converted to mm")));
  }
  EXPECT_THAT(ReadContents("v.nii", NiftiWithSform(mm, '\1') + voxels),
              StatusIs(kInvalid, AllOf(HasSubstr("the voxels are 500 mm apart"),
                                       HasSubstr("set xyzt_units to 2"))));
}

TEST_F(VolumeFileTest, NrrdInRasIsTurnedToLps) {
  const std::string header = NrrdHeader(
      "space: RAS\nspace directions: (0.5,0,0) (0,0.75,0) (0,0,1.25)\nspace origin: (24,-27,100)\n"
      "\n");
  const auto place = [](int i, int j, int k) -> Eigen::Vector3d {
    return {-24 - 0.5 * i, 27 - 0.75 * j, 100 + 1.25 * k};
  };
  ASSERT_OK_AND_ASSIGN(const CtVolume volume,
                       ReadContents("v.nrrd", header + PhantomBytes<int16_t>(place)));
  EXPECT_EQ(WorstPhantomError(volume), 0);
  EXPECT_EQ(volume.direction(0, 0), -1);
}

TEST_F(VolumeFileTest, DetachedDataIsReadAndBothFilesCount) {
  const std::string voxels = PhantomBytes<int16_t>(UprightPlace);
  Write("v.raw", voxels);
  ASSERT_OK_AND_ASSIGN(const CtVolume meta,
                       ReadContents("v.mhd", MetaHeader("AnatomicalOrientation = RAI\n") +
                                                 "ElementDataFile = v.raw\n"));
  EXPECT_EQ(meta.provenance.num_files, 2);
  std::string header = NrrdLps();
  header.insert(header.size() - 1, "data file: v.raw\n");
  const absl::StatusOr<CtVolume> nrrd = ReadContents("v.nhdr", header);
  ExpectUprightPhantom(nrrd, "NRRD");
  std::string other = voxels;
  other[0] ^= 1;
  Write("v.raw", other);
  ASSERT_OK_AND_ASSIGN(const CtVolume changed, ReadContents("v.nhdr", header));
  EXPECT_NE(changed.provenance.sha256, nrrd->provenance.sha256);
}

// The phantom in a file for each slice, "part01.raw" to "part09.raw".
class SlicedNrrdTest : public VolumeFileTest {
 protected:
  void WriteParts() const {
    const std::string voxels = PhantomBytes<int16_t>(UprightPlace);
    const size_t bytes = voxels.size() / kSizeZ;
    for (int k = 0; k < kSizeZ; ++k) {
      Write(absl::StrCat("part0", k + 1, ".raw"),
            voxels.substr(static_cast<size_t>(k) * bytes, bytes));
    }
  }
  absl::StatusOr<CtVolume> ReadWith(const std::string& data_file) const {
    std::string header = NrrdLps();
    header.pop_back();  // the empty line before voxels
    return ReadContents("v.nhdr", absl::StrCat(header, "data file: ", data_file, "\n"));
  }
};

std::string ListOfParts() {
  std::string list = "LIST";
  for (int k = 1; k <= kSizeZ; ++k) absl::StrAppend(&list, "\npart0", k, ".raw");
  return list;
}

TEST_F(SlicedNrrdTest, NumberedAndListedFilesAreReadAndAllCount) {
  WriteParts();
  const absl::StatusOr<CtVolume> numbered = ReadWith("part%02d.raw 1 9 1");
  ExpectUprightPhantom(numbered, "NRRD");
  EXPECT_EQ(numbered->provenance.num_files, 10);
  ExpectUprightPhantom(ReadWith("part%02d.raw 1 9 1 2"), "NRRD");
  ExpectUprightPhantom(ReadWith("part0%d.raw 1 9 1"), "NRRD");
  ExpectUprightPhantom(ReadWith(ListOfParts()), "NRRD");
  std::string part = PhantomBytes<int16_t>(UprightPlace).substr(0, 240);
  part[5] ^= 1;
  Write("part01.raw", part);
  ASSERT_OK_AND_ASSIGN(const CtVolume changed, ReadWith("part%02d.raw 1 9 1"));
  EXPECT_NE(changed.provenance.sha256, numbered->provenance.sha256);
}

// As VTK's own headsq has it: ITK reads no "spacings" beside a "space".
TEST_F(SlicedNrrdTest, SpacingsTogetherWithASpaceGetAdvice) {
  const std::string header = NrrdHeader("space: 3D-left-handed\nspacings: 0.5 0.75 1.25\n\n");
  EXPECT_THAT(ReadContents("v.nrrd", header + PhantomBytes<int16_t>(UprightPlace), "RPI"),
              StatusIs(kInvalid, HasSubstr("take the line \"space\" out")));
}

TEST_F(SlicedNrrdTest, MissingShortAndTooFewFilesAreRefused) {
  WriteParts();
  EXPECT_THAT(ReadWith("part%02d.raw 1 8 1"), StatusIs(kInvalid, HasSubstr("cut off")));
  EXPECT_THAT(ReadWith("part%02d.raw 1 10 1"), StatusIs(kInvalid, HasSubstr("cannot be opened")));
  Write("part05.raw", std::string(100, 'x'));
  EXPECT_THAT(ReadWith("part%02d.raw 1 9 1"), StatusIs(kInvalid, HasSubstr("cut off")));
  EXPECT_THAT(ReadWith(ListOfParts()), StatusIs(kInvalid, HasSubstr("cut off")));
}

TEST_F(SlicedNrrdTest, FilesElsewhereAndStrangeNumbersAreRefused) {
  WriteParts();
  std::filesystem::create_directory(Path("inner"));
  for (const char* data_file :
       {"../part%02d.raw 1 9 1", "inner/part%02d.raw 1 9 1", "/etc/host%dname 1 9 1",
        "LIST\n/etc/hostname", "LIST\npart01.raw\n../part02.raw", "LIST 2\n.."}) {
    EXPECT_THAT(ReadWith(data_file), StatusIs(kInvalid, HasSubstr("another folder"))) << data_file;
  }
  for (const char* data_file :
       {"part%s.raw 1 9 1", "part%n%d.raw 1 9 1", "part%02d%d.raw 1 9 1", "part%999d.raw 1 9 1",
        "part%02d.raw 1 9", "part%02d.raw 1 9 0", "part%02d.raw 9 1 1", "part%02d.raw 1 9 1 2 3",
        "part%02d.raw -1 9 1", "part%02d.raw a b c", "part%02.raw 1 9 1", "%",
        "part%*d.raw 1 9 1"}) {
    EXPECT_THAT(ReadWith(data_file), StatusIs(kInvalid, HasSubstr("are not numbered like")))
        << data_file;
  }
  EXPECT_THAT(ReadWith("LIST"), StatusIs(kInvalid, HasSubstr("list of data files is empty")));
  EXPECT_THAT(ReadWith("part%02d.raw 1 2000000000 1"),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("20000 data files")));
  CtReadOptions options;
  options.limits.max_file_bytes = 2000;
  std::string header = NrrdLps();
  header.insert(header.size() - 1, "data file: part%02d.raw 1 9 1\n");
  Write("v.nhdr", header);
  EXPECT_THAT(Read(options, "v.nhdr"),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("limit")));
}

TEST_F(VolumeFileTest, NiftiScalingIsApplied) {
  ASSERT_OK_AND_ASSIGN(
      const CtVolume volume,
      ReadContents("v.nii", NiftiHeader(1, 1, -1024) + PhantomBytes<int16_t>(UprightPlace, 1024)));
  EXPECT_EQ(WorstPhantomError(volume), 0);
}

TEST_F(VolumeFileTest, FileWithoutAnOrientationNeedsAxes) {
  const std::string voxels = PhantomBytes<int16_t>(UprightPlace);
  const std::string spacings = "spacings: 0.5 0.75 1.25\n\n";
  const std::string left_handed =
      "space: 3D-left-handed\nspace directions: (0.5,0,0) (0,0.75,0) (0,0,1.25)\n\n";
  const std::string meta = MetaHeader("") + "ElementDataFile = LOCAL\n";
  const std::vector<std::array<std::string, 3>> files = {
      {"v.nrrd", NrrdHeader(spacings), "NRRD without \"space\""},
      {"v.nrrd", NrrdHeader(left_handed), "NRRD with \"space\" \"3D-left-handed\""},
      {"v.mha", meta, "MetaImage without \"AnatomicalOrientation\""},
      {"v.nii", NiftiHeader(0), "NIfTI with qform_code and sform_code 0"}};
  for (const auto& [name, header, message] : files) {
    EXPECT_THAT(ReadContents(name, header + voxels),
                StatusIs(kInvalid, AllOf(HasSubstr(message), HasSubstr("add \"axes\""))));
    if (name == "v.nii") continue;  // its own directions are not the identity
    ASSERT_OK_AND_ASSIGN(const CtVolume volume, ReadContents(name, header + voxels, "RPI"));
    EXPECT_TRUE(
        volume.direction.isApprox(Eigen::Matrix3d(Eigen::Vector3d(-1, 1, -1).asDiagonal()), 1e-12));
    EXPECT_TRUE(volume.spacing_mm.isApprox(Eigen::Vector3d(0.5, 0.75, 1.25), 1e-9));
  }
}

TEST_F(VolumeFileTest, AxesThatContradictTheFileAreRefused) {
  const std::string file = NrrdLps() + PhantomBytes<int16_t>(UprightPlace);
  ExpectUprightPhantom(ReadContents("v.nrrd", file, "LPS"), "NRRD");
  EXPECT_THAT(ReadContents("v.nrrd", file, "RPS"),
              StatusIs(kInvalid, HasSubstr("\"RPS\" of the recipe contradicts the file, whose axes "
                                           "are \"LPS\"")));
  EXPECT_THAT(ReadContents("v.nrrd", file, "LRS"), StatusIs(kInvalid, HasSubstr("must be three")));
}

TEST_F(VolumeFileTest, RawValuesNeedTheirOffset) {
  const std::string file = NrrdLps() + PhantomBytes<int16_t>(UprightPlace, 1024);
  CtReadOptions options;
  ASSERT_OK_AND_ASSIGN(const CtVolume gray, ReadContents("v.nrrd", file));
  EXPECT_TRUE(gray.has_gray_values);
  options.values = CtValues::kHu;
  EXPECT_THAT(Read(options, "v.nrrd"), StatusIs(kInvalid, HasSubstr("not HU")));
  options.hu_offset = -1024;
  ExpectUprightPhantom(Read(options, "v.nrrd"), "NRRD");
  options.hu_offset = 1e9;
  EXPECT_THAT(Read(options, "v.nrrd"), StatusIs(kInvalid, HasSubstr("hu_offset")));
  options.hu_offset = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(Read(options, "v.nrrd"), StatusIs(kInvalid, HasSubstr("hu_offset")));
}

TEST_F(VolumeFileTest, CutOffFilesAreRefused) {
  const std::string voxels = PhantomBytes<int16_t>(UprightPlace);
  const std::string meta =
      MetaHeader("AnatomicalOrientation = RAI\n") + "ElementDataFile = LOCAL\n";
  for (const auto& [name, header] : {std::pair{"v.nrrd", NrrdLps()}, std::pair{"v.mha", meta},
                                     std::pair{"v.nii", NiftiHeader(1)}}) {
    const std::string whole = header + voxels;
    for (const size_t size : {whole.size() - 1, whole.size() - 1000, header.size(),
                              header.size() / 2, size_t{10}, size_t{0}}) {
      EXPECT_THAT(ReadContents(name, whole.substr(0, size)).status().code(), kInvalid)
          << name << " " << size;
    }
  }
}

TEST_F(VolumeFileTest, CompressedFilesAreReadOnlyWhenWhole) {
  const std::string voxels = PhantomBytes<int16_t>(UprightPlace);
  std::string nrrd = NrrdLps();
  nrrd.replace(nrrd.find("encoding: raw"), 13, "encoding: gzip");
  const std::string packed = Pack(voxels, false);
  const auto meta = [](const std::string& size) {
    return MetaHeader(
               "AnatomicalOrientation = RAI\nOffset = -30 20 100\nBinaryData = True\n"
               "BinaryDataByteOrderMSB = False\nCompressedData = True\n" +
               size) +
           "ElementDataFile = LOCAL\n";
  };
  const std::string stated = absl::StrCat("CompressedDataSize = ", packed.size(), "\n");
  EXPECT_THAT(ReadContents("v.mha", meta("") + packed), StatusIs(kInvalid, HasSubstr("cut off")));
  const std::vector<std::array<std::string, 3>> files = {
      {"v.nrrd", nrrd + Pack(voxels, true), "NRRD"},
      {"v.mha", meta(stated) + packed, "MetaImage"},
      {"v.nii.gz", Pack(NiftiHeader(1) + voxels, true), "NIfTI"}};
  for (const auto& [name, whole, format] : files) {
    ExpectUprightPhantom(ReadContents(name, whole), format);
    for (const size_t missing : {size_t{20}, size_t{200}}) {
      EXPECT_THAT(ReadContents(name, whole.substr(0, whole.size() - missing)),
                  StatusIs(kInvalid, HasSubstr("cut off")))
          << name << " " << missing;
    }
  }
}

TEST_F(VolumeFileTest, DataFileElsewhereIsNotRead) {
  for (const char* name : {"/etc/hostname", "../v.raw", "..", "v%03d.raw 1 9 1", "LIST"}) {
    std::string nrrd = NrrdLps();
    nrrd.insert(nrrd.size() - 1, absl::StrCat("data file: ", name, "\n"));
    EXPECT_THAT(ReadContents("v.nhdr", nrrd),
                StatusIs(kInvalid, ::testing::AnyOf(HasSubstr("another folder"),
                                                    HasSubstr("cannot be opened"),
                                                    HasSubstr("list of data files is empty"))));
    EXPECT_THAT(ReadContents("v.mhd", MetaHeader("AnatomicalOrientation = RAI\n") +
                                          absl::StrCat("ElementDataFile = ", name, "\n")),
                StatusIs(kInvalid, ::testing::AnyOf(HasSubstr("another folder"),
                                                    HasSubstr("several files"))));
  }
  std::string missing = NrrdLps();
  missing.insert(missing.size() - 1, "data file: missing.raw\n");
  EXPECT_THAT(ReadContents("v.nhdr", missing), StatusIs(kInvalid, HasSubstr("cannot be opened")));
}

TEST_F(VolumeFileTest, RefusesFilesThatAreNotOneScalarVolume) {
  const std::string voxels = PhantomBytes<int16_t>(UprightPlace);
  EXPECT_THAT(ReadContents("v.nii", NiftiHeader(1, 1, 0, 3) + voxels + voxels + voxels),
              StatusIs(kInvalid, HasSubstr("3 volumes")));
  EXPECT_THAT(ReadContents("v.mha", MetaHeader("AnatomicalOrientation = RAI\n"
                                               "ElementNumberOfChannels = 3\n") +
                                        "ElementDataFile = LOCAL\n" + voxels + voxels + voxels),
              StatusIs(kInvalid, HasSubstr("3 numbers a voxel")));
  EXPECT_THAT(ReadContents("v.nrrd", "no header"), StatusIs(kInvalid, HasSubstr("begin like one")));
  EXPECT_THAT(ReadContents("v.mha", "no header"), StatusIs(kInvalid, HasSubstr("begin like one")));
  EXPECT_THAT(ReadContents("v.nii", "no header"), StatusIs(kInvalid, HasSubstr("damaged")));
}

TEST_F(VolumeFileTest, RefusesAVoxelThatIsNotANumber) {
  const std::string header = NrrdHeader(
      "space: LPS\nspace directions: (0.5,0,0) (0,0.75,0) (0,0,1.25)\nspace origin: (-30,20,100)\n"
      "\n",
      "float");
  std::string voxels = PhantomBytes<float>(UprightPlace);
  ExpectUprightPhantom(ReadContents("v.nrrd", header + voxels), "NRRD");
  const float nan = std::numeric_limits<float>::quiet_NaN();
  std::memcpy(voxels.data() + 17 * sizeof(float), &nan, sizeof(nan));
  EXPECT_THAT(ReadContents("v.nrrd", header + voxels),
              StatusIs(kInvalid, HasSubstr("voxel 17 is not a number")));
}

TEST_F(VolumeFileTest, AbsurdSpacingAndSizeAreRefused) {
  const auto nrrd = [](const std::string& directions, const std::string& sizes) {
    return absl::StrCat(
        "NRRD0004\ntype: int16\ndimension: 3\nsizes: ", sizes,
        "\nendian: little\nencoding: raw\nspace: LPS\nspace directions: ", directions,
        "\nspace origin: (0,0,0)\n\n", PhantomBytes<int16_t>(UprightPlace));
  };
  EXPECT_THAT(ReadContents("v.nrrd", nrrd("(50,0,0) (0,1,0) (0,0,1)", "12 10 9")),
              StatusIs(kInvalid, HasSubstr("50 mm apart along axis 1")));
  EXPECT_THAT(ReadContents("v.nrrd", nrrd("(1,0,0) (0,1,0) (0,0,1)", "120 9 1")),
              StatusIs(kInvalid, HasSubstr("1 voxels along its axis 3")));
  EXPECT_THAT(ReadContents("v.nrrd", nrrd("(1,0,0) (0,1,0) (0,0,1)", "40000 40000 40000")),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("voxels")));
}

TEST_F(VolumeFileTest, BundledHeadIsReadWithItsRecipe) {
  CtReadOptions options;
  const std::string path = TestDataPath("ct/headsq/headsq_quarter.nhdr");
  EXPECT_THAT(ReadCtVolume(path, options), StatusIs(kInvalid, HasSubstr("\"axes\"")));
  options.axes = "RPI";
  EXPECT_THAT(ReadCtVolume(path, options),
              StatusIs(kInvalid, AllOf(HasSubstr("HU + 1024"), HasSubstr("\"hu_offset\": -1024"))));
  options.hu_offset = -1024;
  ASSERT_OK_AND_ASSIGN(const CtVolume head, ReadCtVolume(path, options));
  EXPECT_THAT(head.size, ElementsAre(64, 64, 93));
  EXPECT_TRUE(head.spacing_mm.isApprox(Eigen::Vector3d(3.2, 3.2, 1.5), 1e-9));
  EXPECT_THAT(head.hu, ::testing::Contains(2902));  // 3926 - 1024, the largest: SOURCE.md
  options.hu_offset = 1000;
  EXPECT_THAT(ReadCtVolume(path, options), StatusIs(kInvalid, HasSubstr("hu_offset 1000")));
  options.hu_offset = -6000;
  EXPECT_THAT(ReadCtVolume(path, options), StatusIs(kInvalid, HasSubstr("only air")));
}

TEST_F(VolumeFileTest, PathThatIsNotThereIsNotFound) {
  EXPECT_THAT(Read({}, "nothing.nii"), StatusIs(absl::StatusCode::kNotFound, HasSubstr("no such")));
}

}  // namespace
}  // namespace tissueform
