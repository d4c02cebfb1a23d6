// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/http_server.h"

#include <algorithm>
#include <thread>
#include <unistd.h>
#include <utility>
#include <vector>

#include "spdlog/spdlog.h"
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/strand.hpp>
#include <sys/socket.h>

#include "client/gateway/beast_connection.h"
#include "client/gateway/beast_live.h"
#include "core/base/status_macros.h"
#include "server/platform/connection_listener.h"

namespace tissueform {
namespace {

using boost::asio::ip::tcp;

// What the process needs beside connections of clients: those to servers, logs, files.
constexpr int kReservedDescriptors = 200;

class BeastServer final : public HttpServer {
 public:
  BeastServer(const Options& options, HttpHandler* handler, GatewayCounters* counters)
      : context_{.limits = options.limits, .handler = handler, .counters = counters},
        work_(context_.io.get_executor()) {}

  absl::Status Listen(const Options& options) {
    const int descriptors = std::max(RaiseDescriptorLimit() - kReservedDescriptors, 1);
    TF_ASSIGN_OR_RETURN(listener_, ConnectionListener::Listen(
                                       {.host = options.host,
                                        .port = options.port,
                                        .most = std::min(options.limits.connections, descriptors),
                                        .most_of_address = options.limits.connections_per_address,
                                        .chosen_by = "--listen"}));
    for (int i = 0; i < options.threads; ++i) {
      threads_.emplace_back([this] { context_.io.run(); });
    }
    listener_->Start([this](int fd, int /*listener_fd*/) { Accept(fd); });
    return absl::OkStatus();
  }

  ~BeastServer() override {
    if (listener_ != nullptr && !context_.draining) Drain();
    work_.reset();
    context_.io.stop();
    for (std::thread& thread : threads_) thread.join();
  }

  int port() const override { return listener_->port(); }

  void Post(std::function<void()> job) override { boost::asio::post(context_.io, std::move(job)); }

  void Drain() override {
    context_.draining = true;
    listener_->Stop();
    const auto now = std::chrono::steady_clock::now();
    for (const auto& connection : context_.live.All()) connection->Drain();
    if (context_.live.WaitUntilNone(now + context_.limits.drain_deadline)) return;
    for (const auto& connection : context_.live.All()) connection->Abort();
    // Canceled calls end soon, regardless of what the server does.
    if (!context_.live.WaitUntilNone(now + 3 * context_.limits.drain_deadline)) {
      spdlog::error("some connections do not end");
    }
  }

 private:
  void Accept(int fd) {
    sockaddr_storage address{};
    socklen_t size = sizeof(address);
    getsockname(fd, reinterpret_cast<sockaddr*>(&address), &size);
    boost::system::error_code error;
    tcp::socket socket(boost::asio::make_strand(context_.io));
    socket.assign(address.ss_family == AF_INET6 ? tcp::v6() : tcp::v4(), fd, error);
    if (error) {
      close(fd);
      return;
    }
    std::make_shared<BeastConnection>(&context_, std::move(socket))->Run();
  }

  BeastContext context_;
  boost::asio::executor_work_guard<boost::asio::io_context::executor_type> work_;
  std::unique_ptr<ConnectionListener> listener_;
  std::vector<std::thread> threads_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<HttpServer>> HttpServer::Start(const Options& options,
                                                              HttpHandler* handler,
                                                              GatewayCounters* counters) {
  auto server = std::make_unique<BeastServer>(options, handler, counters);
  TF_RETURN_IF_ERROR(server->Listen(options));
  return server;
}

}  // namespace tissueform
