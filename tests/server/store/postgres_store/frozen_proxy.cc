// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/server/store/postgres_store/frozen_proxy.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <poll.h>
#include <string>
#include <unistd.h>

#include "absl/strings/match.h"
#include "absl/strings/string_view.h"
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

namespace tissueform::testing {
namespace {

constexpr int kPollMilliseconds = 20;

sockaddr_in Loopback(int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

// With which the database says that it waits for statements.
constexpr absl::string_view kReady("Z\0\0\0\5I", 6);

// What there is; empty at the end.
std::string Read(int from) {
  std::array<char, 16384> bytes{};
  const ssize_t count = read(from, bytes.data(), bytes.size());
  return {bytes.data(), static_cast<size_t>(std::max<ssize_t>(count, 0))};
}

bool Write(int to, absl::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = send(to, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (written <= 0) return false;
    bytes.remove_prefix(static_cast<size_t>(written));
  }
  return true;
}

}  // namespace

FrozenProxy::FrozenProxy(int port) : database_port_(port) {
  listener_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address = Loopback(0);
  socklen_t size = sizeof(address);
  if (bind(listener_, reinterpret_cast<sockaddr*>(&address), size) != 0 ||
      listen(listener_, 16) != 0 ||
      getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size) != 0) {
    std::abort();
  }
  port_ = ntohs(address.sin_port);
  accepting_ = std::thread([this] { Accept(); });
}

FrozenProxy::~FrozenProxy() {
  ending_ = true;
  accepting_.join();
  std::vector<std::thread> threads;
  {
    MutexLock lock(mutex_);
    threads.swap(threads_);
  }
  for (std::thread& thread : threads) thread.join();
  close(listener_);
}

void FrozenProxy::Freeze() { ++generation_; }

void FrozenProxy::FreezeAll() {
  shut_ = true;
  Freeze();
}

void FrozenProxy::FreezeAt(const std::string& text) {
  MutexLock lock(mutex_);
  stop_at_ = text;
}

bool FrozenProxy::StopsAt(absl::string_view bytes) {
  MutexLock lock(mutex_);
  if (stop_at_.empty() || !absl::StrContains(bytes, stop_at_)) return false;
  stop_at_.clear();
  return true;
}

void FrozenProxy::Accept() {
  while (!ending_) {
    pollfd waiting = {.fd = listener_, .events = POLLIN, .revents = 0};
    if (poll(&waiting, 1, kPollMilliseconds) != 1) continue;
    const int client = accept(listener_, nullptr, nullptr);
    if (client < 0) continue;
    ++accepted_;
    MutexLock lock(mutex_);
    threads_.emplace_back([this, client, generation = shut_ ? -1 : generation_.load(),
                           until_ready = shut_when_ready_.load()] {
      Forward(client, generation, until_ready);
      close(client);
    });
  }
}

void FrozenProxy::Forward(int client, int generation, bool until_ready) {
  const int database = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address = Loopback(database_port_);
  bool open = connect(database, reinterpret_cast<sockaddr*>(&address), sizeof(address)) == 0;
  while (open && !ending_) {
    std::array<pollfd, 2> sides = {{{.fd = client, .events = POLLIN, .revents = 0},
                                    {.fd = database, .events = POLLIN, .revents = 0}}};
    const bool frozen = generation != generation_;
    const int ready = poll(sides.data(), frozen ? 0 : 2, kPollMilliseconds);
    if (ready <= 0) continue;
    if (sides[0].revents != 0) {
      const std::string asked = Read(client);
      if (StopsAt(asked)) {
        generation = -1;
        continue;
      }
      open = !asked.empty() && Write(database, asked);
    }
    if (open && sides[1].revents != 0) {
      const std::string received = Read(database);
      open = !received.empty() && Write(client, received);
      if (until_ready && absl::EndsWith(received, kReady)) generation = -1;
    }
  }
  close(database);
}

}  // namespace tissueform::testing
