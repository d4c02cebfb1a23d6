// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/storage_receiver.h"

#include <algorithm>
#include <atomic>
#include <list>
#include <thread>
#include <unistd.h>
#include <utility>

#include "absl/base/thread_annotations.h"
#include "absl/strings/str_cat.h"
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmnet/dcmlayer.h>
#include <sys/socket.h>

#include "client/pacs_bridge/network/address_set.h"
#include "client/pacs_bridge/network/dimse_association.h"
#include "client/pacs_bridge/network/listening_socket.h"
#include "client/pacs_bridge/network/socket_layer.h"
#include "client/pacs_bridge/network/storage_association.h"
#include "core/base/mutex.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

// Connections beyond max_associations that receive a refusal; more are closed without an answer.
constexpr int kMaxRefusalReplies = 16;

absl::Status CheckOptions(const ReceiverOptions& options) {
  if (options.max_associations < 1) {
    return absl::InvalidArgumentError("max_associations must be 1 or more");
  }
  std::vector<std::string> titles = options.calling_ae_titles;
  titles.push_back(options.ae_title);
  for (const std::string& title : titles) TF_RETURN_IF_ERROR(CheckAeTitle(title));
  return absl::OkStatus();
}

class Receiver : public StorageReceiver {
 public:
  Receiver(const ReceiverOptions& options, AddressSet addresses, ListeningSocket listening,
           std::shared_ptr<DcmTransportLayer> secure, InstanceFolder* folder, InstanceSink* sink)
      : options_(options),
        addresses_(std::move(addresses)),
        secure_(std::move(secure)),
        context_{&options_, secure_.get(), folder, sink, &accepted_, &refused_, &kept_},
        listening_(std::move(listening)),
        thread_([this] { Run(); }) {}

  ~Receiver() override { Stop(); }

  int port() const override { return listening_.port(); }

  ReceiverCounts Counts() const override {
    return {accepted_, refused_, kept_, std::max(int64_t{0}, open_.load())};
  }

  void Stop() override {
    stopping_ = true;
    listening_.Wake();
    {
      MutexLock lock(mutex_);
      for (Connection& connection : connections_) shutdown(connection.socket, SHUT_RDWR);
    }
    if (thread_.joinable()) thread_.join();
    listening_.Close();
  }

 private:
  struct Connection {
    int socket = -1;  // a second descriptor: DCMTK closes its own
    std::atomic<bool> done{false};
    std::thread thread = {};
  };

  void Run() {
    while (!stopping_) {
      const std::optional<ListeningSocket::Connection> taken = listening_.Accept();
      Reap(false);
      if (taken) Admit(*taken);
    }
    Reap(true);
  }

  void Admit(const ListeningSocket::Connection& taken) {
    const int64_t open = open_;
    const bool is_known = addresses_.Contains(taken.address);
    if (!is_known || open >= options_.max_associations + kMaxRefusalReplies) {
      ++refused_;
      close(taken.socket);
      context_.sink->ConnectionRefused(
          {.address = taken.address,
           .reason = is_known ? "too many associations are open" : "unknown address"});
      return;
    }
    MutexLock lock(mutex_);
    if (stopping_) {
      close(taken.socket);
      return;
    }
    ++open_;
    Connection& connection = connections_.emplace_back();
    connection.socket = dup(taken.socket);
    connection.thread = std::thread([this, &connection, taken, number = ++number_,
                                     crowded = open >= options_.max_associations] {
      ServeAssociation(context_, taken.socket, taken.address, number, crowded);
      // The peer sees the end at once, not when this descriptor is closed.
      shutdown(connection.socket, SHUT_RDWR);
      --open_;
      connection.done = true;
    });
  }

  // Only the accepting thread takes connections out, so it may join without the mutex.
  void Reap(bool all) {
    std::list<Connection> ended;
    {
      MutexLock lock(mutex_);
      for (auto it = connections_.begin(); it != connections_.end();) {
        const auto next = std::next(it);
        if (all || it->done) ended.splice(ended.end(), connections_, it);
        it = next;
      }
    }
    for (Connection& connection : ended) {
      if (all) shutdown(connection.socket, SHUT_RDWR);
      connection.thread.join();
      close(connection.socket);
    }
  }

  const ReceiverOptions options_;
  const AddressSet addresses_;
  const std::shared_ptr<DcmTransportLayer> secure_;
  const AssociationContext context_;

  std::atomic<int64_t> accepted_{0};
  std::atomic<int64_t> refused_{0};
  std::atomic<int64_t> kept_{0};
  std::atomic<int64_t> open_{0};
  std::atomic<bool> stopping_{false};
  int64_t number_ = 0;  // of the accepting thread

  Mutex mutex_;
  std::list<Connection> connections_ ABSL_GUARDED_BY(mutex_);

  ListeningSocket listening_;
  std::thread thread_;  // last: it begins when all else is there
};

}  // namespace

absl::StatusOr<std::unique_ptr<StorageReceiver>> StorageReceiver::Start(
    const ReceiverOptions& options, InstanceFolder* folder, InstanceSink* sink) {
  TF_RETURN_IF_ERROR(PrepareDicomNetwork());
  TF_RETURN_IF_ERROR(CheckOptions(options));
  TF_ASSIGN_OR_RETURN(AddressSet addresses, AddressSet::Parse(options.addresses));
  std::shared_ptr<DcmTransportLayer> secure;
  if (options.tls) {
    TF_ASSIGN_OR_RETURN(secure, MakeTlsLayer(*options.tls, TlsRole::kReceiver));
  }
  TF_ASSIGN_OR_RETURN(ListeningSocket listening,
                      ListeningSocket::Listen(options.address, options.port));
  return std::make_unique<Receiver>(options, std::move(addresses), std::move(listening),
                                    std::move(secure), folder, sink);
}

}  // namespace tissueform
