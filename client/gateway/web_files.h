// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "client/gateway/http_message.h"

namespace tissueform {

// The planner's files, read once: what a request names is looked up among names that were found at
// the start, so no path leads out of the folder and no folder is listed. Constant.
class WebFiles {
 public:
  // Nothing.
  WebFiles() = default;

  // All files below `folder`, at most 4096 and 256 MiB of them. Symbolic links and names that begin
  // with a dot are left out.
  //
  // Errors: NotFound when it has no index.html; ResourceExhausted when there are more.
  static absl::StatusOr<WebFiles> Load(const std::string& folder);

  // The reply to GET or HEAD for a path as it was requested: 200 with ETag, 304 where the client
  // has it (`if_none_match`), 404. "/" is index.html. Clients may cache files below /assets/ whose
  // name holds a hash ("index-B7sKq2aZ.js") forever; they ask again for others.
  HttpReply Reply(absl::string_view path, absl::string_view if_none_match) const;

  size_t size() const { return files_.size(); }

 private:
  struct File {
    std::shared_ptr<const std::string> bytes;
    std::string type;
    std::string etag;
    std::string cache_control;
  };

  std::map<std::string, File, std::less<>> files_;  // by path, "/assets/x.js"
};

}  // namespace tissueform
