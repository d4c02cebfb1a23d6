// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/testing/nrrd_file.h"

#include <fstream>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace tissueform::testing {

absl::Status WriteNrrd(const std::string& path, const CtVolume& volume) {
  std::ofstream file(path, std::ios::binary);
  file << "NRRD0004\ntype: int16\ndimension: 3\nspace: left-posterior-superior\nsizes: "
       << absl::StrFormat("%d %d %d\nspace directions:", volume.size[0], volume.size[1],
                          volume.size[2]);
  const Eigen::Matrix3d steps = volume.StepsMm();
  for (int axis = 0; axis < 3; ++axis) {
    file << absl::StrFormat(" (%.9g,%.9g,%.9g)", steps(0, axis), steps(1, axis), steps(2, axis));
  }
  file << absl::StrFormat("\nspace origin: (%.9g,%.9g,%.9g)\n", volume.origin_mm.x(),
                          volume.origin_mm.y(), volume.origin_mm.z())
       << "kinds: domain domain domain\nendian: little\nencoding: raw\n\n";
  file.write(reinterpret_cast<const char*>(volume.hu.data()),
             static_cast<std::streamsize>(volume.hu.size() * sizeof(int16_t)));
  file.close();
  if (!file) return absl::UnavailableError(absl::StrCat("cannot write \"", path, "\""));
  return absl::OkStatus();
}

}  // namespace tissueform::testing
