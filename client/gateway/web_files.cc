// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/web_files.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <system_error>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMaxFiles = 4096;
constexpr size_t kMaxBytes = size_t{256} << 20;
// Of a bundler's hash in a name.
constexpr size_t kMinHashLetters = 8;

// FNV-1a with the finalizer of splitmix64: gateways beside each other must give a file one ETag.
// Not against adversaries.
uint64_t StableHash(absl::string_view text) {
  uint64_t hash = 0xcbf29ce484222325;
  for (const char c : text) {
    hash ^= static_cast<unsigned char>(c);
    hash *= 0x100000001b3;
  }
  hash = (hash ^ (hash >> 30)) * 0xbf58476d1ce4e5b9;
  hash = (hash ^ (hash >> 27)) * 0x94d049bb133111eb;
  return hash ^ (hash >> 31);
}

constexpr std::array<std::pair<absl::string_view, absl::string_view>, 17> kTypes = {{
    {".css", "text/css; charset=utf-8"},
    {".gif", "image/gif"},
    {".html", "text/html; charset=utf-8"},
    {".ico", "image/x-icon"},
    {".jpg", "image/jpeg"},
    {".js", "text/javascript; charset=utf-8"},
    {".json", "application/json"},
    {".map", "application/json"},
    {".mjs", "text/javascript; charset=utf-8"},
    {".png", "image/png"},
    {".svg", "image/svg+xml"},
    {".txt", "text/plain; charset=utf-8"},
    {".wasm", "application/wasm"},
    {".webmanifest", "application/manifest+json"},
    {".webp", "image/webp"},
    {".woff2", "font/woff2"},
    {".glb", "model/gltf-binary"},
}};

std::string TypeOf(const std::string& path) {
  const std::string extension = absl::AsciiStrToLower(fs::path(path).extension().string());
  const auto* const found = std::find_if(kTypes.begin(), kTypes.end(),
                                         [&](const auto& type) { return type.first == extension; });
  return std::string(found != kTypes.end() ? found->second : "application/octet-stream");
}

// "index-B7sKq2aZ.js": what follows the last hyphen, up to the extension.
bool HasHash(const std::string& path) {
  if (!absl::StartsWith(path, "/assets/")) return false;
  const std::string stem = fs::path(path).stem().string();
  const size_t hyphen = stem.rfind('-');
  return hyphen != std::string::npos && stem.size() - hyphen > kMinHashLetters;
}

absl::StatusOr<std::string> ReadFile(const fs::path& path, size_t most) {
  std::error_code error;
  const uintmax_t size = fs::file_size(path, error);
  if (error || size > most) {
    return absl::ResourceExhaustedError(
        absl::StrCat("--web: the files are larger than ", kMaxBytes >> 20, " MiB together"));
  }
  std::ifstream file(path, std::ios::binary);
  std::string bytes(std::istreambuf_iterator<char>(file), {});
  if (!file.good() && !file.eof()) {
    return absl::UnavailableError(absl::StrCat("--web: a file cannot be read: ", path.string()));
  }
  return bytes;
}

}  // namespace

absl::StatusOr<WebFiles> WebFiles::Load(const std::string& folder) {
  WebFiles files;
  size_t bytes = 0;
  std::error_code error;
  fs::recursive_directory_iterator entry(folder, error);
  for (; !error && entry != fs::recursive_directory_iterator(); entry.increment(error)) {
    if (absl::StartsWith(entry->path().filename().string(), ".")) {
      entry.disable_recursion_pending();
      continue;
    }
    if (!fs::is_regular_file(entry->symlink_status())) continue;
    if (files.files_.size() == kMaxFiles) {
      return absl::ResourceExhaustedError(
          absl::StrCat("--web: more than ", kMaxFiles, " files in ", folder));
    }
    auto content = ReadFile(entry->path(), kMaxBytes - bytes);
    if (!content.ok()) return content.status();
    bytes += content->size();
    const std::string path =
        absl::StrCat("/", fs::relative(entry->path(), folder).generic_string());
    File file = {
        .bytes = std::make_shared<const std::string>(*std::move(content)),
        .type = TypeOf(path),
        .etag = {},
        .cache_control = HasHash(path) ? "public, max-age=31536000, immutable" : "no-cache"};
    file.etag = absl::StrFormat("\"%016x-%x\"", StableHash(*file.bytes), file.bytes->size());
    files.files_[path] = std::move(file);
  }
  if (error || files.files_.count("/index.html") == 0) {
    return absl::NotFoundError(
        absl::StrCat("--web: no index.html in ", folder, "; name the folder of the built planner"));
  }
  return files;
}

HttpReply WebFiles::Reply(absl::string_view path, absl::string_view if_none_match) const {
  const auto found = files_.find(path == "/" ? "/index.html" : path);
  if (found == files_.end()) return {.status = 404};
  const File& file = found->second;
  HttpReply reply = {.status = 200,
                     .fields = {{"etag", file.etag}, {"cache-control", file.cache_control}}};
  if (absl::StrContains(if_none_match, file.etag)) {
    reply.status = 304;
    return reply;
  }
  reply.fields.emplace_back("content-type", file.type);
  reply.body = file.bytes;
  return reply;
}

}  // namespace tissueform
