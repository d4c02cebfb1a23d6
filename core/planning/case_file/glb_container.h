// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "nlohmann/json.hpp"

namespace tissueform {

// The binary form of glTF 2.0 (GLB): a JSON chunk, then one chunk of bytes that the JSON's buffer
// views cut into pieces.

// Buffer views of our files begin at multiples of this.
inline constexpr size_t kGlbAlignment = 16;

// Puts pieces of bytes behind each other.
class GlbWriter {
 public:
  // The number of the new buffer view. `target`: glTF's, 0: none.
  int AddView(absl::string_view bytes, int target = 0);

  // The file: `root` with "buffers" and "bufferViews" of the pieces.
  std::string Finish(nlohmann::json root) const;

 private:
  std::string bin_;
  nlohmann::json views_ = nlohmann::json::array();
};

// A file that has been taken apart. `views` point into its bytes.
struct Glb {
  nlohmann::json root;
  std::vector<absl::string_view> views;
};

// Errors: InvalidArgument: not a GLB, sizes or offsets that disagree with the bytes, JSON that is
// none, more than one buffer, a view that is not aligned; ResourceExhausted: JSON over `most_json`.
absl::StatusOr<Glb> ParseGlb(absl::string_view bytes, size_t most_json);

// object[key] as a whole number from `least` to `most`. Errors: InvalidArgument with `where`.
absl::StatusOr<int64_t> WholeNumber(const nlohmann::json& object, const char* key, int64_t least,
                                    int64_t most, absl::string_view where);

// object[key] as an array of at most `most` objects; empty where there is no such key. The same
// errors.
absl::StatusOr<std::vector<nlohmann::json>> Objects(const nlohmann::json& object, const char* key,
                                                    size_t most, absl::string_view where);

}  // namespace tissueform
