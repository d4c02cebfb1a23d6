// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// Slices as hospitals' archives store them. GDCM compresses them here and decompresses them in the
// reader; the phantom's values are the oracle.

#include <fstream>
#include <gdcmImageChangeTransferSyntax.h>
#include <gdcmImageReader.h>
#include <gdcmImageWriter.h>
#include <iterator>
#include <string_view>

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

constexpr uint32_t kBitsStored = 0x00280101;
constexpr uint32_t kHighBit = 0x00280102;

struct Syntax {
  const char* name;
  gdcm::TransferSyntax::TSType type;
};

class TransferSyntaxTest : public CtFolder {
 protected:
  void WriteIn(gdcm::TransferSyntax::TSType type) const {
    WriteSeries(PhantomSeries({.columns = 64, .rows = 60}));
    Compress(type);
  }

  void Compress(gdcm::TransferSyntax::TSType type) const {
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

  // Sets PixelRepresentation of all files to 1.
  void CallPixelsSigned() const {
    constexpr std::string_view kUnsigned("\x28\0\x03\x01US\2\0\0\0", 10);
    for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
      std::ifstream stream(entry.path(), std::ios::binary);
      std::string bytes{std::istreambuf_iterator<char>(stream), {}};
      const size_t element = bytes.find(kUnsigned);
      ASSERT_NE(element, std::string::npos);
      bytes[element + 8] = 1;
      Write(entry.path().filename().string(), bytes);
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

// The codestreams of JPEG 2000 and JPEG-LS hold 13 bits without a sign; only PixelRepresentation of
// the header says that the highest is one. GDCM writes such a codestream for values that the header
// calls unsigned, which is then corrected in place.
TEST_F(TransferSyntaxTest, SignedValuesOfFewerBitsAreThoseOfTheUncompressedSeries) {
  std::vector<DicomFile> series = PhantomSeries({.columns = 64, .rows = 60});
  WriteSeries(series);
  ASSERT_OK_AND_ASSIGN(const CtVolume plain, Read());
  constexpr size_t kPixels = 64 * 60;
  for (size_t k = 0; k < series.size(); ++k) {
    std::vector<uint16_t> stored(kPixels);
    for (size_t i = 0; i < kPixels; ++i) stored[i] = plain.hu[kPixels * k + i] & 0x1fff;
    series[k].Pixels(stored).Short(kBitsStored, 13).Short(kHighBit, 12);
    series[k].Text(DicomFile::kRescaleIntercept, "DS", "0");
  }
  for (const auto type :
       {gdcm::TransferSyntax::JPEG2000Lossless, gdcm::TransferSyntax::JPEGLSLossless,
        gdcm::TransferSyntax::JPEGLosslessProcess14_1, gdcm::TransferSyntax::RLELossless}) {
    WriteSeries(series);
    Compress(type);
    CallPixelsSigned();
    ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
    EXPECT_EQ(volume.hu, plain.hu) << gdcm::TransferSyntax::GetTSString(type);
  }
}

TEST_F(TransferSyntaxTest, RefusesDeflatedFilesByName) {
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
