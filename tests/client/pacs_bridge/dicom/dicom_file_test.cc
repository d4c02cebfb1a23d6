// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/dicom/dicom_file.h"

#include <csignal>
#include <filesystem>
#include <memory>
#include <string>

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include "client/pacs_bridge/dicom/instance_header.h"
#include "client/pacs_bridge/dicom/patient_study.h"
#include "core/base/error_reason.h"
#include "tests/testing/ct_series.h"
#include "tests/testing/file_bytes.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_authority.h"

namespace tissueform::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

CtSeries OneSlice(const fs::path& folder, CtSeriesOptions options = {}) {
  options.slices = 1;
  return WriteCtSeries(folder, options);
}

TEST(DicomFile, AHeaderHasNeitherPixelsNorPrivateElementsAndOneReader) {
  const fs::path folder = EmptyTestFolder("dicom_header_only");
  CtSeriesOptions options;
  options.private_text = "hidden";
  const CtSeries series = OneSlice(folder, options);
  const fs::path header = folder / "header";
  ASSERT_THAT(CopyHeaderOnly(series.files[0], header), IsOk());
  EXPECT_EQ(fs::status(header).permissions(), fs::perms::owner_read | fs::perms::owner_write);
  EXPECT_FALSE(fs::exists(folder / "header.partial"));
  const auto file = LoadDicomHeader(header);
  ASSERT_THAT(file.status(), IsOk());
  EXPECT_FALSE((*file)->getDataset()->tagExists(DCM_PixelData));
  EXPECT_FALSE((*file)->getDataset()->tagExists(DcmTagKey(0x0029, 0x1010)));
  EXPECT_EQ(ReadInstanceHeader(header)->instance_uid, series.instance_uids[0]);
}

TEST(DicomFile, FullDiskIsReportedForTheSmallestFileAndNothingIsLeft) {
  const fs::path folder = EmptyTestFolder("dicom_full_disk");
  const CtSeries series = OneSlice(folder);
  rlimit before = {};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit full = {200, before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &full), 0);
  const absl::Status status = CopyHeaderOnly(series.files[0], folder / "header");
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
  std::signal(SIGXFSZ, handler);
  EXPECT_TRUE(HasReason(status, ErrorReason::kDiskFull)) << status;
  EXPECT_FALSE(fs::exists(folder / "header"));
  EXPECT_FALSE(fs::exists(folder / "header.partial"));
}

TEST(DicomFile, AHeaderHasNothingThatIsDrawnOverPixels) {
  const fs::path folder = EmptyTestFolder("dicom_header_drawn");
  const CtSeries series = OneSlice(folder);
  const DcmTagKey overlay(0x6002, 0x3000);
  DcmFileFormat file;
  ASSERT_TRUE(file.loadFile(series.files[0].c_str()).good());
  const std::vector<Uint8> bits(64, 0xFF);
  auto* element = new DcmOtherByteOtherWord(DcmTag(overlay, EVR_OW));
  element->putUint8Array(bits.data(), static_cast<unsigned long>(bits.size()));
  ASSERT_TRUE(file.getDataset()->insert(element).good());
  ASSERT_TRUE(file.saveFile(series.files[0].c_str()).good());
  const fs::path header = folder / "header";
  ASSERT_THAT(CopyHeaderOnly(series.files[0], header), IsOk());
  EXPECT_TRUE((*LoadDicomHeader(series.files[0]))->getDataset()->tagExists(overlay));
  EXPECT_FALSE((*LoadDicomHeader(header))->getDataset()->tagExists(overlay));
}

TEST(DicomFile, PatientAndStudyAreCopiedWholeAndNothingElse) {
  const fs::path folder = EmptyTestFolder("dicom_modules");
  CtSeriesOptions options;
  options.character_set = "ISO_IR 100";
  options.patient_name = "M\xFCller";
  const CtSeries series = OneSlice(folder, options);
  const auto source = LoadDicomHeader(series.files[0]);
  ASSERT_THAT(source.status(), IsOk());
  DcmDataset copy;
  copy.putAndInsertString(DCM_PatientComments, "of somebody else");
  ASSERT_THAT(CopyPatientAndStudy((*source)->getDataset(), &copy), IsOk());
  for (const DcmTagKey& tag :
       {DCM_SpecificCharacterSet, DCM_PatientName, DCM_PatientID, DCM_IssuerOfPatientID,
        DCM_PatientBirthDate, DCM_PatientSex, DCM_StudyInstanceUID, DCM_StudyID,
        DCM_AccessionNumber, DCM_StudyDate, DCM_StudyTime, DCM_ReferringPhysicianName,
        DCM_StudyDescription}) {
    OFString before;
    OFString after;
    (*source)->getDataset()->findAndGetOFStringArray(tag, before);
    EXPECT_TRUE(copy.findAndGetOFStringArray(tag, after).good()) << tag.toString();
    EXPECT_EQ(before, after);
  }
  EXPECT_FALSE(copy.tagExists(DCM_PatientComments));
  EXPECT_FALSE(copy.tagExists(DCM_SeriesInstanceUID));
  EXPECT_FALSE(copy.tagExists(DCM_ImagePositionPatient));
}

TEST(DicomFile, InvalidDicomFileIsRefused) {
  const fs::path folder = EmptyTestFolder("dicom_bad");
  EXPECT_THAT(LoadDicomHeader(folder / "none").status(),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("there is no such file")));
  EXPECT_THAT(LoadDicomHeader(folder).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("it is not a file")));
  WriteTestFile(folder / "text", "DICM? no.");
  EXPECT_THAT(LoadDicomHeader(folder / "text").status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("not a DICOM file")));
  const CtSeries series = OneSlice(folder);
  WriteTestFile(folder / "cut", BytesOfFile(series.files[0]).substr(0, 700));
  EXPECT_THAT(LoadDicomHeader(folder / "cut").status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("damaged, truncated")));
  EXPECT_THAT(
      LoadDicomHeader(series.files[0], {.max_file_bytes = 1000}).status(),
      StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("more than the limit of 1000")));
}

TEST(DicomFile, ItemsWithinItemsEndAtALimitAndNotWithTheStack) {
  const fs::path folder = EmptyTestFolder("dicom_nested");
  const std::string good = BytesOfFile(OneSlice(folder).files[0]);
  // A sequence with an item with a sequence: (0008,1140) of undefined length.
  const std::string open(
      "\x08\x00\x40\x11SQ\x00\x00\xFF\xFF\xFF\xFF\xFE\xFF\x00\xE0\xFF\xFF\xFF\xFF", 20);
  const size_t dataset = good.find(std::string("\x08\x00\x08\x00", 4));
  ASSERT_NE(dataset, std::string::npos);
  std::string nested = good.substr(0, dataset);
  for (int i = 0; i < 300'000; ++i) nested += open;
  WriteTestFile(folder / "nested", nested);
  EXPECT_THAT(LoadDicomHeader(folder / "nested").status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("more than 4096 items")));
  // As deep as the limit lets it: the stack holds that.
  WriteTestFile(folder / "deep", nested.substr(0, dataset + 4090 * open.size()));
  EXPECT_THAT(LoadDicomHeader(folder / "deep").status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("damaged, truncated")));
}

TEST(DicomFile, DeflatedFileIsRefused) {
  const fs::path folder = EmptyTestFolder("dicom_deflated");
  const CtSeries series = OneSlice(folder);
  DcmFileFormat file;
  ASSERT_TRUE(file.loadFile(series.files[0].c_str()).good());
  ASSERT_TRUE(
      file.saveFile((folder / "deflated").c_str(), EXS_DeflatedLittleEndianExplicit).good());
  EXPECT_THAT(ReadInstanceHeader(folder / "deflated").status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("it is deflated")));
}

}  // namespace
}  // namespace tissueform::testing
