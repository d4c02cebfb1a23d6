// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace tissueform {

// Contents of a file of at most `*bytes_left` bytes, which it lowers by what was read. The message
// of an error (InvalidArgument, ResourceExhausted) does not hold the path.
absl::StatusOr<std::string> ReadWholeFile(const std::string& path, int64_t* bytes_left);

// How many bytes the streams of gzip or zlib in `packed` hold, one after the other; 0 where they
// are cut off or damaged. Stops counting soon after `enough`. ITK's readers of NIfTI and MetaImage
// pass over what is missing. Internal to core/imaging/ct.
int64_t UnpackedSize(absl::string_view packed, int64_t enough);

// The first bytes of `contents`, unpacked where they are gzip; fewer if there are not so many.
std::string UnpackedStart(absl::string_view contents, size_t count);

// Unpacks one stream of bare deflate (RFC 1951); what follows its end does not count. Errors:
// InvalidArgument where it is cut off or damaged, ResourceExhausted beyond `max_bytes`.
absl::StatusOr<std::string> Inflated(absl::string_view packed, int64_t max_bytes);

// Whether the file is a git-LFS pointer (core/base/lfs_pointer.h).
bool IsLfsPointerFile(const std::string& path);

// Whether they begin as gzip does.
bool IsGzip(absl::string_view bytes);

}  // namespace tissueform
