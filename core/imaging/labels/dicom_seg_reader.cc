// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/labels/dicom_seg_reader.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <gdcmReader.h>
#include <map>
#include <sstream>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/string_view.h"
#include <Eigen/LU>

#include "core/base/status_macros.h"
#include "core/imaging/ct/dicom_header.h"
#include "core/imaging/ct/dicom_tags.h"
#include "core/imaging/ct/file_bytes.h"
#include "core/imaging/labels/seg_frames.h"
#include "core/imaging/labels/segment_names.h"
#include "core/mesh/payload/sha256.h"

namespace tissueform {
namespace {

constexpr uint32_t kSopClass = 0x00080016;
constexpr uint32_t kModality = 0x00080060;
constexpr uint32_t kCodeValue = 0x00080100;
constexpr uint32_t kCodeScheme = 0x00080102;
constexpr uint32_t kCodeMeaning = 0x00080104;
constexpr uint32_t kAnatomicRegion = 0x00082218;
constexpr uint32_t kFrameOfReference = 0x00200052;
constexpr uint32_t kBitsAllocated = 0x00280100;
constexpr uint32_t kSegmentationType = 0x00620001;
constexpr uint32_t kSegments = 0x00620002;
constexpr uint32_t kSegmentNumber = 0x00620004;
constexpr uint32_t kSegmentLabel = 0x00620005;
constexpr uint32_t kMaxFraction = 0x0062000e;
constexpr uint32_t kPropertyType = 0x0062000f;
constexpr absl::string_view kDeflatedSyntax = "1.2.840.10008.1.2.1.99";
constexpr absl::string_view kSegClass = "1.2.840.10008.5.1.4.1.1.66.4";
constexpr absl::string_view kLabelMapClass = "1.2.840.10008.5.1.4.1.1.66.7";
const gdcm::Tag kPixelData(0x7fe0, 0x0010);

absl::Status Damaged() {
  return absl::InvalidArgumentError("the DICOM file is truncated or damaged; export it again");
}

// The pixels of all frames as they are stored.
struct Pixels {
  bool bits = false;     // eight a byte, without gaps between frames
  bool numbers = false;  // of segments
  std::vector<float> values;
  absl::string_view bytes;
  float least = 1;  // what counts as labelled
};

absl::Status CheckIsSeg(const gdcm::DataSet& data) {
  const std::string sop_class = TextOf(data, kSopClass);
  if (sop_class == kSegClass || sop_class == kLabelMapClass) return absl::OkStatus();
  const std::string modality = PrintableName(TextOf(data, kModality).substr(0, 4));
  return absl::InvalidArgumentError(
      absl::StrCat("it is a DICOM file of modality ", modality.empty() ? "?" : modality,
                   ", not a segmentation (SEG); name the SEG file, and the CT with --ct"));
}

// A file that was read up to its pixels.
struct SegFile {
  const gdcm::DataSet& data;
  const std::string& contents;
  size_t pixel_offset = 0;
  bool compressed = false;
};

absl::Status Compressed() {
  return absl::InvalidArgumentError(
      "the pixels of the SEG are compressed in a way that is not supported: export it "
      "uncompressed");
}

// Little-endian, one after the other.
absl::StatusOr<std::vector<float>> StoredValues(absl::string_view bytes, size_t count, int bits) {
  const size_t width = bits == 16 ? 2 : 1;
  if (bytes.size() < count * width) return Damaged();
  std::vector<float> values(count);
  for (size_t i = 0; i < count; ++i) {
    const auto low = static_cast<uint8_t>(bytes[i * width]);
    const auto high = width == 2 ? static_cast<uint8_t>(bytes[i * width + 1]) : uint8_t{0};
    values[i] = static_cast<float>(low + 256 * high);
  }
  return values;
}

// The file as one of the SEG class: GDCM decodes no pixels of the newer class of label maps. Both
// UIDs have the same length.
std::string AsSegClass(const SegFile& file) {
  static_assert(kSegClass.size() == kLabelMapClass.size());
  const absl::string_view contents = file.contents;
  return absl::StrCat(
      absl::StrReplaceAll(contents.substr(0, file.pixel_offset), {{kLabelMapClass, kSegClass}}),
      contents.substr(file.pixel_offset));
}

absl::StatusOr<std::vector<float>> ValuesOf(const SegFile& file, const SegGrid& grid, size_t count,
                                            int bits) {
  if (!file.compressed) {
    return StoredValues(absl::string_view(file.contents).substr(file.pixel_offset), count, bits);
  }
  DicomHeader header;
  header.rows = grid.size[1];
  header.columns = grid.size[0];
  header.num_frames = static_cast<int>(grid.frames.size());
  header.pixel_offset = file.pixel_offset;
  absl::StatusOr<std::vector<float>> values = DecodeDicomPixels(header, AsSegClass(file));
  return values.ok() ? std::move(values) : Compressed();
}

absl::StatusOr<Pixels> PixelsOf(const SegFile& file, const SegGrid& grid, int64_t max_voxels) {
  const std::string type = TextOf(file.data, kSegmentationType);
  const int bits = ShortOf(file.data, kBitsAllocated);
  const size_t count =
      static_cast<size_t>(grid.size[0]) * static_cast<size_t>(grid.size[1]) * grid.frames.size();
  Pixels pixels;
  if (bits == 1) {
    // GDCM decodes no packed bits.
    if (file.compressed) return Compressed();
    pixels.bits = true;
    pixels.bytes = absl::string_view(file.contents).substr(file.pixel_offset);
    if (pixels.bytes.size() < (count + 7) / 8) return Damaged();
    return pixels;
  }
  if (bits != 8 && bits != 16) return Damaged();
  if (count > static_cast<size_t>(max_voxels)) {
    return absl::ResourceExhaustedError(
        absl::StrCat("its frames have ", count, " pixels; at most ", max_voxels, " are read"));
  }
  TF_ASSIGN_OR_RETURN(pixels.values, ValuesOf(file, grid, count, bits));
  pixels.numbers = type == "LABELMAP";
  if (type == "FRACTIONAL") {
    const int most = ShortOf(file.data, kMaxFraction);
    pixels.least = static_cast<float>(most > 0 ? most : 255) / 2;
  }
  return pixels;
}

// Calls visit(segment number, frame, index in the frame) for each labelled pixel.
template <typename Visit>
void ForEachLabelled(const Pixels& pixels, const SegGrid& grid, Visit visit) {
  const size_t area = static_cast<size_t>(grid.size[0]) * static_cast<size_t>(grid.size[1]);
  for (size_t f = 0; f < grid.frames.size(); ++f) {
    const SegFrame& frame = grid.frames[f];
    for (size_t i = 0; i < area; ++i) {
      const size_t at = f * area + i;
      if (pixels.bits) {
        const auto byte = static_cast<uint8_t>(pixels.bytes[at / 8]);
        if ((byte >> (at % 8) & 1U) != 0) visit(frame.segment, frame, i);
      } else if (pixels.values[at] >= pixels.least) {
        visit(pixels.numbers ? static_cast<int>(pixels.values[at]) : frame.segment, frame, i);
      }
    }
  }
}

SegmentFacts FactsOf(const gdcm::DataSet& item) {
  SegmentFacts facts;
  facts.name = TextOf(item, kSegmentLabel);
  for (const uint32_t sequence : {kPropertyType, kAnatomicRegion}) {
    ForEachItem(item, sequence, [&](int, const gdcm::DataSet& code) {
      facts.codes.push_back(
          {TextOf(code, kCodeScheme), TextOf(code, kCodeValue), TextOf(code, kCodeMeaning)});
    });
  }
  return facts;
}

absl::StatusOr<std::vector<LabelSegment>> TallySegments(const Pixels& pixels, const SegGrid& grid,
                                                        int max_segments) {
  std::map<int, LabelSegment> tallies;  // middle_mm holds sums of indices here
  const auto columns = static_cast<size_t>(grid.size[0]);
  ForEachLabelled(pixels, grid, [&](int number, const SegFrame& frame, size_t index) {
    if (tallies.size() > static_cast<size_t>(max_segments)) return;
    LabelSegment& tally = tallies[number];
    ++tally.voxels;
    const size_t column = index % columns;
    const size_t row = index / columns;
    tally.middle_mm +=
        Eigen::Vector3d(static_cast<double>(column), static_cast<double>(row), frame.slice);
  });
  if (tallies.size() > static_cast<size_t>(max_segments)) {
    return absl::ResourceExhaustedError(
        absl::StrCat("it has more than ", max_segments, " segments"));
  }
  std::vector<LabelSegment> segments;
  for (auto& [number, tally] : tallies) {
    tally.value = number;
    tally.middle_mm =
        grid.origin_mm + grid.steps_mm * (tally.middle_mm / static_cast<double>(tally.voxels));
    segments.push_back(tally);
  }
  return segments;
}

absl::StatusOr<LabelMap> ToLabelMap(const SegFile& file, const LabelReadOptions& options) {
  const gdcm::DataSet& data = file.data;
  TF_ASSIGN_OR_RETURN(const SegGrid grid, PlaceSegFrames(data, options.limits.max_voxels));
  TF_ASSIGN_OR_RETURN(const Pixels pixels, PixelsOf(file, grid, options.limits.max_voxels));
  LabelMap map;
  map.size = grid.size;
  map.origin_mm = grid.origin_mm;
  map.steps_mm = grid.steps_mm;
  map.format = "DICOM SEG";
  map.frame_uid = TextOf(data, kFrameOfReference);
  TF_ASSIGN_OR_RETURN(map.segments, TallySegments(pixels, grid, options.limits.max_segments));
  std::map<int, SegmentFacts> facts_of_number;
  ForEachItem(data, kSegments, [&](int, const gdcm::DataSet& item) {
    facts_of_number[ShortOf(item, kSegmentNumber)] = FactsOf(item);
  });
  std::vector<SegmentFacts> facts;
  for (LabelSegment& segment : map.segments) {
    facts.push_back(facts_of_number[segment.value]);
    segment.name = PrintableName(facts.back().name);
  }
  if (TextOf(data, kSegmentationType) == "FRACTIONAL") {
    map.notes.emplace_back(
        "The SEG holds fractions: a voxel is labelled where they are at least one half.");
  }
  TF_RETURN_IF_ERROR(AssignStructures(options, facts, std::abs(map.steps_mm.determinant()),
                                      &map.segments, &map.notes));
  std::map<int, StructureSet> set_of_number;
  for (const LabelSegment& segment : map.segments) {
    if (segment.structure) set_of_number[segment.value] = SetOf(*segment.structure);
  }
  map.structures.assign(static_cast<size_t>(map.num_voxels()), 0);
  const size_t area = static_cast<size_t>(grid.size[0]) * static_cast<size_t>(grid.size[1]);
  ForEachLabelled(pixels, grid, [&](int number, const SegFrame& frame, size_t index) {
    const auto found = set_of_number.find(number);
    if (found == set_of_number.end()) return;
    map.structures[static_cast<size_t>(frame.slice) * area + index] |= found->second;
  });
  return map;
}

}  // namespace

bool IsDicomFile(const std::string& path) {
  constexpr size_t kPreamble = 128;
  std::ifstream stream(path, std::ios::binary);
  std::string start(kPreamble + 4, '\0');
  stream.read(start.data(), static_cast<std::streamsize>(start.size()));
  return stream.good() && start.substr(kPreamble) == "DICM";
}

namespace {

// The same file with its data set unpacked, where that is deflated (as dcmqi's files may be). GDCM
// does not report where the pixels of such a file begin.
absl::StatusOr<std::string> WithoutDeflate(std::string contents, int64_t max_bytes) {
  constexpr absl::string_view kGroupLength("\x02\0\0\0UL\4\0", 8);  // (0002,0000), 4 bytes
  constexpr size_t kBegin = 132;
  constexpr absl::string_view kPlain(
      "\x02\0\0\0UL\4\0\x1c\0\0\0\x02\0\x10\0UI\x14\0"
      "1.2.840.10008.1.2.1\0",
      40);
  const absl::string_view meta = absl::string_view(contents).substr(kBegin);
  if (!absl::StartsWith(meta, kGroupLength)) return contents;
  uint32_t length = 0;
  const size_t begin = kGroupLength.size() + sizeof(length);
  if (meta.size() < begin) return Damaged();
  std::memcpy(&length, meta.data() + kGroupLength.size(), sizeof(length));
  const size_t end = begin + length;
  if (meta.size() < end) return Damaged();
  if (!absl::StrContains(meta.substr(0, end), kDeflatedSyntax)) return contents;
  TF_ASSIGN_OR_RETURN(const std::string unpacked, Inflated(meta.substr(end), max_bytes));
  return absl::StrCat(absl::string_view(contents).substr(0, kBegin), kPlain, unpacked);
}

}  // namespace

absl::StatusOr<LabelMap> ReadDicomSeg(const std::string& path, const LabelReadOptions& options) {
  int64_t bytes_left = options.limits.max_file_bytes;
  TF_ASSIGN_OR_RETURN(std::string file, ReadWholeFile(path, &bytes_left));
  const std::string sha256 = Sha256Hex({file});
  TF_ASSIGN_OR_RETURN(const std::string contents,
                      WithoutDeflate(std::move(file), options.limits.max_file_bytes));
  std::istringstream stream(contents);
  gdcm::Reader reader;
  reader.SetStream(stream);
  // A skipped tag is left unread: the stream stands where its value begins. GDCM itself passes over
  // pixels that are missing at the end.
  if (!reader.ReadUpToTag(kPixelData, {kPixelData})) return Damaged();
  const gdcm::TransferSyntax& syntax = reader.GetFile().GetHeader().GetDataSetTransferSyntax();
  if (syntax == gdcm::TransferSyntax::DeflatedExplicitVRLittleEndian ||
      syntax == gdcm::TransferSyntax::ExplicitVRBigEndian) {
    return Compressed();
  }
  const gdcm::DataSet& data = reader.GetFile().GetDataSet();
  TF_RETURN_IF_ERROR(CheckIsSeg(data));
  const auto pixel_offset = static_cast<size_t>(reader.GetStreamCurrentPosition());
  if (pixel_offset > contents.size()) return Damaged();
  TF_ASSIGN_OR_RETURN(LabelMap map,
                      ToLabelMap({data, contents, pixel_offset, syntax.IsEncapsulated()}, options));
  map.sha256 = sha256;
  return map;
}

}  // namespace tissueform
