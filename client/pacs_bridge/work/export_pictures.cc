// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/work/export_pictures.h"

#include <cstdint>
#include <filesystem>
#include <optional>
#include <system_error>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"

#include "client/pacs_bridge/work/material_band.h"
#include "client/pacs_bridge/work/retry_times.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

// A report without a band is better than none: a server that has no room for it is asked so often.
constexpr int64_t kMaxBandAttempts = 5;
// The program that draws does not say whether it fails for good.
constexpr int64_t kMaxDrawAttempts = 20;
constexpr char kBandFile[] = "band.f64";

}  // namespace

bool ExportPictures::AreThere(const std::string& folder) {
  std::error_code failed;
  return fs::exists(FolderIn(folder), failed) && fs::exists(folder + "/" + kBandFile, failed);
}

absl::StatusOr<std::vector<double>> ExportPictures::Make(const QueuedExport& queued,
                                                         const ExportMaterial& material) {
  {
    MutexLock lock(mutex_);
    while (making_.contains(queued.name)) made_.Wait(mutex_);
    making_.insert(queued.name);
  }
  const absl::Cleanup done = [this, &queued] {
    MutexLock lock(mutex_);
    making_.erase(queued.name);
    made_.NotifyAll();
  };
  // The band first: who sees the pictures may confirm at once, and then nothing is left to wait
  // for.
  absl::StatusOr<std::vector<double>> band = BandOf(queued, material);
  std::error_code failed;
  if (!fs::exists(material.pictures, failed)) {
    const absl::Status drawn = writer_->Draw(material, material.pictures);
    if (!drawn.ok() && (!MayCome(drawn) || absl::IsDeadlineExceeded(drawn))) {
      const bool again = queued.attempts < kMaxDrawAttempts;
      return again ? absl::UnavailableError(drawn.message())
                   : absl::FailedPreconditionError(drawn.message());
    }
    TF_RETURN_IF_ERROR(drawn);
  }
  return band;
}

absl::StatusOr<std::vector<double>> ExportPictures::AskBand(const QueuedExport& queued,
                                                            const ExportMaterial& material) {
  const absl::StatusOr<std::vector<double>> band =
      server_->ReadBand(material.case_file, material.prediction.description);
  const bool fits =
      band.ok() &&
      (band->empty() || band->size() == static_cast<size_t>(material.prediction.positions.rows()));
  if (fits) return band;
  if (!band.ok() && MayCome(band.status()) && queued.attempts < kMaxBandAttempts) return band;
  if (warn_) {
    warn_(
        absl::StrCat(queued.name, " is written without a band of uncertainty: ",
                     band.ok() ? "it needs one number for each vertex" : band.status().message()));
  }
  return std::vector<double>();
}

absl::StatusOr<std::vector<double>> ExportPictures::BandOf(const QueuedExport& queued,
                                                           const ExportMaterial& material) {
  const std::string path = fs::path(material.pictures).replace_filename(kBandFile);
  std::optional<std::vector<double>> kept =
      ReadBandFile(path, material.prediction.positions.rows());
  if (kept.has_value()) return *std::move(kept);
  TF_ASSIGN_OR_RETURN(const std::vector<double> band, AskBand(queued, material));
  TF_RETURN_IF_ERROR(WriteBandFile(path, band));
  return band;
}

}  // namespace tissueform
