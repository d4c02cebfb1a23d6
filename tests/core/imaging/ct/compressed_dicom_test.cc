// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// Slices as hospitals' archives store them. GDCM compresses them here and decompresses them in the
// reader; the phantom's values are the oracle.

#include <gdcmImageChangeTransferSyntax.h>
#include <gdcmImageReader.h>
#include <gdcmImageWriter.h>

#include "tests/core/imaging/ct/ct_folder.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using tissueform::testing::CtFolder;
using tissueform::testing::DicomFile;
using tissueform::testing::PhantomSeries;
using tissueform::testing::StatusIs;
using tissueform::testing::WorstPhantomError;

struct Syntax {
  const char* name;
  gdcm::TransferSyntax::TSType type;
};

class TransferSyntaxTest : public CtFolder {
 protected:
  void WriteIn(gdcm::TransferSyntax::TSType type) const {
    WriteSeries(PhantomSeries({.columns = 64, .rows = 60}));
    for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
      const std::string path = entry.path().string();
      gdcm::ImageReader reader;
      reader.SetFileName(path.c_str());
      ASSERT_TRUE(reader.Read());
      gdcm::ImageChangeTransferSyntax change;
      change.SetTransferSyntax(type);
      change.SetInput(reader.GetImage());
      ASSERT_TRUE(change.Change());
      gdcm::ImageWriter writer;
      writer.SetFile(reader.GetFile());
      writer.SetImage(change.GetOutput());
      writer.SetFileName(path.c_str());
      ASSERT_TRUE(writer.Write());
    }
  }
};

class CompressedDicomTest : public TransferSyntaxTest,
                            public ::testing::WithParamInterface<Syntax> {};

TEST_P(CompressedDicomTest, HoldsTheValuesThatWereCompressed) {
  WriteIn(GetParam().type);
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
  EXPECT_THAT(volume.size, ElementsAre(64, 60, 9));
  EXPECT_EQ(WorstPhantomError(volume), 0);
}

TEST_P(CompressedDicomTest, CutOffSliceIsRefused) {
  WriteIn(GetParam().type);
  const std::string slice = Path("slice004");
  std::filesystem::resize_file(slice, std::filesystem::file_size(slice) - 40);
  EXPECT_THAT(Read(), StatusIs(absl::StatusCode::kInvalidArgument,
                               HasSubstr("file 5 of the folder (instance number 5)")));
}

INSTANTIATE_TEST_SUITE_P(
    Syntaxes, CompressedDicomTest,
    ::testing::Values(Syntax{"implicit", gdcm::TransferSyntax::ImplicitVRLittleEndian},
                      Syntax{"big_endian", gdcm::TransferSyntax::ExplicitVRBigEndian},
                      Syntax{"run_length", gdcm::TransferSyntax::RLELossless},
                      Syntax{"jpeg_lossless", gdcm::TransferSyntax::JPEGLosslessProcess14_1},
                      Syntax{"jpeg_ls", gdcm::TransferSyntax::JPEGLSLossless},
                      Syntax{"jpeg_2000", gdcm::TransferSyntax::JPEG2000Lossless}),
    [](const auto& test) { return std::string(test.param.name); });

TEST_F(TransferSyntaxTest, DeflatedFilesAreRefusedAsWhatTheyAre) {
  WriteIn(gdcm::TransferSyntax::DeflatedExplicitVRLittleEndian);
  EXPECT_THAT(Read(), StatusIs(absl::StatusCode::kInvalidArgument,
                               AllOf(HasSubstr("no CT slices"), HasSubstr("a deflated file"))));
}

TEST_F(TransferSyntaxTest, LossIsNoted) {
  std::vector<DicomFile> series = PhantomSeries();
  WriteSeries(series);
  ASSERT_OK_AND_ASSIGN(const CtVolume whole, Read());
  EXPECT_THAT(whole.provenance.notes, IsEmpty());
  series[2].Text(0x00282110, "CS", "01");
  series[7].Text(0x00282110, "CS", "01");
  WriteSeries(series);
  ASSERT_OK_AND_ASSIGN(const CtVolume lossy, Read());
  EXPECT_THAT(lossy.provenance.notes, ElementsAre("2 slices were once compressed with loss"));
}

}  // namespace
}  // namespace tissueform
