// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/work/prediction_writer.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/time.h"

#include "client/pacs_bridge/objects/prediction_objects.h"
#include "client/pacs_bridge/work/material_band.h"
#include "core/base/atomic_file.h"
#include "core/base/process/tissueform_command.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::minutes kRenderTime{5};

std::vector<std::string> PicturesIn(const std::string& folder) {
  std::vector<std::string> pictures;
  std::error_code error;
  for (fs::directory_iterator file(folder, error), end; !error && file != end;
       file.increment(error)) {
    if (file->path().extension() == ".png") pictures.push_back(file->path().string());
  }
  std::sort(pictures.begin(), pictures.end());
  return pictures;
}

PredictionObjectsInput InputOf(const ExportMaterial& material) {
  PredictionObjectsInput input;
  input.source_header = material.header;
  input.source_series_uid = material.series_uid;
  for (const QueuedImage& image : SourcesAmong(material.sources)) {
    input.source_images.push_back({image.class_uid, image.uid});
  }
  input.contents = material.case_file;
  input.prediction = material.prediction.description;
  input.deformed = material.prediction.positions;
  input.band_mm = material.band_mm;
  if (input.band_mm.empty()) {
    input.why_no_band = WhyNoMaterialBand(input.contents, input.prediction);
    if (input.why_no_band.empty()) input.why_no_band = "the server could not compute it";
  }
  input.measures.assign(material.asked.measures().begin(), material.asked.measures().end());
  input.uids = material.uids;
  // The time of the request, not of this moment: writing again gives the same bytes.
  input.made = absl::FromUnixSeconds(material.asked.create_time().seconds());
  return input;
}

class PredictionWriter final : public ObjectWriter {
 public:
  PredictionWriter(std::string device_serial, int cancel)
      : device_serial_(std::move(device_serial)), cancel_(cancel) {}

  absl::StatusOr<std::vector<std::string>> KeysOf(const ExportMaterial& material) override {
    return PredictionUidKeys(material.case_file);
  }

  absl::Status Draw(const ExportMaterial& material, const std::string& folder) override {
    const FloatPositions positions = material.prediction.positions.cast<float>();
    const std::string file = folder + ".f32";
    TF_RETURN_IF_ERROR(WriteFileAtomically(
        file,
        absl::string_view(reinterpret_cast<const char*>(positions.data()),
                          static_cast<size_t>(positions.size()) * sizeof(float)),
        0600));
    const absl::Status drawn =
        RunTissueform({"case", "render", material.case_path, "--positions", file, "--out", folder},
                      "drawing the pictures", folder + ".log", kRenderTime, cancel_);
    std::error_code ignored;
    fs::remove(file, ignored);
    return drawn;
  }

  absl::StatusOr<std::vector<ExportFile>> Write(const ExportMaterial& material) override {
    PredictionObjectsInput input = InputOf(material);
    input.device_serial = device_serial_;
    input.pictures = PicturesIn(material.pictures);
    TF_ASSIGN_OR_RETURN(const std::vector<WrittenObject> written,
                        WritePredictionObjects(input, material.folder));
    std::vector<ExportFile> files;
    files.reserve(written.size());
    for (const WrittenObject& object : written) files.push_back({object.key, object.path});
    return files;
  }

 private:
  const std::string device_serial_;
  const int cancel_;
};

}  // namespace

std::unique_ptr<ObjectWriter> MakePredictionWriter(const std::string& device_serial, int cancel) {
  return std::make_unique<PredictionWriter>(device_serial, cancel);
}

}  // namespace tissueform
