// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// Discs and studies: a CT in folders below the given one.

#include <filesystem>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"

#include "tests/core/imaging/ct/ct_folder.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using tissueform::testing::CtFolder;
using tissueform::testing::DicomFile;
using tissueform::testing::IsOk;
using tissueform::testing::kInvalid;
using tissueform::testing::PhantomSeries;
using tissueform::testing::StatusIs;

std::vector<DicomFile> Scan(int number, const std::string& kernel, int slices,
                            const std::string& study = "1.9") {
  std::vector<DicomFile> series = PhantomSeries({.slices = slices, .step_mm = {0, 0, 1.5}});
  for (DicomFile& file : series) {
    file.Text(DicomFile::kSeriesUid, "UI", absl::StrCat(study, ".", number))
        .Text(DicomFile::kSeriesNumber, "IS", absl::StrCat(number))
        .Text(DicomFile::kStudyUid, "UI", study)
        .Text(DicomFile::kFrameOfReference, "UI", "1.7")
        .Text(DicomFile::kKernel, "SH", kernel);
  }
  return series;
}

class DicomFolderTest : public CtFolder {
 protected:
  void WriteIn(const std::string& folder, const std::vector<DicomFile>& series) const {
    std::filesystem::create_directories(Path(folder));
    WriteSeries(series, folder + "/IM");
  }

  // A DICOMDIR that lists these files, each as the disc's standard writes it: "DICOM\\S1\\IM000".
  void WriteDirectory(const std::vector<std::string>& files) const {
    std::vector<DicomFile> records(1);  // of the patient: it references no file
    records.front().Text(0x00041430, "CS", "PATIENT");
    for (const std::string& file : files) {
      records.emplace_back().Text(0x00041430, "CS", "IMAGE").Text(0x00041500, "CS", file);
    }
    DicomFile directory;
    directory.Text(DicomFile::kSopClass, "UI", "1.2.840.10008.1.3.10")
        .Sequence(0x00041220, records);
    Write("DICOMDIR", directory.Bytes());
  }
};

TEST_F(DicomFolderTest, DiscIsReadFromItsRoot) {
  WriteIn("DICOM/PA1/ST1/SE1", Scan(4, "H30s", 9));
  Write("viewer.exe", "MZ");
  std::vector<std::string> files;
  files.reserve(9);
  for (int i = 0; i < 9; ++i) files.push_back(absl::StrCat("DICOM\\PA1\\ST1\\SE1\\IM00", i));
  WriteDirectory(files);
  ASSERT_OK_AND_ASSIGN(const CtVolume disc, Read());
  EXPECT_THAT(disc.provenance.notes,
              ElementsAre("searched 11 files and 4 folders below the given one; the CT is series 4 "
                          "(9 slices, 1.50 mm apart)",
                          "ignored: 1 files that are not DICOM"));
  ASSERT_OK_AND_ASSIGN(const CtVolume folder, Read({}, "DICOM/PA1/ST1/SE1"));
  EXPECT_EQ(disc.hu, folder.hu);
  EXPECT_EQ(disc.provenance.sha256, folder.provenance.sha256);
}

TEST_F(DicomFolderTest, SeriesOfAStudyIsChosenByTheRule) {
  WriteIn("bone", Scan(3, "H70h", 81));
  WriteIn("soft", Scan(5, "H30s", 80));
  ASSERT_OK_AND_ASSIGN(const CtVolume study, Read());
  EXPECT_EQ(study.size[2], 80);
  EXPECT_THAT(study.provenance.notes,
              Contains(AllOf(HasSubstr("chosen of 2 CT series of one study: series 5 (80 axial"),
                             HasSubstr("not series 3: the chosen series has a softer kernel"))));
}

TEST_F(DicomFolderTest, BetweenTwoStudiesTheUserChooses) {
  WriteIn("before", Scan(5, "H30s", 80, "1.8"));
  WriteIn("after", Scan(5, "H30s", 80, "1.9"));
  EXPECT_THAT(Read(), StatusIs(kInvalid, AllOf(HasSubstr("2 CT series"),
                                               HasSubstr("does not choose between studies"),
                                               HasSubstr("2 folders below the given one"),
                                               HasSubstr("name the folder of one series"))));
  EXPECT_THAT(Read({}, "after"), IsOk());
}

TEST_F(DicomFolderTest, FolderWithACtIsReadWithoutThoseBelow) {
  WriteSeries(Scan(4, "H30s", 9));
  WriteIn("old", Scan(3, "H30s", 12));
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
  EXPECT_EQ(volume.size[2], 9);
  EXPECT_TRUE(volume.provenance.notes.empty());
}

TEST_F(DicomFolderTest, FilesThatADirectoryListsAndThatAreMissingAreCounted) {
  WriteDirectory({"S1\\IM000", "S1\\IM001", "..\\secret"});
  EXPECT_THAT(Read(),
              StatusIs(kInvalid, HasSubstr("lists 3 files that are missing: copy the whole")));
  // Mounted in small letters.
  WriteIn("s1", Scan(4, "H30s", 9));
  for (int i = 0; i < 9; ++i) {
    std::filesystem::rename(Path(absl::StrCat("s1/IM00", i)), Path(absl::StrCat("s1/im00", i)));
  }
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
  EXPECT_THAT(volume.provenance.notes,
              Contains("the DICOMDIR lists 1 file that is missing: copy the whole disc"));
}

TEST_F(DicomFolderTest, FilesThatGitLfsHasNotFetchedAreNamed) {
  const std::string pointer =
      "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 1234567\n";
  std::filesystem::create_directories(Path("study"));
  for (const char* name : {"study/IM1", "study/IM2", "head.nii.gz", "head.nrrd"}) {
    Write(name, pointer);
  }
  for (const char* name : {"study", "study/IM1", "head.nii.gz", "head.nrrd"}) {
    EXPECT_THAT(Read({}, name), StatusIs(kInvalid, HasSubstr("run \"git lfs pull\""))) << name;
  }
}

TEST_F(DicomFolderTest, SearchIsLimited) {
  WriteIn("1/2/3", Scan(4, "H30s", 9));
  std::filesystem::create_directory_symlink(Path(), Path("1/loop"));
  const auto read_with = [this](const CtReadLimits& limits) {
    CtReadOptions options;
    options.limits = limits;
    return Read(options);
  };
  EXPECT_THAT(read_with({.max_folders = 3, .max_folder_depth = 3}), IsOk());
  EXPECT_THAT(read_with({.max_folders = 2}),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("more than 2 folders")));
  EXPECT_THAT(read_with({.max_files = 8}),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("more than 8 files")));
  EXPECT_THAT(read_with({.max_folder_depth = 2}), StatusIs(kInvalid, HasSubstr("depth of 2")));
}

}  // namespace
}  // namespace tissueform
