// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "core/base/archive/zip_names.h"
#include "core/base/archive/zip_reader.h"
#include "core/planning/plan_building/markups_file.h"
#include "core/planning/plan_building/segment_move.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/fuzzed_file.h"

namespace tissueform::fuzz {
namespace {

namespace fs = std::filesystem;

void Require(bool promise) {
  if (!promise) std::abort();
}

// A message is one line of printable text that quotes nothing.
void CheckMessage(const absl::Status& status) {
  Require(status.ok() || !status.message().empty());
  Require(std::all_of(status.message().begin(), status.message().end(),
                      [](char letter) { return letter >= 32 && letter < 127; }));
}

class FuzzedFolder {
 public:
  FuzzedFolder() {
    std::string path = (fs::temp_directory_path() / "fuzzed-XXXXXX").string();
    if (mkdtemp(path.data()) == nullptr) std::abort();
    path_ = path;
  }
  ~FuzzedFolder() { fs::remove_all(path_); }
  FuzzedFolder(const FuzzedFolder&) = delete;
  FuzzedFolder& operator=(const FuzzedFolder&) = delete;

  std::string inner() const {
    const fs::path inner = path_ / "inner";
    fs::create_directory(inner);
    return inner.string();
  }
  // That nothing lies beside the inner folder, and how many bytes in it.
  int64_t CheckedBytes() const {
    int64_t bytes = 0;
    for (const fs::directory_entry& entry : fs::directory_iterator(path_)) {
      Require(entry.path().filename() == "inner");
    }
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(path_)) {
      Require(!entry.is_symlink());
      if (entry.is_regular_file()) bytes += static_cast<int64_t>(entry.file_size());
    }
    return bytes;
  }

 private:
  fs::path path_;
};

}  // namespace

void FuzzZip(const uint8_t* data, size_t size) {
  const FuzzedFile file(data, size);
  const FuzzedFolder folder;
  ZipLimits limits;
  limits.max_files = 20;
  limits.max_bytes = int64_t{1} << 20;
  const absl::Status status = ReadZip(file.path(), folder.inner(), limits);
  CheckMessage(status);
  Require(folder.CheckedBytes() <= limits.max_bytes);
  const absl::string_view name(reinterpret_cast<const char*>(data), size);
  const absl::StatusOr<std::vector<std::string>> parts = PartsOfZipName(name, 16);
  if (!parts.ok()) return;
  for (const std::string& part : *parts) {
    Require(!part.empty() && part != ".." && part.find_first_of("/\\") == part.npos);
  }
}

void FuzzTransform(const uint8_t* data, size_t size) {
  const absl::StatusOr<RigidMove> move =
      ParseItkTransform(std::string(reinterpret_cast<const char*>(data), size));
  CheckMessage(move.status());
  if (!move.ok()) return;
  const Eigen::Matrix3d& rotation = move->rotation;
  const Eigen::Matrix3d rest = rotation.transpose() * rotation - Eigen::Matrix3d::Identity();
  Require(rest.cwiseAbs().maxCoeff() < 1e-9 && rotation.determinant() > 0);
  Require(move->translation_mm.allFinite());
}

void FuzzMarkups(const uint8_t* data, size_t size) {
  const auto markups = ParseMarkups(std::string(reinterpret_cast<const char*>(data), size));
  if (!markups.ok()) return;
  Require(!markups->empty());
  for (const Markup& markup : *markups) {
    for (const MarkupPoint& point : markup.points) Require(point.position_mm.allFinite());
    if (!markup.plane) continue;
    Require(markup.plane->point_mm.allFinite());
    Require(std::abs(markup.plane->normal.norm() - 1) < 1e-6);
  }
}

}  // namespace tissueform::fuzz
