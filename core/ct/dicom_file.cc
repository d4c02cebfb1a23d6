// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/ct/dicom_file.h"

#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <gdcmImageReader.h>
#include <gdcmReader.h>
#include <limits>
#include <sstream>
#include <string_view>
#include <type_traits>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

namespace tissueform {
namespace {

constexpr char kCtImageStorage[] = "1.2.840.10008.5.1.4.1.1.2";
constexpr char kEnhancedCtImageStorage[] = "1.2.840.10008.5.1.4.1.1.2.1";
constexpr char kSecondaryCaptureStorage[] = "1.2.840.10008.5.1.4.1.1.7";  // and .7.1 to .7.4
constexpr char kPhotographicStorage[] = "1.2.840.10008.5.1.4.1.1.77.1";   // and below
constexpr char kDirectoryStorage[] = "1.2.840.10008.1.3.10";

const gdcm::Tag kMediaStorageClass(0x0002, 0x0002);
const gdcm::Tag kImageType(0x0008, 0x0008);
const gdcm::Tag kSopClass(0x0008, 0x0016);
const gdcm::Tag kModality(0x0008, 0x0060);
const gdcm::Tag kSeriesUid(0x0020, 0x000e);
const gdcm::Tag kSeriesNumber(0x0020, 0x0011);
const gdcm::Tag kInstanceNumber(0x0020, 0x0013);
const gdcm::Tag kPosition(0x0020, 0x0032);
const gdcm::Tag kOrientation(0x0020, 0x0037);
const gdcm::Tag kSamplesPerPixel(0x0028, 0x0002);
const gdcm::Tag kPhotometricInterpretation(0x0028, 0x0004);
const gdcm::Tag kNumberOfFrames(0x0028, 0x0008);
const gdcm::Tag kRows(0x0028, 0x0010);
const gdcm::Tag kColumns(0x0028, 0x0011);
const gdcm::Tag kPixelSpacing(0x0028, 0x0030);
const gdcm::Tag kRescaleIntercept(0x0028, 0x1052);
const gdcm::Tag kRescaleSlope(0x0028, 0x1053);
const gdcm::Tag kLossyImageCompression(0x0028, 0x2110);
const gdcm::Tag kPixelData(0x7fe0, 0x0010);

// Values are taken as text and read strictly: a header may hold anything.
std::string TextOf(const gdcm::DataSet& data, const gdcm::Tag& tag) {
  if (!data.FindDataElement(tag)) return "";
  const gdcm::ByteValue* const value = data.GetDataElement(tag).GetByteValue();
  if (value == nullptr || value->GetPointer() == nullptr) return "";
  std::string text(value->GetPointer(), value->GetLength());
  while (!text.empty() && text.back() == '\0') text.pop_back();
  absl::StripAsciiWhitespace(&text);
  return text;
}

// A tag of type US, which GDCM keeps in this machine's byte order; 0 where there is none.
int ShortOf(const gdcm::DataSet& data, const gdcm::Tag& tag) {
  if (!data.FindDataElement(tag)) return 0;
  const gdcm::ByteValue* const value = data.GetDataElement(tag).GetByteValue();
  uint16_t number = 0;
  if (value == nullptr || value->GetLength() < sizeof(number)) return 0;
  std::memcpy(&number, value->GetPointer(), sizeof(number));
  return number;
}

std::optional<int> IntegerOf(const gdcm::DataSet& data, const gdcm::Tag& tag) {
  int number = 0;
  if (!absl::SimpleAtoi(TextOf(data, tag), &number)) return std::nullopt;
  return number;
}

// N finite numbers with backslashes between them, or nothing.
template <int N>
std::optional<Eigen::Matrix<double, N, 1>> NumbersOf(const gdcm::DataSet& data,
                                                     const gdcm::Tag& tag) {
  const std::vector<std::string> parts = absl::StrSplit(TextOf(data, tag), '\\');
  if (parts.size() != N) return std::nullopt;
  Eigen::Matrix<double, N, 1> numbers;
  for (int i = 0; i < N; ++i) {
    if (!absl::SimpleAtod(parts[static_cast<size_t>(i)], &numbers[i])) return std::nullopt;
  }
  if (!numbers.allFinite()) return std::nullopt;
  return numbers;
}

std::optional<double> NumberOf(const gdcm::DataSet& data, const gdcm::Tag& tag) {
  const auto numbers = NumbersOf<1>(data, tag);
  if (!numbers) return std::nullopt;
  return (*numbers)[0];
}

bool IsLocaliser(const gdcm::DataSet& data) {
  const std::string image_type = TextOf(data, kImageType);
  return absl::StrContains(image_type, "LOCALIZER") || absl::StrContains(image_type, "SCOUT");
}

// In an order in which each test may trust the ones before: a directory has no modality, a
// photograph may say CT, and a report of doses has no rows.
DicomKind KindOf(const gdcm::File& file, const std::string& modality) {
  const gdcm::DataSet& data = file.GetDataSet();
  const std::string sop_class = TextOf(data, kSopClass);
  if (TextOf(file.GetHeader(), kMediaStorageClass) == kDirectoryStorage) {
    return DicomKind::kDirectory;
  }
  if (absl::StartsWith(sop_class, kPhotographicStorage) || sop_class == kSecondaryCaptureStorage ||
      absl::StartsWith(sop_class, absl::StrCat(kSecondaryCaptureStorage, "."))) {
    return DicomKind::kSecondaryCapture;
  }
  if (modality != "CT") {
    return ShortOf(data, kRows) == 0 ? DicomKind::kNoImage : DicomKind::kOtherModality;
  }
  if (IntegerOf(data, kNumberOfFrames).value_or(1) > 1 || sop_class == kEnhancedCtImageStorage) {
    return DicomKind::kMultiFrame;
  }
  if (ShortOf(data, kRows) == 0 || ShortOf(data, kColumns) == 0) return DicomKind::kNoImage;
  if (ShortOf(data, kSamplesPerPixel) > 1 ||
      !absl::StartsWith(TextOf(data, kPhotometricInterpretation), "MONOCHROME")) {
    return DicomKind::kColour;
  }
  if (IsLocaliser(data)) return DicomKind::kLocaliser;
  return sop_class.empty() || sop_class == kCtImageStorage ? DicomKind::kCtSlice
                                                           : DicomKind::kOtherModality;
}

void ReadGeometry(const gdcm::DataSet& data, DicomHeader* header) {
  header->rows = ShortOf(data, kRows);
  header->columns = ShortOf(data, kColumns);
  header->position_mm = NumbersOf<3>(data, kPosition);
  header->pixel_spacing_mm = NumbersOf<2>(data, kPixelSpacing);
  if (const auto directions = NumbersOf<6>(data, kOrientation)) {
    header->row_direction = directions->head<3>();
    header->column_direction = directions->tail<3>();
  }
}

absl::Status CannotDecode(const DicomHeader& header, absl::string_view why) {
  return absl::InvalidArgumentError(
      absl::StrCat(NameOf(header), " cannot be read: ", why, "; export the series again"));
}

template <typename T>
absl::StatusOr<std::vector<double>> ValuesOf(const DicomHeader& header, const gdcm::Image& image) {
  const size_t count = static_cast<size_t>(header.rows) * static_cast<size_t>(header.columns);
  std::vector<T> values(count);
  if (image.GetBufferLength() != count * sizeof(T)) {
    return CannotDecode(header, "its pixels are not as many as rows and columns say");
  }
  if (!image.GetBuffer(reinterpret_cast<char*>(values.data()))) {
    return CannotDecode(header, "its pixels are cut off or damaged");
  }
  return std::vector<double>(values.begin(), values.end());
}

// GDCM passes over pixels that are missing at the end of a file, and so does its JPEG decoder.
bool HoldsAllPixels(const DicomHeader& header, const gdcm::Image& image,
                    const std::string& contents) {
  if (header.pixel_offset > contents.size()) return false;
  if (image.GetTransferSyntax().IsEncapsulated()) {
    // Sequence delimitation item (PS3.5, A.4): what compressed pixels end with.
    constexpr std::string_view kEnd("\xfe\xff\xdd\xe0\0\0\0\0", 8);
    return contents.find(kEnd, header.pixel_offset) != std::string::npos;
  }
  return contents.size() - header.pixel_offset >= image.GetBufferLength();
}

// No more than what a DICOM file begins with: 128 bytes, nearly always zeros, and "DICM". So ends
// what was copied to a full disk.
bool IsBeginning(const std::string& path) {
  constexpr std::streamsize kBeginning = 132;
  std::ifstream stream(path, std::ios::binary);
  std::string bytes(kBeginning, '\0');
  stream.read(bytes.data(), kBeginning);
  bytes.resize(static_cast<size_t>(stream.gcount()));
  if (absl::EndsWith(bytes, "DICM")) return true;
  return bytes.size() < kBeginning && bytes.find_first_not_of('\0') == std::string::npos;
}

}  // namespace

std::string NameOf(const DicomHeader& header) {
  std::string name = absl::StrCat("file ", header.file_number, " of the folder");
  if (header.instance_number) {
    absl::StrAppend(&name, " (instance number ", *header.instance_number, ")");
  }
  return name;
}

std::string DescribeKind(const DicomHeader& header) {
  switch (header.kind) {
    case DicomKind::kCtSlice:
      return "a CT slice";
    case DicomKind::kLocaliser:
      return "a localiser (scout view)";
    case DicomKind::kSecondaryCapture:
      return "a photograph or copy of a screen (secondary capture)";
    case DicomKind::kOtherModality:
      return header.modality == "CT" ? "no plain CT image"
                                     : absl::StrCat("of modality ", header.modality);
    case DicomKind::kMultiFrame:
      return "a multi-frame (enhanced) image, which is not read: export it as single slices";
    case DicomKind::kColour:
      return "a colour image";
    case DicomKind::kDeflated:
      return "a deflated file, which is not read: export it in another transfer syntax";
    case DicomKind::kNoImage:
      return "no image";
    case DicomKind::kDirectory:
      return "a directory (DICOMDIR)";
    case DicomKind::kDamaged:
      return "a DICOM file that is cut off or damaged";
  }
  return "unknown";
}

std::optional<DicomHeader> ReadDicomHeader(const std::string& path) {
  gdcm::Reader reader;
  reader.SetFileName(path.c_str());
  DicomHeader header;
  header.path = path;
  header.kind = DicomKind::kDamaged;
  if (!reader.CanRead()) return IsBeginning(path) ? std::optional(header) : std::nullopt;
  // A skipped tag is left unread: the stream stands where its value begins.
  const bool whole = reader.ReadUpToTag(kPixelData, {kPixelData});
  if (reader.GetFile().GetHeader().GetDataSetTransferSyntax() ==
      gdcm::TransferSyntax::DeflatedExplicitVRLittleEndian) {
    header.kind = DicomKind::kDeflated;  // GDCM reads some of them only
    return header;
  }
  if (!whole) return header;
  const gdcm::DataSet& data = reader.GetFile().GetDataSet();
  header.pixel_offset = reader.GetStreamCurrentPosition();
  header.modality = TextOf(data, kModality).substr(0, 16);
  header.kind = KindOf(reader.GetFile(), header.modality);
  header.series_uid = TextOf(data, kSeriesUid);
  header.series_number = IntegerOf(data, kSeriesNumber);
  header.instance_number = IntegerOf(data, kInstanceNumber);
  header.rescale_slope = NumberOf(data, kRescaleSlope);
  header.rescale_intercept = NumberOf(data, kRescaleIntercept);
  header.was_lossy = TextOf(data, kLossyImageCompression) == "01";
  ReadGeometry(data, &header);
  return header;
}

absl::StatusOr<std::vector<double>> DecodeDicomPixels(const DicomHeader& header,
                                                      const std::string& contents) {
  std::istringstream stream(contents);
  gdcm::ImageReader reader;
  reader.SetStream(stream);
  if (!reader.Read()) return CannotDecode(header, "it is cut off or damaged");
  const gdcm::Image& image = reader.GetImage();
  const gdcm::PixelFormat format = image.GetPixelFormat();
  if (!HoldsAllPixels(header, image, contents)) {
    return CannotDecode(header, "it is cut off");
  }
  switch (format.GetScalarType()) {
    case gdcm::PixelFormat::UINT8:
      return ValuesOf<uint8_t>(header, image);
    case gdcm::PixelFormat::INT8:
      return ValuesOf<int8_t>(header, image);
    case gdcm::PixelFormat::UINT12:
    case gdcm::PixelFormat::UINT16:
      return ValuesOf<uint16_t>(header, image);
    case gdcm::PixelFormat::INT12:
    case gdcm::PixelFormat::INT16:
      return ValuesOf<int16_t>(header, image);
    case gdcm::PixelFormat::UINT32:
      return ValuesOf<uint32_t>(header, image);
    case gdcm::PixelFormat::INT32:
      return ValuesOf<int32_t>(header, image);
    default:
      return CannotDecode(header, "its pixels are of an unusual type");
  }
}

}  // namespace tissueform
