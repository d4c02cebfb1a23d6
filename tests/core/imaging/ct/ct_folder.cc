// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/core/imaging/ct/ct_folder.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "tests/testing/meshes.h"

namespace tissueform::testing {
namespace {

constexpr char kPatient[] = "Doe^Jane";

std::string LittleEndian(uint64_t value, int bytes) {
  std::string text;
  for (int i = 0; i < bytes; ++i) text += static_cast<char>((value >> (8 * i)) & 0xff);
  return text;
}

bool HasLongLength(const std::string& vr) { return vr == "OB" || vr == "OW" || vr == "SQ"; }

std::string ElementBytes(uint32_t tag, const std::string& vr, std::string value) {
  if (value.size() % 2 != 0) value += vr == "UI" || vr == "OB" ? '\0' : ' ';
  std::string bytes = LittleEndian(tag >> 16, 2) + LittleEndian(tag & 0xffff, 2) + vr;
  bytes += HasLongLength(vr) ? LittleEndian(0, 2) + LittleEndian(value.size(), 4)
                             : LittleEndian(value.size(), 2);
  return bytes + value;
}

std::string Numbers(const std::vector<double>& numbers) {
  std::string text;
  for (const double number : numbers) {
    absl::StrAppend(&text, text.empty() ? "" : "\\", absl::StrFormat("%.10g", number));
  }
  return text;
}

std::string Vector(const Eigen::Vector3d& v) { return Numbers({v[0], v[1], v[2]}); }

DicomFile SliceHeader(const SeriesGeometry& geometry, int slice) {
  const Eigen::Vector3d& row = geometry.row_direction;
  const Eigen::Vector3d& column = geometry.column_direction;
  DicomFile file;
  file.Text(DicomFile::kImageType, "CS", "ORIGINAL\\PRIMARY\\AXIAL")
      .Text(DicomFile::kSopClass, "UI", "1.2.840.10008.5.1.4.1.1.2")
      .Text(DicomFile::kModality, "CS", "CT")
      .Text(DicomFile::kPatientName, "PN", kPatient)
      .Text(DicomFile::kSeriesUid, "UI", "1.2.3.4")
      .Text(DicomFile::kSeriesNumber, "IS", "2")
      .Text(DicomFile::kInstanceNumber, "IS", absl::StrCat(slice + 1))
      .Text(DicomFile::kPosition, "DS", Vector(geometry.origin_mm + slice * geometry.step_mm))
      .Text(DicomFile::kOrientation, "DS", Vector(row) + "\\" + Vector(column))
      .Text(DicomFile::kPhotometric, "CS", "MONOCHROME2")
      .Text(DicomFile::kPixelSpacing, "DS",
            Numbers({geometry.pixel_spacing_mm[0], geometry.pixel_spacing_mm[1]}))
      .Text(DicomFile::kRescaleIntercept, "DS", "-1024")
      .Text(DicomFile::kRescaleSlope, "DS", "1")
      .Short(DicomFile::kSamplesPerPixel, 1)
      .Short(DicomFile::kRows, static_cast<uint16_t>(geometry.rows))
      .Short(DicomFile::kColumns, static_cast<uint16_t>(geometry.columns))
      .Short(0x00280100, 16)  // bits allocated
      .Short(0x00280101, 16)  // bits stored
      .Short(0x00280102, 15)  // high bit
      .Short(0x00280103, 0);  // unsigned
  return file;
}

// Of a slice whose first pixel lies there.
std::vector<uint16_t> PhantomPixels(const SeriesGeometry& geometry, const Eigen::Vector3d& first) {
  std::vector<uint16_t> pixels;
  for (int j = 0; j < geometry.rows; ++j) {
    for (int i = 0; i < geometry.columns; ++i) {
      const Eigen::Vector3d place = first +
                                    i * geometry.pixel_spacing_mm[1] * geometry.row_direction +
                                    j * geometry.pixel_spacing_mm[0] * geometry.column_direction;
      pixels.push_back(static_cast<uint16_t>(PhantomHu(place) + 1024));
    }
  }
  return pixels;
}

}  // namespace

DicomFile& DicomFile::Text(uint32_t tag, const std::string& vr, const std::string& value) {
  elements_[tag] = {vr, value};
  return *this;
}

DicomFile& DicomFile::Short(uint32_t tag, uint16_t value) {
  return Text(tag, "US", LittleEndian(value, 2));
}

DicomFile& DicomFile::Pixels(const std::vector<uint16_t>& values) {
  std::string bytes;
  for (const uint16_t value : values) bytes += LittleEndian(value, 2);
  return Text(kPixelData, "OW", bytes);
}

DicomFile& DicomFile::Sequence(uint32_t tag, const std::vector<DicomFile>& items) {
  std::string bytes;
  for (const DicomFile& item : items) {
    const std::string elements = item.Elements();
    bytes += LittleEndian(0xfffe, 2) + LittleEndian(0xe000, 2) + LittleEndian(elements.size(), 4);
    bytes += elements;
  }
  return Text(tag, "SQ", bytes);
}

DicomFile& DicomFile::Erase(uint32_t tag) {
  elements_.erase(tag);
  return *this;
}

std::string DicomFile::Bytes() const {
  const auto sop_class = elements_.find(kSopClass);
  std::string meta = ElementBytes(0x00020001, "OB", std::string("\0\1", 2));
  meta +=
      ElementBytes(0x00020002, "UI", sop_class == elements_.end() ? "" : sop_class->second.value);
  meta += ElementBytes(0x00020003, "UI", "1.2.3.4.5");
  meta += ElementBytes(0x00020010, "UI", "1.2.840.10008.1.2.1");
  meta += ElementBytes(0x00020012, "UI", "1.2.3");
  std::string bytes = std::string(128, '\0') + "DICM";
  bytes += ElementBytes(0x00020000, "UL", LittleEndian(meta.size(), 4)) + meta;
  return bytes + Elements();
}

std::string DicomFile::Elements() const {
  std::string bytes;
  for (const auto& [tag, element] : elements_) {
    bytes += ElementBytes(tag, element.vr, element.value);
  }
  return bytes;
}

double PhantomHu(const Eigen::Vector3d& position_mm) {
  const double hu = 4 * position_mm[0] + 16 * position_mm[1] - 8 * position_mm[2] + 800;
  return position_mm[0] < -28 ? -1000 : std::round(hu);
}

std::vector<DicomFile> PhantomSeries(const SeriesGeometry& geometry) {
  std::vector<DicomFile> series;
  for (int k = 0; k < geometry.slices; ++k) {
    const Eigen::Vector3d first = geometry.origin_mm + k * geometry.step_mm;
    series.push_back(SliceHeader(geometry, k).Pixels(PhantomPixels(geometry, first)));
  }
  return series;
}

DicomFile EnhancedPhantom(const SeriesGeometry& geometry, const std::vector<int>& slices,
                          bool shared, const std::vector<uint16_t>& acquisitions) {
  const Eigen::Vector3d& row = geometry.row_direction;
  const Eigen::Vector3d& column = geometry.column_direction;
  const auto add_common = [&](DicomFile* groups) {
    DicomFile measures;
    measures.Text(DicomFile::kPixelSpacing, "DS",
                  Numbers({geometry.pixel_spacing_mm[0], geometry.pixel_spacing_mm[1]}));
    DicomFile plane;
    plane.Text(DicomFile::kOrientation, "DS", Vector(row) + "\\" + Vector(column));
    DicomFile values;
    values.Text(DicomFile::kRescaleIntercept, "DS", "-1024")
        .Text(DicomFile::kRescaleSlope, "DS", "1");
    groups->Sequence(0x00289110, {measures})
        .Sequence(0x00209116, {plane})
        .Sequence(0x00289145, {values});
  };
  std::vector<DicomFile> frames;
  std::vector<uint16_t> pixels;
  for (const int k : slices) {
    const Eigen::Vector3d first = geometry.origin_mm + k * geometry.step_mm;
    DicomFile position;
    position.Text(DicomFile::kPosition, "DS", Vector(first));
    DicomFile frame;
    frame.Sequence(0x00209113, {position});
    if (!acquisitions.empty()) {
      DicomFile content;
      content.Short(0x00209156, acquisitions[frames.size()]);
      frame.Sequence(0x00209111, {content});
    }
    if (!shared) add_common(&frame);
    frames.push_back(frame);
    const std::vector<uint16_t> image = PhantomPixels(geometry, first);
    pixels.insert(pixels.end(), image.begin(), image.end());
  }
  DicomFile common;
  if (shared) add_common(&common);
  DicomFile file = SliceHeader(geometry, 0);
  for (const uint32_t tag :
       {DicomFile::kPosition, DicomFile::kOrientation, DicomFile::kPixelSpacing,
        DicomFile::kRescaleIntercept, DicomFile::kRescaleSlope}) {
    file.Erase(tag);
  }
  file.Text(DicomFile::kSopClass, "UI", "1.2.840.10008.5.1.4.1.1.2.1")
      .Text(DicomFile::kNumberOfFrames, "IS", absl::StrCat(slices.size()))
      .Sequence(DicomFile::kSharedGroups, {common})
      .Sequence(DicomFile::kFrameGroups, frames)
      .Pixels(pixels);
  return file;
}

std::vector<DicomFile> SeriesOf(const CtVolume& volume) {
  SeriesGeometry geometry;
  geometry.columns = volume.size[0];
  geometry.rows = volume.size[1];
  geometry.pixel_spacing_mm = {volume.spacing_mm[1], volume.spacing_mm[0]};
  geometry.row_direction = volume.direction.col(0);
  geometry.column_direction = volume.direction.col(1);
  std::vector<DicomFile> series;
  const auto count = static_cast<size_t>(volume.size[0]) * static_cast<size_t>(volume.size[1]);
  for (int k = 0; k < volume.size[2]; ++k) {
    std::vector<uint16_t> pixels(count);
    for (size_t i = 0; i < count; ++i) {
      pixels[i] = static_cast<uint16_t>(volume.hu[static_cast<size_t>(k) * count + i] + 1024);
    }
    geometry.origin_mm = volume.Place(0, 0, k) - k * geometry.step_mm;
    series.push_back(SliceHeader(geometry, k).Pixels(pixels));
  }
  return series;
}

absl::StatusOr<CtVolume> ReadBundledHead() {
  CtReadOptions options;
  options.axes = "RPI";
  options.hu_offset = -1024;
  return ReadCtVolume(TestDataPath("ct/headsq/headsq_quarter.nhdr"), options);
}

void CtFolder::SetUp() {
  const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
  std::string name = std::string(info->test_suite_name()) + "." + info->name();
  std::replace(name.begin(), name.end(), '/', '.');
  folder_ = std::filesystem::path(::testing::TempDir()) / "Doe_Jane" / name;
  std::filesystem::remove_all(folder_);
  std::filesystem::create_directories(folder_);
}

void CtFolder::Write(const std::string& name, const std::string& contents) const {
  std::ofstream(Path(name), std::ios::binary) << contents;
}

void CtFolder::WriteSeries(const std::vector<DicomFile>& series, const std::string& prefix) const {
  for (size_t i = 0; i < series.size(); ++i) {
    Write(absl::StrFormat("%s%03d", prefix, series.size() - 1 - i), series[i].Bytes());
  }
}

absl::StatusOr<CtVolume> CtFolder::Read(const CtReadOptions& options,
                                        const std::string& name) const {
  ::testing::internal::CaptureStderr();
  absl::StatusOr<CtVolume> volume = ReadCtVolume(Path(name), options);
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
  const std::string message(volume.status().message());
  EXPECT_THAT(message, ::testing::Not(::testing::ContainsRegex("Doe|Jane|\n")));
  return volume;
}

double WorstPhantomError(const CtVolume& volume) {
  double worst = 0;
  for (int k = 0; k < volume.size[2]; ++k) {
    for (int j = 0; j < volume.size[1]; ++j) {
      for (int i = 0; i < volume.size[0]; ++i) {
        worst = std::max(worst, std::abs(volume.At(i, j, k) - PhantomHu(volume.Place(i, j, k))));
      }
    }
  }
  return worst;
}

}  // namespace tissueform::testing
