// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/server/postgres_store/frozen_proxy.h"

#include <array>
#include <cstdlib>
#include <poll.h>
#include <unistd.h>

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

// False at the end of `from`.
bool Move(int from, int to) {
  std::array<char, 16384> bytes{};
  const ssize_t count = read(from, bytes.data(), bytes.size());
  if (count <= 0) return false;
  for (ssize_t sent = 0; sent < count;) {
    const ssize_t written =
        send(to, bytes.data() + sent, static_cast<size_t>(count - sent), MSG_NOSIGNAL);
    if (written <= 0) return false;
    sent += written;
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

void FrozenProxy::Accept() {
  while (!ending_) {
    pollfd waiting = {.fd = listener_, .events = POLLIN, .revents = 0};
    if (poll(&waiting, 1, kPollMilliseconds) != 1) continue;
    const int client = accept(listener_, nullptr, nullptr);
    if (client < 0) continue;
    ++accepted_;
    MutexLock lock(mutex_);
    threads_.emplace_back([this, client, generation = shut_ ? -1 : generation_.load()] {
      Forward(client, generation);
      close(client);
    });
  }
}

void FrozenProxy::Forward(int client, int generation) {
  const int database = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address = Loopback(database_port_);
  bool open = connect(database, reinterpret_cast<sockaddr*>(&address), sizeof(address)) == 0;
  while (open && !ending_) {
    std::array<pollfd, 2> sides = {{{.fd = client, .events = POLLIN, .revents = 0},
                                    {.fd = database, .events = POLLIN, .revents = 0}}};
    const bool frozen = generation != generation_;
    const int ready = poll(sides.data(), frozen ? 0 : 2, kPollMilliseconds);
    if (ready <= 0) continue;
    if (sides[0].revents != 0) open = Move(client, database);
    if (open && sides[1].revents != 0) open = Move(database, client);
  }
  close(database);
}

}  // namespace tissueform::testing
