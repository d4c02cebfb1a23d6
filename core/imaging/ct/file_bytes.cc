// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/file_bytes.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <vector>
#include <zlib.h>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"

#include "core/base/lfs_pointer.h"

namespace tissueform {
namespace {

constexpr size_t kChunk = size_t{1} << 20;
constexpr int kGzipOrZlib = 15 + 32;  // window bits, and zlib's "detect which"
constexpr int kBareDeflate = -15;     // without a header

class Inflater {
 public:
  explicit Inflater(int format) : buffer_(kChunk) {
    ready_ = inflateInit2(&stream_, format) == Z_OK;
  }
  ~Inflater() { inflateEnd(&stream_); }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;

  // Size of the first stream, which it takes from `packed`; -1 when it does not end as it should.
  // Appends what it holds to `unpacked`, unless that is null.
  int64_t TakeStream(int64_t enough, absl::string_view* packed, std::string* unpacked) {
    int64_t count = 0;
    int result = ready_ ? inflateReset(&stream_) : Z_MEM_ERROR;
    while (result == Z_OK && count <= enough) {
      const size_t given = std::min(packed->size(), kChunk);
      // zlib reads only; its type is older than const.
      stream_.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed->data()));
      stream_.avail_in = static_cast<uInt>(given);
      stream_.next_out = buffer_.data();
      stream_.avail_out = static_cast<uInt>(buffer_.size());
      result = inflate(&stream_, Z_NO_FLUSH);
      packed->remove_prefix(given - stream_.avail_in);
      const size_t made = buffer_.size() - stream_.avail_out;
      count += static_cast<int64_t>(made);
      if (unpacked != nullptr)
        unpacked->append(reinterpret_cast<const char*>(buffer_.data()), made);
    }
    is_ended_ = result == Z_STREAM_END;
    return result == Z_OK || result == Z_STREAM_END ? count : -1;
  }

  // Whether the last stream was whole.
  bool is_ended() const { return is_ended_; }

 private:
  z_stream stream_{};
  std::vector<Bytef> buffer_;
  bool ready_ = false;
  bool is_ended_ = false;
};

}  // namespace

absl::StatusOr<std::string> ReadWholeFile(const std::string& path, int64_t* bytes_left) {
  std::error_code error;
  const auto bytes = std::filesystem::is_regular_file(path, error)
                         ? static_cast<int64_t>(std::filesystem::file_size(path, error))
                         : int64_t{-1};
  if (error || bytes < 0) {
    return absl::InvalidArgumentError("the file, or the data file beside it, cannot be opened");
  }
  if (bytes > *bytes_left) {
    return absl::ResourceExhaustedError("its files are larger than the limit on their bytes");
  }
  *bytes_left -= bytes;
  std::string contents(static_cast<size_t>(bytes), '\0');
  std::ifstream stream(path, std::ios::binary);
  if (!stream.read(contents.data(), bytes)) {
    return absl::InvalidArgumentError("a file cannot be read, or became shorter");
  }
  return contents;
}

// Counted and thrown away, a chunk at a time, and no further than is enough: a few kilobytes may
// unpack to any number of gigabytes.
int64_t UnpackedSize(absl::string_view packed, int64_t enough) {
  enough += static_cast<int64_t>(kChunk);
  Inflater inflater(kGzipOrZlib);
  int64_t count = 0;
  do {
    const int64_t stream_bytes = inflater.TakeStream(enough - count, &packed, nullptr);
    if (stream_bytes < 0) return 0;
    count += stream_bytes;
  } while (count <= enough && IsGzip(packed));
  return count;
}

bool IsGzip(absl::string_view bytes) { return absl::StartsWith(bytes, "\x1f\x8b"); }

std::string UnpackedStart(absl::string_view contents, size_t count) {
  if (!IsGzip(contents)) return std::string(contents.substr(0, count));
  std::string start(count, '\0');
  z_stream stream{};
  if (inflateInit2(&stream, kGzipOrZlib) != Z_OK) return "";
  const absl::string_view packed = contents.substr(0, kChunk);  // its header is much shorter
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data()));
  stream.avail_in = static_cast<uInt>(packed.size());
  stream.next_out = reinterpret_cast<Bytef*>(start.data());
  stream.avail_out = static_cast<uInt>(start.size());
  const int result = inflate(&stream, Z_SYNC_FLUSH);
  inflateEnd(&stream);
  const bool is_usable = result == Z_OK || result == Z_STREAM_END || result == Z_BUF_ERROR;
  start.resize(is_usable ? count - stream.avail_out : 0);
  return start;
}

absl::StatusOr<std::string> Inflated(absl::string_view packed, int64_t max_bytes) {
  Inflater inflater(kBareDeflate);
  std::string unpacked;
  const int64_t count = inflater.TakeStream(max_bytes, &packed, &unpacked);
  if (count > max_bytes) {
    return absl::ResourceExhaustedError(
        absl::StrCat("it unpacks to more than ", max_bytes, " bytes"));
  }
  if (count < 0 || !inflater.is_ended()) {
    return absl::InvalidArgumentError("its compressed part is cut off or damaged");
  }
  return unpacked;
}

bool IsLfsPointerFile(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  std::string start(kLfsPointerStart.size(), '\0');
  stream.read(start.data(), static_cast<std::streamsize>(start.size()));
  return stream.good() && IsLfsPointer(start);
}

}  // namespace tissueform
