// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcostrma.h>

#include "client/pacs_bridge/network/instance_folder.h"

namespace tissueform {

// Where DCMTK writes the bytes of an object that comes, as they come: a file with a meta header of
// ours before them. After the first failure (the disk, a limit) it swallows what else comes, so
// that the association goes on and the sender can receive the status.
class InstanceStream : public DcmOutputStream {
 public:
  // `partial` is there and empty; OK in `failure` or not: the stream can be written to.
  InstanceStream(const std::string& partial, const AnnouncedInstance& announced, int64_t max_bytes);
  // One that keeps nothing, for the reason `failure`.
  explicit InstanceStream(absl::Status failure);
  ~InstanceStream() override;

  // All bytes have come: closes the file. What went wrong first.
  absl::Status Close();

 private:
  class File;

  explicit InstanceStream(std::unique_ptr<File> file);

  const std::unique_ptr<File> file_;
};

}  // namespace tissueform
