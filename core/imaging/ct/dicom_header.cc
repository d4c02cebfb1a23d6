// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/dicom_header.h"

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

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"

#include "core/imaging/ct/dicom_frames.h"
#include "core/imaging/ct/dicom_tags.h"

namespace tissueform {
namespace {

constexpr char kSecondaryCaptureStorage[] = "1.2.840.10008.5.1.4.1.1.7";  // and .7.1 to .7.4
constexpr char kPhotographicStorage[] = "1.2.840.10008.5.1.4.1.1.77.1";   // and below
constexpr char kDirectoryStorage[] = "1.2.840.10008.1.3.10";

constexpr uint32_t kMediaStorageClass = 0x00020002;
constexpr uint32_t kImageType = 0x00080008;
constexpr uint32_t kSopClass = 0x00080016;
constexpr uint32_t kModality = 0x00080060;
constexpr uint32_t kSeriesDate = 0x00080021;
constexpr uint32_t kAcquisitionDate = 0x00080022;
constexpr uint32_t kContentDate = 0x00080023;
constexpr uint32_t kAcquisitionDateTime = 0x0008002a;
constexpr uint32_t kSeriesTime = 0x00080031;
constexpr uint32_t kAcquisitionTime = 0x00080032;
constexpr uint32_t kContentTime = 0x00080033;
constexpr uint32_t kPatientName = 0x00100010;
constexpr uint32_t kPatientId = 0x00100020;
constexpr uint32_t kBirthDate = 0x00100030;
constexpr uint32_t kContrastAgent = 0x00180010;
constexpr uint32_t kSliceThickness = 0x00180050;
constexpr uint32_t kVoltage = 0x00180060;
constexpr uint32_t kKernel = 0x00181210;
constexpr uint32_t kPatientPosition = 0x00185100;
constexpr uint32_t kStudyUid = 0x0020000d;
constexpr uint32_t kAcquisitionNumber = 0x00200012;
constexpr uint32_t kFrameOfReference = 0x00200052;
constexpr uint32_t kTemporalPosition = 0x00200100;
constexpr uint32_t kSeriesUid = 0x0020000e;
constexpr uint32_t kSeriesNumber = 0x00200011;
constexpr uint32_t kInstanceNumber = 0x00200013;
constexpr uint32_t kPosition = 0x00200032;
constexpr uint32_t kOrientation = 0x00200037;
constexpr uint32_t kSamplesPerPixel = 0x00280002;
constexpr uint32_t kPhotometricInterpretation = 0x00280004;
constexpr uint32_t kNumberOfFrames = 0x00280008;
constexpr uint32_t kRows = 0x00280010;
constexpr uint32_t kColumns = 0x00280011;
constexpr uint32_t kPixelSpacing = 0x00280030;
constexpr uint32_t kRescaleIntercept = 0x00281052;
constexpr uint32_t kRescaleSlope = 0x00281053;
constexpr uint32_t kRescaleType = 0x00281054;
constexpr uint32_t kLossyImageCompression = 0x00282110;
const gdcm::Tag kPixelData(0x7fe0, 0x0010);

// In an order in which each test may trust the ones before: a directory has no modality, a
// photograph may say CT, and a report of doses has no rows.
DicomKind KindOf(const gdcm::File& file, const DicomHeader& header) {
  const gdcm::DataSet& data = file.GetDataSet();
  const std::string& sop_class = header.class_uid;
  if (TextOf(file.GetHeader(), kMediaStorageClass) == kDirectoryStorage) {
    return DicomKind::kDirectory;
  }
  if (absl::StartsWith(sop_class, kPhotographicStorage) || sop_class == kSecondaryCaptureStorage ||
      absl::StartsWith(sop_class, absl::StrCat(kSecondaryCaptureStorage, "."))) {
    return DicomKind::kSecondaryCapture;
  }
  if (header.modality != "CT") {
    return header.rows == 0 ? DicomKind::kNoImage : DicomKind::kOtherModality;
  }
  if (IntegerOf(data, kNumberOfFrames).value_or(1) > 1 ||
      (IsCtClass(sop_class) && sop_class != kCtImageClass)) {
    return IsLocaliser(header) ? DicomKind::kLocaliser : DicomKind::kMultiFrame;
  }
  if (header.rows == 0 || header.columns == 0) {
    // A header that ends between two elements: only what is missing shows that it is cut off.
    return sop_class == kCtImageClass ? DicomKind::kDamaged : DicomKind::kNoImage;
  }
  if (ShortOf(data, kSamplesPerPixel) > 1 ||
      !absl::StartsWith(TextOf(data, kPhotometricInterpretation), "MONOCHROME")) {
    return DicomKind::kColour;
  }
  if (IsLocaliser(header)) return DicomKind::kLocaliser;
  return sop_class.empty() || sop_class == kCtImageClass ? DicomKind::kCtSlice
                                                         : DicomKind::kOtherModality;
}

void ReadGeometry(const gdcm::DataSet& data, DicomHeader* header) {
  header->rows = ShortOf(data, kRows);
  header->columns = ShortOf(data, kColumns);
  if (const auto position = NumbersOf(data, kPosition, 3)) header->position_mm = *position;
  if (const auto spacing = NumbersOf(data, kPixelSpacing, 2)) header->pixel_spacing_mm = *spacing;
  if (const auto directions = NumbersOf(data, kOrientation, 6)) {
    header->axes.emplace() << directions->head<3>(), directions->tail<3>();
  }
  header->slice_thickness_mm = NumberOf(data, kSliceThickness);
}

void ReadValuesAndKind(const gdcm::DataSet& data, DicomHeader* header) {
  header->modality = TextOf(data, kModality).substr(0, 16);
  header->class_uid = TextOf(data, kSopClass);
  header->image_type = TextOf(data, kImageType);
  header->convolution_kernel = TextOf(data, kKernel);
  header->contrast = TextOf(data, kContrastAgent);
  header->rescale_slope = NumberOf(data, kRescaleSlope);
  header->rescale_intercept = NumberOf(data, kRescaleIntercept);
  header->rescale_type = TextOf(data, kRescaleType);
  header->was_lossy = TextOf(data, kLossyImageCompression) == "01";
}

// What distinguishes patients, scans and reconstructions.
void ReadOrigin(const gdcm::DataSet& data, DicomHeader* header) {
  header->series_uid = TextOf(data, kSeriesUid);
  header->study_uid = TextOf(data, kStudyUid);
  header->frame_uid = TextOf(data, kFrameOfReference);
  header->patient = absl::StrCat(TextOf(data, kPatientId), "\n", TextOf(data, kPatientName), "\n",
                                 TextOf(data, kBirthDate));
  header->patient_position = TextOf(data, kPatientPosition);
  header->reconstruction = absl::StrCat(header->convolution_kernel, "|", TextOf(data, kVoltage),
                                        "|", TextOf(data, kTemporalPosition));
  header->series_number = IntegerOf(data, kSeriesNumber);
  header->instance_number = IntegerOf(data, kInstanceNumber);
  header->acquisition_number = IntegerOf(data, kAcquisitionNumber);
  header->acquisition_time_s = SecondsOf(data, kAcquisitionDate, kAcquisitionTime);
  if (!header->acquisition_time_s) {
    header->acquisition_time_s = SecondsOf(data, kAcquisitionDateTime);
  }
  header->series_time_s = SecondsOf(data, kSeriesDate, kSeriesTime);
  header->content_time_s = SecondsOf(data, kContentDate, kContentTime);
}

absl::Status CannotDecode(const DicomHeader& header, absl::string_view why) {
  return absl::InvalidArgumentError(
      absl::StrCat(NameOf(header), " cannot be read: ", why, "; export the series again"));
}

// GDCM leaves the bits over BitsStored zero in what these decode to, also where values are
// negative.
bool LosesSign(const gdcm::TransferSyntax& syntax) {
  return syntax == gdcm::TransferSyntax::JPEGLSLossless ||
         syntax == gdcm::TransferSyntax::JPEGLSNearLossless ||
         syntax == gdcm::TransferSyntax::JPEG2000Lossless ||
         syntax == gdcm::TransferSyntax::JPEG2000;
}

// Two's complement of the lowest `bits` of each value; others are as they should be already.
template <typename T>
void ExtendSign(int bits, std::vector<T>* values) {
  constexpr int kBits = 8 * static_cast<int>(sizeof(T));
  if (bits < 1 || bits >= kBits) return;
  using Unsigned = std::make_unsigned_t<T>;
  for (T& value : *values) {
    const auto raised = static_cast<Unsigned>(static_cast<Unsigned>(value) << (kBits - bits));
    value = static_cast<T>(static_cast<T>(raised) >> (kBits - bits));
  }
}

template <typename T>
absl::StatusOr<std::vector<float>> ValuesOf(const DicomHeader& header, const gdcm::Image& image) {
  const size_t count = static_cast<size_t>(header.rows) * static_cast<size_t>(header.columns) *
                       static_cast<size_t>(header.num_frames);
  if (image.GetBufferLength() != count * sizeof(T)) {
    return CannotDecode(header, "its number of pixels does not match rows and columns");
  }
  std::vector<T> values(count);
  if (!image.GetBuffer(reinterpret_cast<char*>(values.data()))) {
    return CannotDecode(header, "its pixels are truncated or damaged");
  }
  if constexpr (std::is_signed_v<T>) {
    if (LosesSign(image.GetTransferSyntax())) {
      ExtendSign(image.GetPixelFormat().GetBitsStored(), &values);
    }
  }
  return std::vector<float>(values.begin(), values.end());
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
  if (header.num_frames > 1) absl::StrAppend(&name, ", frame ", header.frame + 1);
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
      return "a localizer (scout view)";
    case DicomKind::kSecondaryCapture:
      return "a photograph or copy of a screen (secondary capture)";
    case DicomKind::kOtherModality:
      return header.modality == "CT" ? "not a conventional CT image"
                                     : absl::StrCat("of modality ", header.modality);
    case DicomKind::kMultiFrame:
      return "a multi-frame image without frame positions: export it as single "
             "slices";
    case DicomKind::kColour:
      return "a color image";
    case DicomKind::kDeflated:
      return "a deflated file, which is not supported: export it in another transfer syntax";
    case DicomKind::kNoImage:
      return "no image";
    case DicomKind::kDirectory:
      return "a directory (DICOMDIR)";
    case DicomKind::kDamaged:
      return "a truncated or damaged DICOM file";
  }
  return "unknown";
}

std::vector<DicomHeader> ReadDicomHeaders(const std::string& path) {
  gdcm::Reader reader;
  reader.SetFileName(path.c_str());
  DicomHeader header;
  header.path = path;
  header.kind = DicomKind::kDamaged;
  if (!reader.CanRead()) {
    return IsBeginning(path) ? std::vector<DicomHeader>{header} : std::vector<DicomHeader>{};
  }
  // A skipped tag is left unread: the stream stands where its value begins.
  const bool whole = reader.ReadUpToTag(kPixelData, {kPixelData});
  if (reader.GetFile().GetHeader().GetDataSetTransferSyntax() ==
      gdcm::TransferSyntax::DeflatedExplicitVRLittleEndian) {
    header.kind = DicomKind::kDeflated;  // GDCM reads some of them only
    return {header};
  }
  if (!whole) return {header};
  const gdcm::DataSet& data = reader.GetFile().GetDataSet();
  header.pixel_offset = reader.GetStreamCurrentPosition();
  ReadValuesAndKind(data, &header);
  ReadOrigin(data, &header);
  ReadGeometry(data, &header);
  header.kind = KindOf(reader.GetFile(), header);
  if (header.kind == DicomKind::kCtSlice) header.class_uid = std::string(kCtImageClass);
  if (header.kind != DicomKind::kMultiFrame) return {header};
  std::vector<DicomHeader> frames = FramesOf(data, header);
  return frames.empty() ? std::vector<DicomHeader>{header} : frames;
}

absl::StatusOr<std::vector<float>> DecodeDicomPixels(const DicomHeader& header,
                                                     const std::string& contents) {
  std::istringstream stream(contents);
  gdcm::ImageReader reader;
  reader.SetStream(stream);
  if (!reader.Read()) return CannotDecode(header, "it is truncated or damaged");
  const gdcm::Image& image = reader.GetImage();
  const gdcm::PixelFormat format = image.GetPixelFormat();
  if (!HoldsAllPixels(header, image, contents)) {
    return CannotDecode(header, "it is truncated");
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
      return CannotDecode(header, "its pixels have an unsupported type");
  }
}

}  // namespace tissueform
