// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/case_file/glb_container.h"

#include <bit>
#include <cstring>
#include <limits>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"

#include "core/base/json/json_text.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

using Json = nlohmann::json;

static_assert(std::endian::native == std::endian::little, "GLB is little-endian");

constexpr uint32_t kMagic = 0x46546C67;      // "glTF"
constexpr uint32_t kJsonChunk = 0x4E4F534A;  // "JSON"
constexpr uint32_t kBinChunk = 0x004E4942;   // "BIN\0"
constexpr size_t kHeadBytes = 12;
constexpr size_t kChunkHeadBytes = 8;
constexpr size_t kMaxViews = 1024;

absl::Status Refused(absl::string_view what) {
  return absl::InvalidArgumentError(absl::StrCat("not a usable glTF file: ", what));
}

void Append(std::string* text, uint32_t word) {
  text->append(reinterpret_cast<const char*>(&word), sizeof(word));
}

uint32_t Word(absl::string_view bytes, size_t offset) {
  uint32_t word = 0;
  std::memcpy(&word, bytes.data() + offset, sizeof(word));
  return word;
}

void Pad(std::string* text, size_t multiple, char with) {
  text->append((multiple - text->size() % multiple) % multiple, with);
}

// Takes the chunk at the front of `bytes` off it.
absl::StatusOr<absl::string_view> TakeChunk(absl::string_view* bytes, uint32_t type) {
  if (bytes->size() < kChunkHeadBytes) return Refused("a chunk is missing; it is truncated");
  const size_t size = Word(*bytes, 0);
  if (Word(*bytes, 4) != type) return Refused("its chunks are not JSON followed by BIN");
  if (size % 4 != 0 || size > bytes->size() - kChunkHeadBytes) {
    return Refused(absl::StrCat("a chunk says ", size, " bytes and ",
                                bytes->size() - kChunkHeadBytes, " follow"));
  }
  const absl::string_view chunk = bytes->substr(kChunkHeadBytes, size);
  bytes->remove_prefix(kChunkHeadBytes + size);
  return chunk;
}

absl::Status CutIntoViews(absl::string_view bin, Glb* glb) {
  TF_ASSIGN_OR_RETURN(const std::vector<Json> buffers, Objects(glb->root, "buffers", 1, ""));
  if (buffers.size() != 1 || buffers[0].contains("uri")) {
    return Refused("it must have exactly one buffer, inside the file");
  }
  const int64_t chunk_bytes = static_cast<int64_t>(bin.size());
  TF_ASSIGN_OR_RETURN(const int64_t buffer_bytes,
                      WholeNumber(buffers[0], "byteLength", 1, chunk_bytes, "/buffers/0"));
  if (chunk_bytes - buffer_bytes >= 4) return Refused("its buffer is shorter than its BIN chunk");
  TF_ASSIGN_OR_RETURN(const std::vector<Json> views,
                      Objects(glb->root, "bufferViews", kMaxViews, ""));
  for (size_t v = 0; v < views.size(); ++v) {
    const std::string where = absl::StrCat("/bufferViews/", v);
    TF_RETURN_IF_ERROR(WholeNumber(views[v], "buffer", 0, 0, where).status());
    const bool has_offset = views[v].contains("byteOffset");
    TF_ASSIGN_OR_RETURN(
        const int64_t offset,
        has_offset ? WholeNumber(views[v], "byteOffset", 0, buffer_bytes, where) : 0);
    TF_ASSIGN_OR_RETURN(const int64_t size,
                        WholeNumber(views[v], "byteLength", 1, buffer_bytes - offset, where));
    if (offset % int64_t{kGlbAlignment} != 0 || views[v].contains("byteStride")) {
      return Refused(absl::StrCat(where, " does not start at a multiple of ", kGlbAlignment,
                                  ", or has a stride"));
    }
    glb->views.push_back(bin.substr(static_cast<size_t>(offset), static_cast<size_t>(size)));
  }
  return absl::OkStatus();
}

}  // namespace

int GlbWriter::AddView(absl::string_view bytes, int target) {
  Pad(&bin_, kGlbAlignment, '\0');
  Json view = {{"buffer", 0}, {"byteOffset", bin_.size()}, {"byteLength", bytes.size()}};
  if (target != 0) view["target"] = target;
  bin_.append(bytes.data(), bytes.size());
  views_.push_back(std::move(view));
  return static_cast<int>(views_.size()) - 1;
}

std::string GlbWriter::Finish(Json root) const {
  root["buffers"] = Json::array();
  root["buffers"].push_back({{"byteLength", bin_.size()}});
  root["bufferViews"] = views_;
  std::string text = root.dump();
  // The BIN chunk's bytes begin at a multiple, so that views are aligned in the file as well.
  text.append((kGlbAlignment - (kHeadBytes + 2 * kChunkHeadBytes + text.size()) % kGlbAlignment) %
                  kGlbAlignment,
              ' ');
  std::string bin = bin_;
  Pad(&bin, 4, '\0');
  const size_t total = kHeadBytes + 2 * kChunkHeadBytes + text.size() + bin.size();
  std::string file;
  file.reserve(total);
  Append(&file, kMagic);
  Append(&file, 2);
  Append(&file, static_cast<uint32_t>(total));
  Append(&file, static_cast<uint32_t>(text.size()));
  Append(&file, kJsonChunk);
  file += text;
  Append(&file, static_cast<uint32_t>(bin.size()));
  Append(&file, kBinChunk);
  file += bin;
  return file;
}

absl::StatusOr<Glb> ParseGlb(absl::string_view bytes, size_t most_json) {
  if (bytes.size() < kHeadBytes || Word(bytes, 0) != kMagic) {
    return Refused("it does not start with \"glTF\"");
  }
  if (Word(bytes, 4) != 2) return Refused("only version 2 is supported");
  if (Word(bytes, 8) != bytes.size()) {
    return Refused(absl::StrCat("it says ", Word(bytes, 8), " bytes and has ", bytes.size()));
  }
  bytes.remove_prefix(kHeadBytes);
  TF_ASSIGN_OR_RETURN(const absl::string_view json, TakeChunk(&bytes, kJsonChunk));
  if (json.size() > most_json) {
    return absl::ResourceExhaustedError(
        absl::StrCat("the JSON has ", json.size(), " bytes; at most ", most_json, " are read"));
  }
  TF_ASSIGN_OR_RETURN(const absl::string_view bin, TakeChunk(&bytes, kBinChunk));
  if (!bytes.empty()) return Refused("there is data after its BIN chunk");
  Glb glb;
  TF_ASSIGN_OR_RETURN(glb.root, ParseJsonStrictly(std::string(json)));
  if (!glb.root.is_object()) return Refused("its JSON is not an object");
  TF_RETURN_IF_ERROR(CutIntoViews(bin, &glb));
  return glb;
}

absl::StatusOr<int64_t> WholeNumber(const Json& object, const char* key, int64_t least,
                                    int64_t most, absl::string_view where) {
  const auto found = object.find(key);
  // The library reads what is above 2^63 as unsigned.
  const bool is_whole = found != object.end() && found->is_number_integer() &&
                        (!found->is_number_unsigned() ||
                         found->get<uint64_t>() <= uint64_t{std::numeric_limits<int64_t>::max()});
  if (is_whole && found->get<int64_t>() >= least && found->get<int64_t>() <= most) {
    return found->get<int64_t>();
  }
  return Refused(
      absl::StrCat(where, "/", key, " is not a whole number from ", least, " to ", most));
}

absl::StatusOr<std::vector<Json>> Objects(const Json& object, const char* key, size_t most,
                                          absl::string_view where) {
  const auto found = object.find(key);
  if (found == object.end()) return std::vector<Json>{};
  if (!found->is_array() || found->size() > most) {
    return Refused(absl::StrCat(where, "/", key, " is not a list of at most ", most));
  }
  for (const Json& item : *found) {
    if (!item.is_object())
      return Refused(absl::StrCat(where, "/", key, " does not contain an object"));
  }
  return found->get<std::vector<Json>>();
}

}  // namespace tissueform
