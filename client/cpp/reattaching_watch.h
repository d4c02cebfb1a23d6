// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "client/cpp/reattachment.h"
#include "client/cpp/tissueform_client.h"
#include "core/base/mutex.h"

namespace tissueform {

// A watch that outlives its connection and the server that held its session: where it breaks
// another one of the same session begins. Frames are then numbered from the start; the last
// received frame stays good until the next comes, and where that falls_back for some seconds more.
//
// One thread receives and acknowledges; Cancel may be called from others. It comes back within
// Receive. The client must outlive it.
class ReattachingWatch {
 public:
  struct Options {
    WatchStream::Options watch = {};
    Reattachment::Options reattachment = {};  // functions are called on the receiving thread
  };

  // Errors: those of TissueformClient::Watch.
  static absl::StatusOr<std::unique_ptr<ReattachingWatch>> Open(TissueformClient* client,
                                                                const std::string& session,
                                                                Options options);

  // As of WatchStream.
  const v1::WatchForm& form() const { return form_; }

  // Blocks until the next frame. Empty when the watch has ended; Finish says how.
  std::optional<v1::WatchFrame> Receive();

  // Of the frame that was received last: it shows what was committed, or the mesh at rest, but only
  // because another watch has begun, while the last one showed a drag that has not come back yet.
  // Who draws keeps the drag's last frame for a while: the server that has just taken the session
  // does not know it. Of the receiving thread.
  bool falls_back() const { return falls_back_; }

  // The frame that was received last, and all before it, were used. If the acknowledgement fails,
  // the watch starts again, because the server would soon stop sending.
  void Ack(const v1::WatchFrame& frame);

  // Ends the watch at once. Any thread, any time.
  void Cancel();

  // How the watch ended. Call it once, when Receive has returned nothing.
  absl::Status Finish() const { return end_; }

  int reattachments() const { return reattachment_.count(); }
  // The server of a cluster that answers now, or did last.
  std::string node() const { return Current()->node(); }

 private:
  ReattachingWatch(TissueformClient* client, std::string session, Options options)
      : client_(client),
        session_(std::move(session)),
        options_(std::move(options)),
        reattachment_(options_.reattachment) {}

  void Judge(const v1::WatchFrame& frame);
  void Adopt(std::unique_ptr<WatchStream> watch) ABSL_LOCKS_EXCLUDED(mutex_);
  std::shared_ptr<WatchStream> Current() const ABSL_LOCKS_EXCLUDED(mutex_);

  // Constant.
  TissueformClient* const client_;
  const std::string session_;
  const Options options_;

  // Self-synchronised.
  Reattachment reattachment_;

  // The receiving thread's.
  v1::WatchForm form_;
  absl::Status end_;
  bool saw_drag_ = false;     // in the last frame that did not fall back
  bool awaits_drag_ = false;  // since the watch started again
  bool falls_back_ = false;

  mutable Mutex mutex_;
  // Replaced by the receiving thread alone.
  std::shared_ptr<WatchStream> watch_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
